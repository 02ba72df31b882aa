#include "vehicle/alerts/announced_hazards.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <unordered_set>

#include "common/sqlite.h"

namespace livemap::vehicle {
namespace {

constexpr std::size_t kRemovedKept =
    100000;  // Beyond it all are forgotten: the map knows them, too.

/// Per axis; 0 where the covariance is none.
double SigmaOf(const Eigen::Matrix2d& covariance_m2) {
  const double sigma_m = std::sqrt(covariance_m2.trace() / 2);
  return std::isfinite(sigma_m) ? sigma_m : 0;
}

/// None for a text that is no trails: another program may have written it.
std::vector<protocol::Trail> StoredTrails(const std::string& text) {
  try {
    return protocol::ParseTrails(text);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

std::optional<StoredHazards> ReadStoredHazards(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::nullopt;
  SqliteDatabase database(path, false);
  SqliteStatement tables = database.Prepare(
      "SELECT count(*) FROM sqlite_master WHERE type='table' AND name IN"
      " ('known','gone','zones','cells')");
  if (!tables.Step() || tables.Int(0) != 4) return std::nullopt;
  tables.Reset();
  SqliteStatement course =
      database.Prepare("SELECT count(*) FROM pragma_table_info('known') WHERE name='trails'");
  if (!course.Step() || course.Int(0) != 1) return std::nullopt;
  course.Reset();
  StoredHazards stored;
  database.Transaction([&] {
    SqliteStatement rows = database.Prepare(
        "SELECT id,class_name,latitude,longitude,sequence,substr(zone,1,64),"
        " course_rad,typeof(course_rad)='real',trails,typeof(trails)='text' FROM known"
        " WHERE of_zone=1 AND sequence>0 AND typeof(id)='blob' AND length(id)=16");
    while (rows.Step()) {
      StoredHazards::Row row;
      const std::vector<std::uint8_t> id = rows.Blob(0);
      std::copy_n(id.begin(), row.hazard.id.bytes.size(), row.hazard.id.bytes.begin());
      row.hazard.class_name = rows.Text(1);
      row.hazard.position = {rows.Real(2), rows.Real(3)};
      row.sequence = static_cast<std::uint64_t>(rows.Int(4));
      row.zone = rows.Text(5);
      if (rows.Int(7) != 0) row.hazard.course_rad = rows.Real(6);
      if (rows.Int(9) != 0) row.hazard.trails = StoredTrails(rows.Text(8));
      if (geo::IsValid(row.hazard.position) && protocol::IsCourseOfPass(row.hazard.course_rad)) {
        stored.rows.push_back(row);
      }
    }
    SqliteStatement newest = database.Prepare(
        "SELECT substr(zone,1,64),max(sequence) FROM"
        " (SELECT zone,sequence FROM known WHERE of_zone=1"
        " UNION ALL SELECT zone,sequence FROM gone"
        " UNION ALL SELECT zone,map_sequence FROM zones"
        " UNION ALL SELECT zone,sequence FROM cells) GROUP BY 1");
    while (newest.Step()) {
      stored.sequences[newest.Text(0)] = static_cast<std::uint64_t>(newest.Int(1));
    }
  });
  return stored;
}

/// Whether the zone has said something newer about the hazard, or it is another zone's.
bool AnnouncedHazards::IsOld(const Uuid& id, const Word& word, bool is_there) const {
  const auto is_old = [&word](const Word& known) {
    // A map that knows one zone only names none.
    const bool is_same = word.zone == known.zone || word.zone.empty() || known.zone.empty();
    return !is_same || word.sequence <= known.sequence;
  };
  const auto there = there_.find(id);
  if (there != there_.end()) {
    // The same may have been told before by a message that does not say how it is passed.
    const Word& known = there->second;
    const bool is_same = word.sequence == known.sequence && word.zone == known.zone;
    const bool adds_course = std::isnan(known.course_rad) && !std::isnan(word.course_rad);
    const bool adds_trails = !word.trails.empty() && !protocol::AreSame(word.trails, known.trails);
    return !(is_same && (adds_course || adds_trails)) && is_old(known);
  }
  const auto gone = gone_.find(id);
  if (gone == gone_.end() || !is_old(gone->second)) return false;
  // One announcement says that a hazard left a cell of the map and came into the next one.
  const bool came_by_the_same = is_there && word.sequence == gone->second.sequence &&
                                (word.zone == gone->second.zone || word.zone.empty());
  return !came_by_the_same;
}

AnnouncedHazards::Changes AnnouncedHazards::Apply(const protocol::Notice& notice) {
  using Action = protocol::Notice::Action;
  Changes changes;
  // The end of a catch-up says what is gone by leaving it out: the map works that out.
  if (notice.action == Action::kCaughtUp || notice.hazard_uuid.IsNil()) return changes;
  const std::vector<protocol::Trail> trails = protocol::ValidTrails(notice.trails, notice.position);
  const Word word{notice.zone, notice.sequence, notice.course_rad, trails};
  const bool is_there = notice.action != Action::kRemoved;
  const bool is_valid =
      geo::IsValid(notice.position) && (!is_there || protocol::IsCourseOfPass(notice.course_rad));
  if (!is_valid || IsOld(notice.hazard_uuid, word, is_there)) return changes;
  if (!is_there) {
    if (gone_.size() >= kRemovedKept) gone_.clear();
    gone_[notice.hazard_uuid] = word;
    if (there_.erase(notice.hazard_uuid) > 0) duplicates_.Remove(notice.hazard_uuid, changes);
    return changes;
  }
  if (is_beyond_ && is_beyond_(notice.zone, notice.position)) {
    ++beyond_zone_;
    return changes;
  }
  Take({notice.hazard_uuid, notice.class_name, notice.position, SigmaOf(notice.covariance_m2),
        std::nullopt, notice.course_rad, trails},
       word, changes);
  return changes;
}

/// A word without a course or trails takes none away.
void AnnouncedHazards::Take(AlertHazard hazard, Word word, Changes& changes) {
  Word& known = there_[hazard.id];
  if (std::isnan(word.course_rad)) hazard.course_rad = word.course_rad = known.course_rad;
  if (word.trails.empty()) hazard.trails = word.trails = known.trails;
  known = word;
  gone_.erase(hazard.id);
  duplicates_.Put(hazard, word.zone, changes);
}

/// Those that count anew: of before, only what the map still has is there.
std::set<std::string> AnnouncedHazards::ZonesBegunAnew(const StoredHazards& stored) const {
  std::set<std::string> zones;
  for (const auto& [zone, before] : stored_sequences_) {
    const auto now = stored.sequences.find(zone);
    if (now == stored.sequences.end() || now->second < before) zones.insert(zone);
  }
  return zones;
}

AnnouncedHazards::Changes AnnouncedHazards::Apply(const StoredHazards& stored) {
  Changes changes;
  const std::set<std::string> anew = ZonesBegunAnew(stored);
  // A map that knows one zone only names none.
  const auto is_anew = [&anew](const std::string& zone) {
    return anew.count(zone) != 0 || anew.count("") != 0;
  };
  stored_sequences_ = stored.sequences;
  for (auto gone = gone_.begin(); gone != gone_.end();) {
    gone = is_anew(gone->second.zone) ? gone_.erase(gone) : std::next(gone);
  }
  std::unordered_set<Uuid> in_map;
  std::vector<Uuid> removed;
  for (const StoredHazards::Row& row : stored.rows) {
    in_map.insert(row.hazard.id);
    const Word word{row.zone, row.sequence, row.hazard.course_rad, row.hazard.trails};
    if (!is_anew(row.zone) && IsOld(row.hazard.id, word, true)) continue;
    Take(row.hazard, word, changes);
  }
  for (auto there = there_.begin(); there != there_.end();) {
    // What is newer than all that the map has taken in will come into it yet.
    const Word& word = there->second;
    auto taken_in = stored.sequences.find(word.zone);
    if (taken_in == stored.sequences.end()) taken_in = stored.sequences.find("");
    const bool is_taken_in =
        taken_in != stored.sequences.end() && word.sequence <= taken_in->second;
    const bool gone = in_map.count(there->first) == 0 && (is_anew(word.zone) || is_taken_in);
    if (gone) removed.push_back(there->first);
    there = gone ? there_.erase(there) : std::next(there);
  }
  std::sort(removed.begin(), removed.end());
  for (const Uuid& id : removed) duplicates_.Remove(id, changes);
  return changes;
}

}  // namespace livemap::vehicle
