// What the vehicles of the study do, honest and hostile ones.
#include <algorithm>

#include "zone/registry/vehicle_track.h"
#include "zone_life/study_state.h"

namespace livemap::bench {
namespace {

constexpr double kApproachS = 8;         // Before the passage a vehicle is near enough to be asked.
constexpr double kCantSee = 0.1;         // Polls that meet an occluded or blinded camera.
constexpr double kFalseSighting = 2e-4;  // Of an honest vehicle, per street it drives.
constexpr double kInvents = 0.04;        // Of a hostile vehicle, per street: two on an average day.
constexpr int kHostileRepeats = 5;       // Messages that it sends where others send one.

}  // namespace

void Study::Invent(std::size_t vehicle, double t, const Town::Lane& lane) {
  if (malice_.Uniform() > kInvents) return;
  const auto kind = std::min(
      kClasses - 1, static_cast<std::size_t>(malice_.Uniform() * static_cast<double>(kClasses)));
  const double offset_m = Town::kBlockM * (0.15 + 0.7 * malice_.Uniform());
  const std::size_t thing = AddThing(kind, false, t, kDayS, lane.road, offset_m);
  things_[thing].inventor = vehicle;
  things_on_[lane.road].push_back(thing);
  for (int i = 0; i < kHostileRepeats; ++i)
    Tell(vehicle, thing, zone::EvidenceKind::kSighting, t + i);
}

void Study::Traverse(const Event& event) {
  const std::size_t vehicle = event.a;
  const double speed_mps = town_.SpeedMps(event.lane.road);
  if (Hostile(vehicle)) {
    Invent(vehicle, event.at_s, event.lane);
  } else if (senses_.Uniform() < kFalseSighting) {
    const auto kind = std::min(
        kClasses - 1, static_cast<std::size_t>(senses_.Uniform() * static_cast<double>(kClasses)));
    const std::size_t thing = AddThing(kind, false, event.at_s, 0, event.lane.road,
                                       Town::kBlockM * (0.15 + 0.7 * senses_.Uniform()));
    things_on_[event.lane.road].push_back(thing);
    Tell(vehicle, thing, zone::EvidenceKind::kSighting, event.at_s);
  }
  for (const std::size_t index : things_on_[event.lane.road]) {
    const Thing& thing = things_[index];
    const double way_m = event.lane.forward ? thing.offset_m : Town::kBlockM - thing.offset_m;
    const double pass_s = event.at_s + way_m / speed_mps;
    const double approach_s = std::max(event.at_s, pass_s - kApproachS);
    if (thing.item != kNone) {
      Push(approach_s, Happening::kApproaches, vehicle, index, 0, event.lane);
    }
    Push(pass_s, Happening::kPasses, vehicle, index, 0, event.lane);
  }
}

void Study::Approach(const Event& event) {
  const Thing& thing = things_[event.b];
  if (thing.item == kNone) return;
  const double speed_mps = town_.SpeedMps(thing.road);
  const double back_m = kApproachS * speed_mps * (event.lane.forward ? -1 : 1);
  const zone::TrackPoint point{Stamp(event.at_s), town_.At(thing.road, thing.offset_m + back_m),
                               town_.CourseRad(event.lane), speed_mps};
  for (const auto& question : polling_.Approach(thing.item, names_[event.a], point)) {
    Push(event.at_s + kApproachS, Happening::kAnswers, vehicle_of_name_[question.vehicle],
         question.hazard);
  }
}

void Study::Pass(std::size_t vehicle, Thing& thing, std::size_t index, double t) {
  const zone::ClassModel entry = ClassOf(thing);
  if (!thing.Stands(t) || senses_.Uniform() > entry.hit_rate) return;
  thing.honest.insert(vehicle);
  const bool told = thing.item != kNone && zone::IsTold(items_[thing.item].life.state);
  if (thing.noticeable_s < 0 && thing.honest.size() >= entry.confirmations) thing.noticeable_s = t;
  // A vehicle reports what it has not been told of, once.
  if (told) return;
  if (thing.item != kNone && items_[thing.item].reporters.count(vehicle) > 0) return;
  Tell(vehicle, index, zone::EvidenceKind::kSighting, t);
}

void Study::PassHostile(std::size_t vehicle, Thing& thing, std::size_t index, double t) {
  const bool on_map = thing.item != kNone;
  const bool replay = thing.real && t >= thing.ends_s && on_map;
  // An invention is supported by its inventor, and by all of them once drivers hear of it.
  const bool heard_of = on_map && zone::IsTold(items_[thing.item].life.state);
  const bool invented = !thing.real && t < thing.ends_s && (heard_of || thing.inventor == vehicle);
  if (!replay && !invented) return;
  for (int i = 0; i < kHostileRepeats; ++i) {
    Tell(vehicle, index, zone::EvidenceKind::kSighting, t + i);
  }
}

void Study::Answer(const Event& event) {
  const std::size_t vehicle = event.a;
  const std::int64_t now_ns = Stamp(event.at_s);
  polling_.Answered(event.b, names_[vehicle], now_ns);
  Item& item = items_[event.b];
  if (!zone::IsOnMap(item.life.state)) return;
  const std::size_t index = item.thing;
  const bool stands = things_[index].Stands(event.at_s);
  const zone::ClassModel entry = ClassOf(things_[index]);
  if (Hostile(vehicle)) {
    Tell(vehicle, index, stands ? zone::EvidenceKind::kAnswerNo : zone::EvidenceKind::kAnswerYes,
         event.at_s);
    return;
  }
  // The zone checks that the vehicle could see the place, by the positions that it has.
  const geo::GeoPoint place = PlaceOf(things_[index]);
  if (!zone::CouldSee({{now_ns, place, 0, 10}}, now_ns, place)) return;
  if (senses_.Uniform() < kCantSee) return;
  const double yes_rate = stands ? entry.hit_rate : entry.false_rate;
  const bool yes = senses_.Uniform() < yes_rate;
  if (yes && stands) things_[index].honest.insert(vehicle);
  Tell(vehicle, index, yes ? zone::EvidenceKind::kAnswerYes : zone::EvidenceKind::kAnswerNo,
       event.at_s);
}

}  // namespace livemap::bench
