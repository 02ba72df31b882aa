#include "zone/polling/poll_scheduler.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/log_odds.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr double kHourS = 3600;
constexpr double kMinMovingMps = 1;     // Below it a course says little of where a vehicle goes.
constexpr double kStandingReachM = 60;  // How far ahead a standing vehicle sees.
constexpr double kNearestM = 8;         // Nearer it has passed before it can look.
constexpr double kLongestS = 1e8;       // Nothing is planned further ahead, about three years.
constexpr double kMetresPerDegree = 111320;
// What waits around a vehicle is sought again after this part of its lookahead, a turn by this, or
// this time: a poll may have become worth its bytes meanwhile.
constexpr double kLookAgainShare = 0.1;
constexpr double kLookAgainRad = 0.2;
constexpr double kLookAgainS = 5;
// After a long silence a million hazards are due at once; the zone has more to do than to ask.
constexpr std::size_t kMaxPerTick = 20000;
// Log odds that evidence moves, and rounding does not.
constexpr double kMovedOdds = 1e-3;

/// Metres north and east, for places some hundred metres apart.
std::pair<double, double> PollOffset(const geo::GeoPoint& from, const geo::GeoPoint& to) {
  const double east_deg = std::remainder(to.longitude_deg - from.longitude_deg, 360.0);
  return {(to.latitude_deg - from.latitude_deg) * kMetresPerDegree,
          east_deg * kMetresPerDegree * std::cos(from.latitude_deg * geo::kRadiansPerDegree)};
}

void CheckPollConfigPositive(const char* name, double value) {
  if (value > 0 && value <= 1e12) return;
  throw Error(std::string(name) + " is " + std::to_string(value) + ", accepted is above 0 to 1e12");
}

/// Edge of the grids' cells; what is out of range is refused later, by its name.
double PollCellM(double lookahead_m) {
  return lookahead_m >= 10 && lookahead_m <= 5000 ? lookahead_m : 10;
}

}  // namespace

PollScheduler::PollScheduler(const Config& config, std::uint64_t seed)
    : config_(config),
      waiting_(PollCellM(config.lookahead_m), seed),
      rider_grid_(PollCellM(config.lookahead_m), seed),
      generator_(seed),
      budget_({config.bytes_per_hour, kHourS}) {
  CheckPollConfigPositive("price_s", config.price_s);
  CheckPollConfigPositive("bytes_per_hour", config.bytes_per_hour);
  CheckPollConfigPositive("poll_bytes", config.poll_bytes);
  CheckPollConfigPositive("lookahead_s", config.lookahead_s);
  CheckPollConfigPositive("answer_timeout_s", config.answer_timeout_s);
  CheckPollConfigPositive("same_vehicle_gap_s", config.same_vehicle_gap_s);
  CheckPollConfigPositive("vehicle_silence_s", config.vehicle_silence_s);
  CheckPollConfigPositive("corridor_m", config.corridor_m);
  CheckPollConfigPositive("max_vehicles", static_cast<double>(config.max_vehicles));
  if (!(config.lookahead_m >= 10 && config.lookahead_m <= 5000)) {
    throw Error("lookahead_m is " + std::to_string(config.lookahead_m) +
                ", accepted is 10 to 5000 m");
  }
  if (!(config.picture_bytes >= 0) || !(config.corridor_slope >= 0)) {
    throw Error("picture_bytes and corridor_slope must not be negative");
  }
  if (!(config.frame_bytes >= 0 && config.frame_bytes <= 1e12)) {
    throw Error("frame_bytes is " + std::to_string(config.frame_bytes) + ", accepted is 0 to 1e12");
  }
}

double PollScheduler::DebtS(const Target& target, std::int64_t now_ns) const {
  const double dt_s = Seconds(std::max<std::int64_t>(0, now_ns - target.at_ns));
  const double age_s = Seconds(std::max<std::int64_t>(0, target.at_ns - target.first_seen_ns));
  const double there_s =
      ProbabilityOf(target.log_odds) * target.survival.ExpectedTimeStanding(age_s, dt_s);
  return target.debt_s + (IsTold(target.state) ? dt_s - there_s : there_s);
}

double PollScheduler::PriceS() const {
  const double fill = std::clamp(budget_.tokens() / budget_.capacity(), 1e-3, 1.0);
  return config_.price_s / (fill * fill);
}

