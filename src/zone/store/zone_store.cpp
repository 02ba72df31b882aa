#include "zone/store/zone_store.h"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include "common/sqlite.h"
#include "zone/store/zone_schema.h"
#include "zone/store/zone_store_state.h"

namespace livemap::zone {
namespace {

std::string WhyDamaged(const std::string& path, const std::string& verdict) {
  return "store: database '" + path + "' is damaged and left alone: " + verdict +
         "; how to recover what it holds stands in docs/how-to/recover-a-store.md";
}

std::string ConnectionText(const std::string& path) {
  if (path.find('"') != std::string::npos) {
    throw StoreError("store: path '" + path + "' holds a quotation mark, which is not accepted");
  }
  return "db=\"" + path + "\" timeout=10";
}

}  // namespace

ZoneStore::Implementation::Implementation(const std::string& path)
    : path_(path), session_(soci::sqlite3, ConnectionText(path)) {
  Prepare();
}

void ZoneStore::Implementation::Prepare() {
  session_ << "PRAGMA synchronous=FULL";
  std::string mode;
  session_ << "PRAGMA journal_mode=WAL", soci::into(mode);
  session_ << "PRAGMA foreign_keys=ON";
  // 64 MB of pages stay in memory; the log is taken over after 40 MB, so that a page that many
  // commits touch is written to its place once for all of them.
  session_ << "PRAGMA cache_size=-65536";
  int pages = 0;
  session_ << "PRAGMA wal_autocheckpoint=10000", soci::into(pages);
  std::string verdict;
  session_ << "PRAGMA quick_check(1)", soci::into(verdict);
  if (verdict != "ok") throw StoreError(WhyDamaged(path_, verdict));
  MigrateZoneStore(session_, path_);
  PrepareReads();
  PrepareWrites();
}

ZoneStore::ZoneStore(const std::string& path) {
  try {
    implementation_ = std::make_unique<Implementation>(path);
  } catch (const soci::soci_error& error) {
    const std::string words = error.get_error_message();
    const bool damaged = words.find("malformed") != std::string::npos ||
                         words.find("not a database") != std::string::npos;
    if (damaged) throw StoreError(WhyDamaged(path, words));
    throw StoreError("store: opening '" + path + "' failed: " + words);
  }
}

ZoneStore::~ZoneStore() = default;

int ZoneStore::SchemaVersion() { return kZoneSchemaVersion; }

}  // namespace livemap::zone
