#pragma once

#include <string>

#include "zone/store/store_connection.h"

namespace livemap::zone {

/// The schema that this program writes.
constexpr int kZoneSchemaVersion = 10;

/// The first that databases of PostgreSQL have.
constexpr int kPostgresqlBegins = 8;

/// Brings the database up to date, step by step, each step in its own transaction; sentences call
/// it `database`. Throws StoreError when it is of a newer schema.
void MigrateZoneStore(StoreConnection& connection, const std::string& database);

}  // namespace livemap::zone
