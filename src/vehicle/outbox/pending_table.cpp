#include "vehicle/outbox/pending_table.h"

#include <algorithm>

namespace livemap::vehicle {

std::string OpenOrQuarantine(const std::string& path, const std::vector<std::string>& migrations,
                             std::int64_t now_ns, std::unique_ptr<SqliteDatabase>& database,
                             const std::function<void()>& load) {
  const auto open = [&] {
    database = std::make_unique<SqliteDatabase>(path, /*durable=*/true);
    database->CheckPages();
    database->Migrate(migrations);
    load();
  };
  try {
    open();
    return "";
  } catch (const StoreError& error) {
    if (!IsCorruption(error)) throw;
  }
  database.reset();
  std::string set_aside = QuarantineDatabase(path, now_ns);
  open();
  return set_aside;
}

void ErasePending(SqliteDatabase& database, const Uuid& uuid) {
  database.Prepare("DELETE FROM pending WHERE uuid=?")
      .BindBlob(1, uuid.bytes.data(), uuid.bytes.size())
      .Execute();
}

Uuid UuidFromBlob(const std::vector<std::uint8_t>& blob) {
  Uuid uuid;
  if (blob.size() == uuid.bytes.size()) std::copy(blob.begin(), blob.end(), uuid.bytes.begin());
  return uuid;
}

}  // namespace livemap::vehicle
