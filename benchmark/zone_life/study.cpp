#include "zone_life/study.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <queue>
#include <set>

#include "base/stamps.h"
#include "zone/hazard_life.h"
#include "zone/vehicle_allowance.h"
#include "zone/vehicle_track.h"
#include "zone_life/town.h"

namespace livemap {
namespace {

constexpr std::int64_t kEpochNs = 1'700'000'000LL * 1'000'000'000;
constexpr double kApproachS = 8;         // Before the passage a vehicle is near enough to be asked.
constexpr double kCantSee = 0.1;         // Polls that meet an occluded or blinded camera.
constexpr double kFalseSighting = 2e-4;  // Of an honest vehicle, per street it drives.
constexpr double kInvents = 0.04;        // Of a hostile vehicle, per street: two on an average day.
constexpr int kHostileRepeats = 5;       // Messages that it sends where others send one.
constexpr std::size_t kNone = ~std::size_t{0};

enum class LifeForm { kExponential, kLogNormal, kWeibull };

// What the town is like: the lives are not those of the catalogue, nor all exponential.
struct Nature {
  const char* name;
  double per_day;
  double mean_life_s;
  LifeForm form;
};
constexpr Nature kNature[] = {
    {"pothole", 3, 20 * kDayS, LifeForm::kLogNormal},
    {"traffic_cone", 6, 1 * kDayS, LifeForm::kExponential},
    {"road_work_sign", 3, 4 * kDayS, LifeForm::kWeibull},
    {"barrier", 2, 10 * kDayS, LifeForm::kWeibull},
    {"debris", 12, 4 * 3600, LifeForm::kExponential},
    {"deer", 12, 480, LifeForm::kExponential},
    {"construction_machine", 3, 1.5 * kDayS, LifeForm::kLogNormal},
    {"stopped_accident", 8, 3600, LifeForm::kLogNormal},
};
constexpr std::size_t kClasses = std::size(kNature);

double DrawLife(const Nature& nature, SeededRandom& random) {
  constexpr double kSigma = 0.8;
  constexpr double kWeibullShape = 1.5;
  switch (nature.form) {
    case LifeForm::kExponential:
      return random.Exponential(nature.mean_life_s);
    case LifeForm::kLogNormal:
      return nature.mean_life_s * std::exp(kSigma * random.Normal().x() - 0.5 * kSigma * kSigma);
    case LifeForm::kWeibull:
      return nature.mean_life_s / std::tgamma(1 + 1 / kWeibullShape) *
             std::pow(random.Exponential(1), 1 / kWeibullShape);
  }
  return 0;
}

// A hazard that there is, or one that somebody invented.
struct Thing {
  std::size_t kind = 0;
  std::size_t road = 0;
  double offset_m = 0;
  bool real = true;
  bool false_counted = false;
  std::size_t inventor = kNone;
  double begins_s = 0;
  double ends_s = 0;
  std::size_t item = kNone;      // On the zone's map.
  std::set<std::size_t> honest;  // Vehicles that saw it.
  double noticeable_s = -1;
  double first_told_s = -1;
  double missing_s = 0;

  bool Stands(double t) const { return real && t >= begins_s && t < ends_s; }
};

// What the zone has on its map.
struct Item {
  std::size_t thing = 0;
  LifeRecord life;
  int score = 0;  // Of the naive rule.
  double told_s = -1;
  std::uint32_t version = 0;
  std::set<std::size_t> reporters;
};

enum class Happening {
  kDay,
  kAppears,
  kEnds,
  kTraverses,
  kApproaches,
  kPasses,
  kAnswers,
  kAdvances
};

struct Event {
  double at_s = 0;
  std::uint64_t order = 0;
  Happening what = Happening::kDay;
  std::size_t a = 0;  // Vehicle, thing or item.
  std::size_t b = 0;  // Item or thing.
  std::uint32_t version = 0;
  Town::Lane lane;

  friend bool operator<(const Event& x, const Event& y) {
    return x.at_s != y.at_s ? x.at_s > y.at_s : x.order > y.order;
  }
};

class Study {
 public:
  Study(const StudyConfig& config, const HazardCatalogue& catalogue);
  StudyFigures Run();