std::int64_t PollScheduler::DueNs(const Target& target, double price_s) const {
  const auto at = [&](double dt_s) { return target.at_ns + Nanoseconds(dt_s); };
  if (target.debt_s >= price_s) return target.at_ns;
  if (DebtS(target, at(kLongestS)) < price_s) return kNever;
  // The debt grows with time, by at most one second per second.
  double early_s = price_s - target.debt_s;
  double late_s = kLongestS;
  while (late_s - early_s > 0.5 + 1e-3 * early_s) {
    // Geometric, because a minute and a month are both usual.
    const double middle_s = std::sqrt(early_s * late_s);
    (DebtS(target, at(middle_s)) < price_s ? early_s : late_s) = middle_s;
  }
  return at(late_s);
}

void PollScheduler::SetHazard(std::uint64_t hazard, const geo::GeoPoint& position,
                              const ClassModel& entry, const PresenceRecord& life,
                              std::int64_t picture_ns, std::int64_t now_ns) {
  if (!IsOnMap(life.state) || !geo::IsValid(position)) return RemoveHazard(hazard);
  const auto [place, is_new] = hazards_.try_emplace(hazard);
  Target& target = place->second;
  double debt_s = 0;
  if (!is_new) {
    const double there = ProbabilityOf(target.log_odds);
    const double dt_s = Seconds(std::max<std::int64_t>(0, life.at_ns - target.at_ns));
    const double age_s = Seconds(std::max<std::int64_t>(0, target.at_ns - target.first_seen_ns));
    const double expected = there * target.survival.Survival(age_s, dt_s);
    const double moved = life.log_odds - std::log(expected / (1 - expected));
    const bool told = IsTold(life.state);
    debt_s = DebtS(target, life.at_ns);
    // A word that bears the map out settles the debt; one against it is worth a question at once.
    if (told ? moved > kMovedOdds : moved < -kMovedOdds) debt_s = 0;
    if (told && moved < -kMovedOdds) debt_s = std::max(debt_s, config_.price_s);
    // Told now: what was owed was owed for not telling.
    if (told != IsTold(target.state)) debt_s = 0;
    // At the bound of what counts as sure a yes moves nothing.
    if (told && life.last_yes_ns > target.last_yes_ns) debt_s = 0;
    StopWaiting(hazard, target);
  }
  target.position = position;
  target.survival = entry.survival;
  target.at_ns = life.at_ns;
  target.first_seen_ns = life.first_seen_ns;
  target.last_yes_ns = life.last_yes_ns;
  target.picture_ns = picture_ns;
  target.log_odds = life.log_odds;
  target.debt_s = debt_s;
  target.state = life.state;
  for (const VehicleEvidence& voice : life.voices) {
    const std::int64_t at_ns = std::int64_t{voice.at_s} * 1'000'000'000;
    if (voice.vehicle != 0 && Seconds(now_ns - at_ns) < config_.same_vehicle_gap_s) {
      RecordPoll(hazard, voice.vehicle, at_ns);
    }
  }
  Schedule(hazard, target, now_ns);
}

void PollScheduler::Schedule(std::uint64_t hazard, Target& target, std::int64_t now_ns) {
  ++target.version;
  if (frames_.count(hazard) != 0) StartWaiting(hazard, target);
  const std::int64_t due_ns = DueNs(target, config_.price_s);
  if (due_ns == kNever) return;
  heap_.push_back({std::max(due_ns, now_ns), hazard, target.version});
  std::push_heap(heap_.begin(), heap_.end());
  CompactHeap();
}

void PollScheduler::CompactHeap() {
  if (heap_.size() < 2 * hazards_.size() + 1024) return;
  const auto is_stale = [this](const Due& due) {
    const auto found = hazards_.find(due.hazard);
    return found == hazards_.end() || found->second.version != due.version;
  };
  heap_.erase(std::remove_if(heap_.begin(), heap_.end(), is_stale), heap_.end());
  std::make_heap(heap_.begin(), heap_.end());
}

/// Vehicles that come by from now on meet it, and those around it are looked at in the next tick.
void PollScheduler::StartWaiting(std::uint64_t hazard, Target& target) {
  if (!target.waiting) waiting_.Insert(target.position, hazard);
  target.waiting = true;
  look_around_.push_back(hazard);
}

void PollScheduler::StopWaiting(std::uint64_t hazard, Target& target) {
  if (!target.waiting) return;
  waiting_.Erase(target.position, hazard);
  target.waiting = false;
}

