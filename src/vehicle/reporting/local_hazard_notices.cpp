// What the zone tells a vehicle: the part of LocalHazardMap that takes in notices.
#include <limits>
#include <utility>

#include "vehicle/outbox/report_table.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

constexpr int kGoneKept = 10000;
/// Told hazards between two kCaughtUp; the zone tells fewer.
constexpr std::size_t kMaxTold = 200000;

bool IsUsable(const protocol::Notice& notice) {
  if (notice.sequence > std::numeric_limits<std::int64_t>::max()) return false;
  if (notice.action == protocol::Notice::Action::kCaughtUp) {
    return geo::IsValid(notice.position) && notice.radius_m >= 0 && notice.radius_m <= 1e6;
  }
  if (notice.hazard_uuid.IsNil()) return false;
  if (notice.action == protocol::Notice::Action::kRemoved) return true;
  return geo::IsValid(notice.position) && !notice.class_name.empty() &&
         notice.class_name.size() <= protocol::kMaxClassNameBytes && notice.confidence >= 0 &&
         notice.confidence <= 1;
}

}  // namespace

std::size_t LocalHazardMap::Apply(const std::vector<protocol::Notice>& notices) {
  std::vector<Change> changes;
  NoticeSequenceTracker chain = chain_;
  std::set<Uuid> told = told_;
  std::size_t unusable = 0;
  database_->Transaction([&] {
    for (const protocol::Notice& notice : notices) {
      if (!IsUsable(notice)) {
        ++unusable;
        continue;
      }
      if (notice.action == protocol::Notice::Action::kCaughtUp) {
        if (!CatchUp(notice, told, chain, changes)) ++unusable;
        told.clear();
        continue;
      }
      if (notice.vehicle_id.empty()) {
        chain.Add(notice.previous_sequence, notice.sequence);
      } else if (told.size() < kMaxTold) {
        told.insert(notice.hazard_uuid);
      }
      if (!IsNews(notice)) continue;
      StoreNotice(notice);
      changes.push_back({notice.hazard_uuid, notice.action != protocol::Notice::Action::kRemoved,
                         notice.class_name, notice.position});
    }
    if (chain.known() != chain_.known()) {
      database_->Prepare("UPDATE zone SET map_sequence=?")
          .Bind(1, static_cast<std::int64_t>(chain.known()))
          .Execute();
    }
    EvictBeyondLimit(changes);
  });
  Show(changes);
  chain_ = std::move(chain);
  told_ = std::move(told);
  return unusable;
}

/// Takes away what the zone no longer has and closes the gap; false when some of what belongs to
/// this kCaughtUp did not come: then the gap stays open, and the zone tells again.
bool LocalHazardMap::CatchUp(const protocol::Notice& notice, const std::set<Uuid>& told,
                             NoticeSequenceTracker& chain, std::vector<Change>& changes) {
  const bool began_anew = notice.previous_sequence > notice.sequence;
  if (told.size() < notice.told) return false;
  if (notice.previous_sequence > chain.known() && !began_anew) return false;
  if (notice.previous_sequence == 0 || began_anew) {
    for (const Uuid& id : NotTold(notice, told)) Forget(id, changes);
  }
  if (began_anew) {
    chain = NoticeSequenceTracker(notice.sequence);
  } else {
    chain.CloseTo(notice.sequence);
  }
  return true;
}

/// Hazards of the zone that a telling of all that is there left out.
std::vector<Uuid> LocalHazardMap::NotTold(const protocol::Notice& notice,
                                          const std::set<Uuid>& told) const {
  const bool began_anew = notice.previous_sequence > notice.sequence;
  SqliteStatement rows =
      database_->Prepare("SELECT id,latitude,longitude,sequence FROM known WHERE of_zone=1");
  std::vector<Uuid> left_out;
  while (rows.Step()) {
    const Uuid id = UuidFromBlob(rows.Blob(0));
    if (told.count(id) != 0) continue;
    const auto sequence = static_cast<std::uint64_t>(rows.Int(3));
    // Own ones that the zone never announced (0) are not for it to tell, newer ones not yet.
    const bool could_be_told =
        sequence > 0 && sequence <= notice.sequence &&
        geo::GeodesicDistanceM({rows.Real(1), rows.Real(2)}, notice.position) <= notice.radius_m;
    if (could_be_told || began_anew) left_out.push_back(id);
  }
  return left_out;
}

bool LocalHazardMap::IsNews(const protocol::Notice& notice) const {
  SqliteStatement query = database_->Prepare(
      "SELECT max(sequence) FROM (SELECT sequence FROM known WHERE id=?1 AND of_zone=1"
      " UNION ALL SELECT sequence FROM gone WHERE id=?1)");
  query.BindBlob(1, notice.hazard_uuid.bytes.data(), notice.hazard_uuid.bytes.size());
  // No row: 0, and sequences begin at 1.
  return !query.Step() || static_cast<std::int64_t>(notice.sequence) > query.Int(0);
}

void LocalHazardMap::StoreNotice(const protocol::Notice& notice) {
  const auto& id = notice.hazard_uuid.bytes;
  const auto sequence = static_cast<std::int64_t>(notice.sequence);
  if (notice.action == protocol::Notice::Action::kRemoved) {
    database_->Prepare("DELETE FROM known WHERE id=?").BindBlob(1, id.data(), id.size()).Execute();
    database_->Prepare("INSERT OR REPLACE INTO gone(id,sequence) VALUES(?,?)")
        .BindBlob(1, id.data(), id.size())
        .Bind(2, sequence)
        .Execute();
    database_
        ->Prepare(
            "DELETE FROM gone WHERE sequence <="
            " (SELECT sequence FROM gone ORDER BY sequence DESC LIMIT 1 OFFSET ?)")
        .Bind(1, std::int64_t{kGoneKept})
        .Execute();
    return;
  }
  SqliteStatement upsert = database_->Prepare(
      "INSERT OR REPLACE INTO"
      " known(id,of_zone,class_name,confidence,latitude,longitude,sequence,news_ns)"
      " VALUES(?,1,?,?,?,?,?,?)");
  upsert.BindBlob(1, id.data(), id.size())
      .Bind(2, notice.class_name)
      .Bind(3, static_cast<double>(notice.confidence))
      .Bind(4, notice.position.latitude_deg)
      .Bind(5, notice.position.longitude_deg)
      .Bind(6, sequence)
      .Bind(7, notice.stamp_ns)
      .Execute();
}

}  // namespace livemap::vehicle