 private:
  static std::int64_t Stamp(double t) { return kEpochNs + Nanoseconds(t); }
  void Push(double at_s, Happening what, std::size_t a, std::size_t b = 0,
            std::uint32_t version = 0, Town::Lane lane = {});
  bool Measured(double t) const { return t >= begin_s_ && t < end_s_; }
  bool Hostile(std::size_t vehicle) const { return hostile_[vehicle]; }
  LifeClass ClassOf(const Thing& thing) const { return classes_[thing.kind]; }
  ClassFigures& FiguresOf(const Thing& thing) { return figures_.classes[kNature[thing.kind].name]; }
  GeoPoint PlaceOf(const Thing& thing) const { return town_.At(thing.road, thing.offset_m); }

  void PlanHazards();
  std::size_t AddThing(std::size_t kind, bool real, double begins_s, double life_s,
                       std::size_t road, double offset_m);
  void Handle(const Event& event);
  void BeginDay(int day);
  void Invent(std::size_t vehicle, double t, const Town::Lane& lane);
  void Traverse(const Event& event);
  void Approach(const Event& event);
  void Pass(std::size_t vehicle, Thing& thing, std::size_t index, double t);
  void PassHostile(std::size_t vehicle, Thing& thing, std::size_t index, double t);
  void Answer(const Event& event);
  void Tell(std::size_t vehicle, std::size_t thing, EvidenceKind kind, double t);
  void Follow(std::size_t item, const LifeStep& step, bool denied, double t);
  void Count(Item& item, EvidenceKind kind, LifeStep& step, double t);
  void Enter(Item& item, const LifeTransition& transition, double t);
  void StopTelling(Item& item, Thing& thing, double t);
  void Finish();

