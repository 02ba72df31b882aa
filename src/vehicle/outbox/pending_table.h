#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/sqlite.h"
#include "common/uuid.h"

namespace livemap::vehicle {

// What the vehicle's outboxes share. Each is a durable SQLite file with a table `pending`: one row
// per unfinished record, with the record's `uuid` as key.

/// Opens or creates the durable store `path` as `database`, migrates it, and calls `load`. When any
/// of that finds a corrupt file, the file is renamed to `<path>.corrupt-<now_ns>`, and all is done
/// once more with a new one. Returns the new name, empty when the file was sound. Throws StoreError
/// for every other failure.
std::string OpenOrQuarantine(const std::string& path, const std::vector<std::string>& migrations,
                             std::int64_t now_ns, std::unique_ptr<SqliteDatabase>& database,
                             const std::function<void()>& load);

/// Removes the record's row, if there is one. Throws StoreError.
void ErasePending(SqliteDatabase& database, const Uuid& uuid);

/// The nil UUID when the blob has not 16 bytes.
Uuid UuidFromBlob(const std::vector<std::uint8_t>& blob);

}  // namespace livemap::vehicle