void PollScheduler::RemoveHazard(std::uint64_t hazard) {
  const auto found = hazards_.find(hazard);
  if (found == hazards_.end()) return;
  StopWaiting(hazard, found->second);
  hazards_.erase(found);
  asked_.erase(hazard);
}

void PollScheduler::AskForFrame(std::uint64_t hazard, std::int64_t until_ns, std::int64_t now_ns) {
  if (!AsksForFrames() || until_ns < now_ns) return;
  frames_[hazard] = {until_ns, {}};
  const auto found = hazards_.find(hazard);
  if (found != hazards_.end()) StartWaiting(hazard, found->second);
}

bool PollScheduler::MayAskForFrame(std::uint64_t hazard, std::uint64_t vehicle,
                                   std::int64_t now_ns) const {
  const auto frame = frames_.find(hazard);
  if (frame == frames_.end() || now_ns > frame->second.until_ns) return false;
  if (budget_.tokens() < config_.poll_bytes + config_.frame_bytes) return false;
  const auto asked = frame->second.asked_ns.find(vehicle);
  return asked == frame->second.asked_ns.end() || Seconds(now_ns - asked->second) >= kFrameAgainS;
}

/// They are few: officials ask for them one by one.
void PollScheduler::ExpireFrames(std::int64_t now_ns) {
  for (auto frame = frames_.begin(); frame != frames_.end();) {
    auto& asked_ns = frame->second.asked_ns;
    for (auto asked = asked_ns.begin(); asked != asked_ns.end();) {
      asked = Seconds(now_ns - asked->second) >= kFrameAgainS ? asked_ns.erase(asked)
                                                              : std::next(asked);
    }
    frame = now_ns > frame->second.until_ns ? frames_.erase(frame) : std::next(frame);
  }
}

void PollScheduler::SetVehicle(const std::string& vehicle_id, const TrackPoint& point) {
  if (!geo::IsValid(point.position)) return;
  auto known = riders_by_id_.find(vehicle_id);
  if (known == riders_by_id_.end()) {
    if (riders_by_id_.size() >= config_.max_vehicles) ForgetRider(riders_.begin());
    TrackedVehicle rider;
    rider.id = vehicle_id;
    rider.key = VehicleKey(vehicle_id);
    riders_.push_back(rider);
    known = riders_by_id_.emplace(vehicle_id, std::prev(riders_.end())).first;
    riders_by_key_[rider.key] = known->second;
  } else {
    rider_grid_.Erase(known->second->point.position, known->second->key);
    riders_.splice(riders_.end(), riders_, known->second);
  }
  TrackedVehicle& rider = *known->second;
  rider.point = point;
  rider_grid_.Insert(point.position, rider.key);
  if (rider.moved || !SeesOtherPlaces(rider)) return;
  moved_.push_back(rider.key);
  rider.moved = true;
}

bool PollScheduler::SeesOtherPlaces(const TrackedVehicle& rider) const {
  if (!rider.last_scanned_at) return true;
  const TrackPoint& from = *rider.last_scanned_at;
  const auto [north_m, east_m] = PollOffset(from.position, rider.point.position);
  // A course that is not a number is always another one.
  const double turn_rad = std::remainder(rider.point.course_rad - from.course_rad, 2 * M_PI);
  return Seconds(rider.point.stamp_ns - from.stamp_ns) >= kLookAgainS ||
         std::hypot(north_m, east_m) > kLookAgainShare * config_.lookahead_m ||
         !(std::abs(turn_rad) < kLookAgainRad) ||
         rider.point.speed_mps > from.speed_mps + kMinMovingMps;
}

void PollScheduler::ForgetRider(RiderPlace rider) {
  rider_grid_.Erase(rider->point.position, rider->key);
  riders_by_key_.erase(rider->key);
  riders_by_id_.erase(rider->id);
  riders_.erase(rider);
}