  StudyConfig config_;
  HazardCatalogue catalogue_;
  SeededRandom world_, traffic_, senses_, malice_;
  Town town_;
  Fleet fleet_;
  SurvivalModel survival_;
  HazardLife rules_;
  VehicleAllowance allowance_;
  Polling polling_;
  std::vector<bool> hostile_;
  std::vector<std::string> names_;
  std::vector<std::uint64_t> keys_;
  std::map<std::string, std::size_t> vehicle_of_name_;
  std::array<LifeClass, kClasses> classes_;
  std::vector<Thing> things_;
  std::vector<Item> items_;
  std::vector<std::vector<std::size_t>> things_on_;  // By road: those that stand or are on the map.
  std::priority_queue<Event> events_;
  std::uint64_t order_ = 0;
  double begin_s_, end_s_, last_s_;
  StudyFigures figures_;
};

Study::Study(const StudyConfig& config, const HazardCatalogue& catalogue)
    : config_(config),
      catalogue_(catalogue),
      world_(config.seed * 7919 + 1),
      traffic_(config.seed * 7919 + 2),
      senses_(config.seed * 7919 + 3),
      malice_(config.seed * 7919 + 4),
      fleet_(town_, config.vehicles, traffic_),
      survival_(catalogue),
      allowance_(VehicleAllowance::Config()),
      polling_(config.polling),
      hostile_(config.vehicles),
      things_on_(town_.roads()),
      begin_s_(config.warm_up_days * kDayS),
      end_s_((config.days - config.last_days) * kDayS),
      last_s_(config.days * kDayS) {
  for (std::size_t i = 0; i < config.vehicles; ++i) {
    hostile_[i] = malice_.Uniform() < config.hostile_share;
    names_.push_back("v" + std::to_string(i));
    keys_.push_back(VehicleKey(names_.back()));
    vehicle_of_name_[names_.back()] = i;
  }
  for (std::size_t i = 0; i < kClasses; ++i) {
    const HazardClass entry = catalogue_.Get(kNature[i].name);
    classes_[i] = LifeClassOf(entry, survival_.Of(entry.name));
    ClassFigures& figures = figures_.classes[entry.name];
    figures.prior_life_s = entry.expected_life_s;
    figures.true_life_s = kNature[i].mean_life_s;
  }
}

void Study::Push(double at_s, Happening what, std::size_t a, std::size_t b, std::uint32_t version,
                 Town::Lane lane) {
  if (at_s < last_s_) events_.push({at_s, order_++, what, a, b, version, lane});
}

std::size_t Study::AddThing(std::size_t kind, bool real, double begins_s, double life_s,
                            std::size_t road, double offset_m) {
  Thing thing;
  thing.kind = kind;
  thing.real = real;
  thing.begins_s = begins_s;
  thing.ends_s = begins_s + life_s;
  thing.road = road;
  thing.offset_m = offset_m;
  things_.push_back(std::move(thing));
  return things_.size() - 1;
}

void Study::PlanHazards() {
  for (std::size_t kind = 0; kind < kClasses; ++kind) {
    const Nature& nature = kNature[kind];
    // Those that stand already: arrivals since long before the first day.
    const double before_s = 6 * nature.mean_life_s;
    double t = -before_s;
    while ((t += world_.Exponential(kDayS / nature.per_day)) < last_s_) {
      const double life_s = DrawLife(nature, world_);
      const auto road =
          std::min(town_.roads() - 1,
                   static_cast<std::size_t>(world_.Uniform() * static_cast<double>(town_.roads())));
      const double offset_m = Town::kBlockM * (0.15 + 0.7 * world_.Uniform());
      if (t + life_s < 0) continue;
      const std::size_t thing = AddThing(kind, true, t, life_s, road, offset_m);
      Push(std::max(t, 0.0), Happening::kAppears, thing);
      Push(t + life_s, Happening::kEnds, thing);
    }
  }
}

StudyFigures Study::Run() {
  PlanHazards();
  for (int day = 0; day < config_.days; ++day) {
    Push(day * kDayS, Happening::kDay, static_cast<std::size_t>(day));
  }
  while (!events_.empty()) {
    const Event event = events_.top();
    events_.pop();
    Handle(event);
  }
  Finish();
  return figures_;
}

void Study::Handle(const Event& event) {
  switch (event.what) {
    case Happening::kDay:
      return BeginDay(static_cast<int>(event.a));
    case Happening::kAppears: {
      things_on_[things_[event.a].road].push_back(event.a);
      if (Measured(things_[event.a].begins_s)) ++FiguresOf(things_[event.a]).appeared;
      return;
    }
    case Happening::kEnds: {
      Thing& thing = things_[event.a];
      const bool told = thing.item != kNone && IsTold(items_[thing.item].life.state);
      if (!told && thing.noticeable_s >= 0) thing.missing_s += event.at_s - thing.noticeable_s;
      // From now on its telling is wrong.
      if (told) items_[thing.item].told_s = event.at_s;
      return;
    }
    case Happening::kTraverses:
      return Traverse(event);
    case Happening::kApproaches:
      return Approach(event);
    case Happening::kPasses:
      if (Hostile(event.a)) return PassHostile(event.a, things_[event.b], event.b, event.at_s);
      return Pass(event.a, things_[event.b], event.b, event.at_s);
    case Happening::kAnswers:
      return Answer(event);
    case Happening::kAdvances: {
      Item& item = items_[event.a];
      if (item.version != event.version || !IsOnMap(item.life.state)) return;
      const LifeStep step =
          rules_.Advance(ClassOf(things_[item.thing]), Stamp(event.at_s), item.life);
      return Follow(event.a, step, false, event.at_s);
    }
  }
}

void Study::BeginDay(int day) {
  for (const Traversal& traversal : fleet_.Day(day, traffic_)) {
    ++figures_.traversals;
    Push(traversal.at_s, Happening::kTraverses, traversal.vehicle, 0, 0, traversal.lane);
  }
  // What is over and off the map needs no look any more.
  for (auto& on_road : things_on_) {
    const auto is_over = [&](std::size_t index) {
      const Thing& thing = things_[index];
      return thing.item == kNone && thing.ends_s < day * kDayS;
    };
    on_road.erase(std::remove_if(on_road.begin(), on_road.end(), is_over), on_road.end());
  }
}

void Study::Invent(std::size_t vehicle, double t, const Town::Lane& lane) {
  if (malice_.Uniform() > kInvents) return;
  const auto kind = std::min(
      kClasses - 1, static_cast<std::size_t>(malice_.Uniform() * static_cast<double>(kClasses)));
  const double offset_m = Town::kBlockM * (0.15 + 0.7 * malice_.Uniform());
  const std::size_t thing = AddThing(kind, false, t, kDayS, lane.road, offset_m);
  things_[thing].inventor = vehicle;
  things_on_[lane.road].push_back(thing);
  for (int i = 0; i < kHostileRepeats; ++i) Tell(vehicle, thing, EvidenceKind::kSighting, t + i);
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
    Tell(vehicle, thing, EvidenceKind::kSighting, event.at_s);
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
  const TrackPoint point{Stamp(event.at_s), town_.At(thing.road, thing.offset_m + back_m),
                         town_.CourseRad(event.lane), speed_mps};
  for (const auto& question : polling_.Approach(thing.item, names_[event.a], point)) {
    Push(event.at_s + kApproachS, Happening::kAnswers, vehicle_of_name_[question.vehicle],
         question.hazard);
  }
}

void Study::Pass(std::size_t vehicle, Thing& thing, std::size_t index, double t) {
  const LifeClass entry = ClassOf(thing);
  if (!thing.Stands(t) || senses_.Uniform() > entry.hit_rate) return;
  thing.honest.insert(vehicle);
  const bool told = thing.item != kNone && IsTold(items_[thing.item].life.state);
  if (thing.noticeable_s < 0 && thing.honest.size() >= entry.confirmations) thing.noticeable_s = t;
  // A vehicle reports what it has not been told of, once.
  if (told) return;
  if (thing.item != kNone && items_[thing.item].reporters.count(vehicle) > 0) return;
  Tell(vehicle, index, EvidenceKind::kSighting, t);
}

void Study::PassHostile(std::size_t vehicle, Thing& thing, std::size_t index, double t) {
  const bool on_map = thing.item != kNone;
  const bool replay = thing.real && t >= thing.ends_s && on_map;
  // An invention is supported by its inventor, and by all of them once drivers hear of it.
  const bool heard_of = on_map && IsTold(items_[thing.item].life.state);
  const bool invented = !thing.real && t < thing.ends_s && (heard_of || thing.inventor == vehicle);
  for (int i = 0; i < kHostileRepeats; ++i) {
    if (replay || invented) Tell(vehicle, index, EvidenceKind::kSighting, t + i);
    if (thing.Stands(t) && on_map) Tell(vehicle, index, EvidenceKind::kVanished, t + i);
  }
}

void Study::Answer(const Event& event) {
  const std::size_t vehicle = event.a;
  const std::int64_t now_ns = Stamp(event.at_s);
  polling_.Answered(event.b, names_[vehicle], now_ns);
  Item& item = items_[event.b];
  if (!IsOnMap(item.life.state)) return;
  const std::size_t index = item.thing;
  const bool stands = things_[index].Stands(event.at_s);
  const LifeClass entry = ClassOf(things_[index]);
  if (Hostile(vehicle)) {
    Tell(vehicle, index, stands ? EvidenceKind::kAnswerNo : EvidenceKind::kAnswerYes, event.at_s);
    return;
  }
  // The zone checks that the vehicle could see the place, by the positions that it has.
  const GeoPoint place = PlaceOf(things_[index]);
  if (!CouldSee({{now_ns, place, 0, 10}}, now_ns, place)) return;
  if (senses_.Uniform() < kCantSee) return;
  const double yes_rate = stands ? entry.hit_rate : entry.false_rate;
  const bool yes = senses_.Uniform() < yes_rate;
  if (yes && stands) things_[index].honest.insert(vehicle);
  Tell(vehicle, index, yes ? EvidenceKind::kAnswerYes : EvidenceKind::kAnswerNo, event.at_s);
}

void Study::Tell(std::size_t vehicle, std::size_t index, EvidenceKind kind, double t) {
  const std::int64_t now_ns = Stamp(t);
  if (!allowance_.TakeEvidence(names_[vehicle], now_ns)) {
    ++figures_.refused_by_allowance;
    return;
  }
  Thing& thing = things_[index];
  const LifeClass entry = ClassOf(thing);
  const Evidence evidence{kind, keys_[vehicle], now_ns};
  const bool against = kind == EvidenceKind::kAnswerNo || kind == EvidenceKind::kVanished;
  LifeStep step;
  if (thing.item == kNone) {
    if (against) return;
    thing.item = items_.size();
    items_.emplace_back();
    items_.back().thing = index;
    items_.back().reporters.insert(vehicle);
    step = rules_.Begin(entry, evidence, now_ns, items_.back().life);
    if (config_.telling == TellingRule::kCount) {
      items_.back().life.state = HazardState::kCandidate;
      Count(items_.back(), kind, step, t);
    }
  } else {
    Item& item = items_[thing.item];
    if (!against) item.reporters.insert(vehicle);
    if (config_.telling == TellingRule::kCount) {
      Count(item, kind, step, t);
    } else {
      step = rules_.Apply(entry, evidence, now_ns, item.life);
    }
  }
  Follow(thing.item, step, against, t);
}

void Study::Count(Item& item, EvidenceKind kind, LifeStep& step, double t) {
  constexpr int kMostScore = 5;
  const bool against = kind == EvidenceKind::kAnswerNo || kind == EvidenceKind::kVanished;
  const LifeClass entry = ClassOf(things_[item.thing]);
  item.score = std::min(kMostScore, item.score + (against ? -1 : 1));
  if (!against) item.life.last_yes_ns = Stamp(t);
  HazardState to = item.life.state;
  if (item.score >= static_cast<int>(entry.confirmations)) to = HazardState::kActive;
  if (item.score <= 0) to = HazardState::kGone;
  step.transition.reset();
  if (to == item.life.state) return;
  step.transition = LifeTransition{item.life.state, to, "counted"};
  item.life.state = to;
}

void Study::Follow(std::size_t index, const LifeStep& step, bool denied, double t) {
  Item& item = items_[index];
  Thing& thing = things_[item.thing];
  const char* name = kNature[thing.kind].name;
  if (config_.telling == TellingRule::kLife && (step.lesson.ended || step.lesson.stood_s > 0)) {
    survival_.Learn(name, step.lesson);
    classes_[thing.kind].survival = survival_.Of(name);
  }
  if (step.transition) Enter(item, *step.transition, t);
  polling_.SetHazard(index, PlaceOf(thing), ClassOf(thing), item.life, denied, Stamp(t));
  ++item.version;
  if (!IsOnMap(item.life.state)) return;
  double next_s = 0;
  if (config_.telling == TellingRule::kLife) {
    next_s = Seconds(rules_.NextChangeNs(ClassOf(thing), item.life) - kEpochNs);
  } else {
    // Not heard of for three expected lives the naive rule forgets it.
    next_s = Seconds(item.life.last_yes_ns - kEpochNs) + 3 * catalogue_.Get(name).expected_life_s;
    if (t + 1 >= next_s) {
      Enter(item, {item.life.state, HazardState::kGone, "old"}, t);
      item.life.state = HazardState::kGone;
      polling_.SetHazard(index, PlaceOf(thing), ClassOf(thing), item.life, denied, Stamp(t));
      return;
    }
  }
  Push(std::max(t, next_s), Happening::kAdvances, index, 0, item.version);
}

void Study::Enter(Item& item, const LifeTransition& transition, double t) {
  Thing& thing = things_[item.thing];
  ClassFigures& figures = FiguresOf(thing);
  const bool was_told = transition.from && IsTold(*transition.from);
  const bool stands = thing.Stands(t);
  if (!was_told && IsTold(transition.to)) {
    item.told_s = t;
    if (!stands && Measured(t) && !thing.false_counted) {
      ++figures.false_told;
      thing.false_counted = true;
    }
    if (stands) {
      if (thing.first_told_s < 0) {
        thing.first_told_s = t;
        if (Measured(thing.begins_s)) ++figures.told;
      }
      if (thing.noticeable_s >= 0) thing.missing_s += t - thing.noticeable_s;
      thing.noticeable_s = -1;
    }
  }
  if (transition.to != HazardState::kGone) return;
  if (was_told) StopTelling(item, thing, t);
  thing.item = kNone;
}

void Study::StopTelling(Item& item, Thing& thing, double t) {
  ClassFigures& figures = FiguresOf(thing);
  if (thing.Stands(t)) {
    if (Measured(t)) ++figures.dropped;
    thing.noticeable_s = t;
    return;
  }
  // `told_s` is when it became wrong.
  if (!Measured(item.told_s)) return;
  figures.wrong_s += t - item.told_s;
  if (thing.real) figures.minutes_until_gone.push_back((t - item.told_s) / 60);
}

void Study::Finish() {
  for (Thing& thing : things_) {
    ClassFigures& figures = FiguresOf(thing);
    const bool on_map = thing.item != kNone;
    if (on_map && IsTold(items_[thing.item].life.state) && !thing.Stands(last_s_)) {
      StopTelling(items_[thing.item], thing, last_s_);
    }
    if (!thing.real || !Measured(thing.begins_s)) continue;
    const bool noticeable = thing.honest.size() >= ClassOf(thing).confirmations;
    figures.noticeable += noticeable ? 1 : 0;
    figures.untold += noticeable && thing.first_told_s < 0 ? 1 : 0;
    figures.missing_s += thing.missing_s;
  }
  for (auto& [name, of_class] : figures_.classes) {
    of_class.learned_life_s = survival_.Of(name).MeanLifeS();
  }
  figures_.polls = polling_.polls();
  figures_.poll_bytes = polling_.bytes();
  figures_.measured_days = (end_s_ - begin_s_) / kDayS;
}

}  // namespace

StudyFigures RunStudy(const StudyConfig& config, const HazardCatalogue& catalogue) {
  return Study(config, catalogue).Run();
}

}  // namespace livemap
