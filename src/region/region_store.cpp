#include "region/region_store.h"

#include "common/error.h"
#include "web/json/json.h"

namespace livemap::region {
namespace {

const std::vector<std::string>& RegionSchema() {
  static const std::vector<std::string> kSteps{
      "CREATE TABLE zones (zone TEXT PRIMARY KEY, log TEXT NOT NULL, sequence INTEGER NOT NULL, "
      "heard_ns INTEGER NOT NULL) WITHOUT ROWID;"
      "CREATE TABLE hazards (zone TEXT NOT NULL, uuid TEXT NOT NULL, feature TEXT NOT NULL, "
      "PRIMARY KEY (zone, uuid)) WITHOUT ROWID;",
      "ALTER TABLE zones ADD COLUMN scope TEXT NOT NULL DEFAULT '';"};
  return kSteps;
}

}  // namespace

RegionStore::RegionStore(const std::string& path, const protocol::HazardCatalogue& catalogue,
                         std::int64_t now_ns)
    : catalogue_(catalogue) {
  const MutexLock lock(mutex_);
  // Not synchronous to the last commit: what a power cut takes the zones tell again.
  const auto open = [&]() REQUIRES(mutex_) {
    database_.emplace(path, false);
    database_->CheckPages();
    database_->Migrate(RegionSchema());
  };
  try {
    open();
  } catch (const StoreError& error) {
    if (!IsCorruption(error)) throw;
    database_.reset();
    damage_ = "the region's store was damaged and is now '" + QuarantineDatabase(path, now_ns) +
              "', all zones are read anew";
    open();
  }
}

RegionStore::Kept RegionStore::Load(const std::string& zone, std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  Kept kept;
  auto place =
      database_->Prepare("SELECT log, sequence, heard_ns, scope FROM zones WHERE zone = ?");
  place.Bind(1, zone);
  if (place.Step()) {
    const auto log = Uuid::Parse(place.Text(0));
    const std::int64_t sequence = place.Int(1);
    const std::int64_t heard_ns = place.Int(2);
    if (log && sequence >= 0)
      kept.place = {*log, static_cast<std::uint64_t>(sequence), 0, place.Text(3)};
    // Nobody was heard in the future.
    if (heard_ns > 0 && heard_ns <= now_ns) kept.place.heard_ns = heard_ns;
  }
  auto rows = database_->Prepare("SELECT feature FROM hazards WHERE zone = ?");
  rows.Bind(1, zone);
  while (rows.Step()) {
    try {
      ToldHazard told = ParseToldHazard(rows.Text(0), now_ns);
      if (told.IsThere()) kept.hazards.push_back(std::move(told));
    } catch (const StoreError&) {
      throw;
    } catch (const Error&) {
      // A row that is missing is told again when the zone is read anew.
      kept.place.log = Uuid{};
    }
  }
  return kept;
}

void RegionStore::Save(const std::string& zone, const LogPlace& place,
                       const std::vector<ToldHazard>& hazards, const std::vector<Uuid>& gone) {
  const MutexLock lock(mutex_);
  auto put = database_->Prepare("INSERT OR REPLACE INTO hazards VALUES (?, ?, ?)");
  auto erase = database_->Prepare("DELETE FROM hazards WHERE zone = ? AND uuid = ?");
  auto set = database_->Prepare("INSERT OR REPLACE INTO zones VALUES (?, ?, ?, ?, ?)");
  const auto forget = [&](const Uuid& uuid) {
    erase.Bind(1, zone).Bind(2, uuid.ToString()).Execute();
  };
  database_->Transaction([&] {
    for (const ToldHazard& told : hazards) {
      if (!told.IsThere()) {
        forget(told.hazard.uuid);
        continue;
      }
      put.Bind(1, zone).Bind(2, told.hazard.uuid.ToString());
      put.Bind(3, web::ToText(web::HazardFeature(told.hazard, catalogue_, told.words))).Execute();
    }
    for (const Uuid& uuid : gone) forget(uuid);
    set.Bind(1, zone).Bind(2, place.log.ToString());
    set.Bind(3, static_cast<std::int64_t>(place.sequence)).Bind(4, place.heard_ns);
    set.Bind(5, place.scope).Execute();
  });
}

}  // namespace livemap::region