std::vector<PollChoice> PollScheduler::TakeDue(std::int64_t now_ns) {
  std::vector<PollChoice> choices;
  budget_.Refill(now_ns);
  while (!riders_.empty() &&
         Seconds(now_ns - riders_.front().point.stamp_ns) > config_.vehicle_silence_s) {
    ForgetRider(riders_.begin());
  }
  ExpirePolls(now_ns);
  ExpireFrames(now_ns);
  ForgetAsked(now_ns);
  TakeFallenDue(now_ns);
  // What fell due or is free again asks the vehicles around it...
  std::vector<std::uint64_t> hazards;
  hazards.swap(look_around_);
  for (const std::uint64_t hazard : hazards) LookAround(hazard, now_ns, choices);
  // ...and vehicles that moved meet what waits around them.
  std::vector<std::uint64_t> moved;
  moved.swap(moved_);
  for (const std::uint64_t key : moved) {
    const auto found = riders_by_key_.find(key);
    if (found == riders_by_key_.end()) continue;
    TrackedVehicle& rider = *found->second;
    rider.moved = false;
    rider.last_scanned_at = rider.point;
    for (const auto& near : waiting_.Within(rider.point.position, config_.lookahead_m)) {
      TryAsk(near.id, rider, now_ns, choices);
    }
  }
  return choices;
}

void PollScheduler::TakeFallenDue(std::int64_t now_ns) {
  const double price_s = PriceS();
  for (std::size_t i = 0; i < kMaxPerTick && !heap_.empty() && heap_.front().at_ns <= now_ns; ++i) {
    const Due due = heap_.front();
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
    const auto found = hazards_.find(due.hazard);
    if (found == hazards_.end() || found->second.version != due.version) continue;
    Target& target = found->second;
    const std::int64_t due_ns = DueNs(target, price_s);
    if (due_ns > now_ns) {
      // Bytes are short and the price has risen; it may have fallen again within the quarter hour.
      const std::int64_t again_ns = now_ns + Nanoseconds(kHourS / 4);
      heap_.push_back({std::min(due_ns, again_ns), due.hazard, due.version});
      std::push_heap(heap_.begin(), heap_.end());
      continue;
    }
    StartWaiting(due.hazard, target);
  }
}

void PollScheduler::LookAround(std::uint64_t hazard, std::int64_t now_ns,
                               std::vector<PollChoice>& choices) {
  const auto found = hazards_.find(hazard);
  if (found == hazards_.end() || !found->second.waiting) return;
  auto near = rider_grid_.Within(found->second.position, config_.lookahead_m);
  // The nearest first: its answer comes soonest.
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.id < b.id;
  });
  for (const auto& neighbour : near) {
    const auto rider = riders_by_key_.find(neighbour.id);
    if (rider != riders_by_key_.end()) TryAsk(hazard, *rider->second, now_ns, choices);
  }
}

void PollScheduler::TryAsk(std::uint64_t hazard, TrackedVehicle& rider, std::int64_t now_ns,
                           std::vector<PollChoice>& choices) {
  const auto found = hazards_.find(hazard);
  if (found == hazards_.end()) return;
  Target& target = found->second;
  if (target.open >= config_.max_open_per_hazard || rider.open >= config_.max_open_per_vehicle) {
    return;
  }
  if (Seconds(now_ns - rider.point.stamp_ns) > config_.vehicle_silence_s) return;
  if (!Passes(rider.point, target.position)) return;
  const bool frame_wanted = MayAskForFrame(hazard, rider.key, now_ns);
  if (!frame_wanted) {
    if (WasAsked(hazard, rider.key, now_ns)) return;
    if (budget_.tokens() < config_.poll_bytes || DebtS(target, now_ns) < PriceS()) return;
  }
  PollChoice choice{Uuid::Random(generator_),
                    hazard,
                    rider.id,
                    false,
                    frame_wanted,
                    now_ns + Nanoseconds(config_.answer_timeout_s)};
  double bytes = config_.poll_bytes;
  const bool picture_old = Seconds(now_ns - target.picture_ns) > config_.picture_age_s;
  const bool plenty =
      budget_.tokens() > config_.picture_share * config_.bytes_per_hour + config_.picture_bytes;
  if (frame_wanted) {
    bytes += config_.frame_bytes;
    frames_[hazard].asked_ns[rider.key] = now_ns;
  } else if (config_.picture_bytes > 0 && picture_old && plenty) {
    choice.picture_wanted = true;
    bytes += config_.picture_bytes;
  }
  budget_.Spend(bytes);
  bytes_ += bytes;
  ++target.open;
  ++rider.open;
  RecordPoll(hazard, rider.key, now_ns);
  open_[choice.poll] = {
      hazard, rider.id, now_ns, choice.expires_ns, bytes, choice.picture_wanted, frame_wanted};
  expiry_order_.push_back(choice.poll);
  choices.push_back(std::move(choice));
}

