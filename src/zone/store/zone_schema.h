#pragma once

#include <soci/soci.h>

#include <string>

namespace livemap::zone {

/// The schema that this program writes.
constexpr int kZoneSchemaVersion = 8;

/// Brings the database at `path`, which `session` has open, up to date, step by step, each step in
/// its own transaction. Throws StoreError when it is of a newer schema.
void MigrateZoneStore(soci::session& session, const std::string& path);

}  // namespace livemap::zone
