#include "region/zone_follower.h"

#include <algorithm>
#include <utility>

#include "common/error.h"
#include "common/sha256.h"
#include "common/time.h"

namespace livemap::region {
namespace {

/// When a zone was heard is kept so often where nothing else is to be.
constexpr double kKeepHeardS = 10;

void AppendRings(const directory::ZoneArea& area, std::string& text) {
  for (const auto& ring : area.rings()) {
    text += '|';
    for (const geo::GeoPoint& corner : ring) {
      text +=
          std::to_string(corner.latitude_deg) + ' ' + std::to_string(corner.longitude_deg) + ' ';
    }
  }
}

/// LogPlace::scope of the zone; empty where all places count.
std::string ScopeOf(const RegionZone& zone) {
  std::string text;
  if (zone.area) AppendRings(*zone.area, text);
  if (zone.only) {
    text += "only " + std::to_string(zone.only->margin_m);
    AppendRings(zone.only->area, text);
  }
  if (zone.with_candidates) text += "candidates";
  return text.empty() ? text : Sha256Hex(text).substr(0, 16);
}

/// What lies elsewhere has left, as far as this map is concerned: it may have been on it, and have
/// moved. Returns how many did.
std::size_t LetGoBeyond(const Surroundings& reach, std::vector<ToldHazard>& hazards) {
  std::size_t count = 0;
  for (ToldHazard& told : hazards) {
    if (!told.IsThere() || reach.Have(told.hazard.position)) continue;
    told.hazard.state = zone::HazardState::kGone;
    ++count;
  }
  return count;
}

/// A zone tells of candidates, too, that they left what it was asked for.
void LetGoCandidates(std::vector<ToldHazard>& hazards) {
  for (ToldHazard& told : hazards) {
    zone::HazardState& state = told.hazard.state;
    if (state == zone::HazardState::kCandidate) state = zone::HazardState::kGone;
  }
}

std::string TroubleOf(const orders::HttpAnswer& answer) {
  if (answer.status == 0) return "it does not answer: " + answer.error;
  if (answer.IsSuccess()) return "its answer is not taken: " + answer.error;
  if (answer.status == 401 || answer.status == 403) {
    return "it shows its hazards to those alone who have logged in, or the token is wrong "
           "(status " +
           std::to_string(answer.status) + ")";
  }
  return "it answers with status " + std::to_string(answer.status);
}

}  // namespace

ZoneFollower::ZoneFollower(RegionZone zone, Call call, Clock now_ns, RegionMap& map,
                           RegionStore& store)
    : zone_(std::move(zone)),
      call_(std::move(call)),
      now_ns_(std::move(now_ns)),
      map_(map),
      store_(store) {
  RegionStore::Kept kept = store_.Load(zone_.id, now_ns_());
  place_ = kept.place;
  const std::string scope = ScopeOf(zone_);
  // What lies where nothing counted then is not known: the log is read anew.
  if (place_.scope != scope) place_.log = Uuid{};
  place_.scope = scope;
  saved_heard_ns_ = place_.heard_ns;
  if (!zone_.with_candidates) LetGoCandidates(kept.hazards);
  KeepSurroundings(kept.hazards);
  map_.Apply(zone_.id, kept.hazards);
  const MutexLock lock(mutex_);
  status_.heard_ns = place_.heard_ns;
  status_.trouble = "it has not been asked since the region's start";
  status_.hazards = map_.ToldCountOf(zone_.id);
}

bool ZoneFollower::Step() {
  try {
    const std::uint64_t after = reading_ ? reading_->sequence : place_.sequence;
    return Take(Ask(after), after);
  } catch (const StoreError&) {
    SayDown("what it tells cannot be kept: the region's store does not take it");
    throw;
  } catch (const Error& error) {
    SayDown(error.what());
    return false;
  }
}

ZoneAnswer ZoneFollower::Ask(std::uint64_t after) {
  orders::HttpCall call;
  call.url = zone_.url + "/api/v1/hazards?since=" + std::to_string(after) +
             "&limit=" + std::to_string(kHazardsPerAnswer) +
             "&state=" + (zone_.with_candidates ? "candidate," : "") + "active,verifying";
  if (!zone_.token.empty()) call.headers.push_back("Authorization: Bearer " + zone_.token);
  call.max_answer_bytes = kMaxAnswerBytes;
  const orders::HttpAnswer answer = call_(call);
  if (!answer.IsSuccess() || !answer.error.empty()) throw Error(TroubleOf(answer));
  try {
    return ParseZoneAnswer(answer.body, after, now_ns_());
  } catch (const Error& error) {
    throw Error(std::string("it answers what no zone does: ") + error.what());
  }
}

void ZoneFollower::BeginAnew(const Uuid& log) {
  reading_ = Reading{log, 0, {}};
  const MutexLock lock(mutex_);
  if (!place_.log.IsNil()) ++status_.begun_anew;
}

bool ZoneFollower::Take(ZoneAnswer answer, std::uint64_t after) {
  if (reading_ && reading_->log != answer.log) reading_.reset();
  if (!reading_ && (answer.log != place_.log || answer.sequence < place_.sequence)) {
    BeginAnew(answer.log);
    // It was asked from the other log's sequence.
    if (after > 0) return true;
  }
  if (!zone_.with_candidates) LetGoCandidates(answer.hazards);
  LeaveOutBeyond(answer);
  KeepSurroundings(answer.hazards);
  LogPlace place = place_;
  place.heard_ns = now_ns_();
  std::vector<Uuid> gone;
  if (reading_) {
    for (const ToldHazard& told : answer.hazards) {
      if (told.IsThere()) {
        reading_->there.insert(told.hazard.uuid);
      } else {
        reading_->there.erase(told.hazard.uuid);
      }
    }
    if (reading_->there.size() > kMaxHazards) {
      reading_.reset();
      throw Error("it has more than " + std::to_string(kMaxHazards) +
                  " hazards, no zone has so many");
    }
    reading_->sequence = answer.sequence;
    if (!answer.is_truncated) {
      place.log = answer.log;
      place.sequence = answer.sequence;
      gone = map_.NotAmong(zone_.id, reading_->there);
    } else {
      place.log = Uuid{};  // Whoever starts now has read a part of it.
    }
  } else {
    place.sequence = answer.sequence;
    if (map_.CountOf(zone_.id) + answer.hazards.size() > kMaxHazards + kHazardsPerAnswer) {
      throw Error("it has more than " + std::to_string(kMaxHazards) +
                  " hazards, no zone has so many");
    }
  }
  const bool has_news = !answer.hazards.empty() || !gone.empty() || place.log != place_.log;
  if (has_news || place.heard_ns - saved_heard_ns_ > Nanoseconds(kKeepHeardS)) {
    store_.Save(zone_.id, place, answer.hazards, gone);
    saved_heard_ns_ = place.heard_ns;
  }
  map_.Apply(zone_.id, answer.hazards);
  map_.Remove(zone_.id, gone);
  place_.heard_ns = place.heard_ns;
  if (!reading_ || !answer.is_truncated) {
    place_ = place;
    reading_.reset();
  }
  SayUp(answer);
  return answer.is_truncated;
}

void ZoneFollower::LeaveOutBeyond(ZoneAnswer& answer) const {
  if (!zone_.area) return;
  const Surroundings reach{*zone_.area, kMaxBeyondM};
  const std::size_t refused = LetGoBeyond(reach, answer.hazards);
  if (refused == 0) return;
  answer.refused += refused;
  answer.refusal = "a hazard lies more than " + std::to_string(static_cast<int>(kMaxBeyondM)) +
                   " m outside of the zone's area";
}

void ZoneFollower::KeepSurroundings(std::vector<ToldHazard>& hazards) const {
  if (zone_.only) LetGoBeyond(*zone_.only, hazards);
}

void ZoneFollower::SayUp(const ZoneAnswer& answer) {
  const std::size_t hazards = map_.ToldCountOf(zone_.id);
  const MutexLock lock(mutex_);
  status_.is_up = true;
  status_.trouble.clear();
  status_.heard_ns = place_.heard_ns;
  status_.hazards = hazards;
  status_.refused += answer.refused;
  if (!answer.refusal.empty()) status_.refusal = answer.refusal;
}

void ZoneFollower::SayDown(const std::string& trouble) {
  const MutexLock lock(mutex_);
  status_.is_up = false;
  status_.trouble = trouble;
  ++status_.failures;
}

ZoneStatus ZoneFollower::status() const {
  const MutexLock lock(mutex_);
  return status_;
}

}  // namespace livemap::region