bool PollScheduler::Passes(const TrackPoint& point, const geo::GeoPoint& place) const {
  if (!std::isfinite(point.course_rad) || !std::isfinite(point.speed_mps)) return false;
  const auto [north_m, east_m] = PollOffset(point.position, place);
  const double sine = std::sin(point.course_rad);
  const double cosine = std::cos(point.course_rad);
  const double ahead_m = east_m * sine + north_m * cosine;
  const double aside_m = std::abs(east_m * cosine - north_m * sine);
  const double reach_m = point.speed_mps < kMinMovingMps
                             ? kStandingReachM
                             : std::max(kStandingReachM, point.speed_mps * config_.lookahead_s);
  return ahead_m >= kNearestM && ahead_m <= std::min(reach_m, config_.lookahead_m) &&
         aside_m <= config_.corridor_m + config_.corridor_slope * ahead_m;
}

void PollScheduler::RecordPoll(std::uint64_t hazard, std::uint64_t vehicle, std::int64_t at_ns) {
  Asked& asked = asked_[hazard];
  const auto known = std::find(asked.vehicle.begin(), asked.vehicle.end(), vehicle);
  if (known != asked.vehicle.end()) {
    auto& noted_ns = asked.at_ns[static_cast<std::size_t>(known - asked.vehicle.begin())];
    if (noted_ns >= at_ns) return;
    noted_ns = at_ns;
  } else {
    asked.vehicle[asked.next] = vehicle;
    asked.at_ns[asked.next] = at_ns;
    asked.next = (asked.next + 1) % asked.vehicle.size();
  }
  asked_order_.emplace_back(at_ns, hazard);
}

bool PollScheduler::WasAsked(std::uint64_t hazard, std::uint64_t vehicle,
                             std::int64_t now_ns) const {
  const auto found = asked_.find(hazard);
  if (found == asked_.end()) return false;
  const Asked& asked = found->second;
  for (std::size_t i = 0; i < asked.vehicle.size(); ++i) {
    if (asked.vehicle[i] != vehicle) continue;
    return Seconds(now_ns - asked.at_ns[i]) < config_.same_vehicle_gap_s;
  }
  return false;
}

void PollScheduler::ForgetAsked(std::int64_t now_ns) {
  // Nearly in order of time; an entry behind a later one only stays a little longer.
  while (!asked_order_.empty() &&
         Seconds(now_ns - asked_order_.front().first) > config_.same_vehicle_gap_s) {
    const auto found = asked_.find(asked_order_.front().second);
    asked_order_.pop_front();
    if (found == asked_.end()) continue;
    const auto& at_ns = found->second.at_ns;
    const std::int64_t newest_ns = *std::max_element(at_ns.begin(), at_ns.end());
    if (Seconds(now_ns - newest_ns) > config_.same_vehicle_gap_s) asked_.erase(found);
  }
}

void PollScheduler::ExpirePolls(std::int64_t now_ns) {
  for (; !expiry_order_.empty(); expiry_order_.pop_front()) {
    const auto found = open_.find(expiry_order_.front());
    if (found == open_.end()) continue;
    if (now_ns <= found->second.expires_ns) return;
    Close(found->second);
    open_.erase(found);
  }
}

/// Both its hazard and its vehicle are free to be asked again.
void PollScheduler::Close(const OpenPoll& poll) {
  const auto hazard = hazards_.find(poll.hazard);
  if (hazard != hazards_.end() && hazard->second.open > 0) {
    --hazard->second.open;
    look_around_.push_back(poll.hazard);
  }
  const auto rider = riders_by_id_.find(poll.vehicle_id);
  if (rider != riders_by_id_.end() && rider->second->open > 0) --rider->second->open;
}

std::optional<PollScheduler::OpenPoll> PollScheduler::FindOpen(const Uuid& poll,
                                                               std::int64_t now_ns) const {
  const auto found = open_.find(poll);
  if (found == open_.end() || now_ns > found->second.expires_ns) return std::nullopt;
  return found->second;
}

bool PollScheduler::Answered(const Uuid& poll, double bytes, std::int64_t now_ns) {
  const auto found = open_.find(poll);
  if (found == open_.end() || now_ns > found->second.expires_ns) return false;
  const OpenPoll& answered = found->second;
  if (bytes >= 0 && std::isfinite(bytes)) {
    const double unspent = std::max(0.0, answered.bytes - bytes);
    budget_.Spend(-unspent);
    bytes_ -= unspent;
  }
  Close(answered);
  open_.erase(found);
  return true;
}

}  // namespace livemap::zone
