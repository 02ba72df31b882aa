#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <queue>
#include <set>
#include <string>
#include <vector>

#include "common/time.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/belief/hazard_lifecycle.h"
#include "zone/belief/vehicle_trust.h"
#include "zone_life/nature.h"
#include "zone_life/study.h"
#include "zone_life/town.h"

namespace livemap::bench {

constexpr std::size_t kNone = ~std::size_t{0};

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
  zone::PresenceRecord life;
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

/// What stands behind RunStudy; only its own sources include this.
class Study {
 public:
  Study(const StudyConfig& config, const protocol::HazardCatalogue& catalogue);
  StudyFigures Run();

 private:
  static constexpr std::int64_t kEpochNs = 1'700'000'000LL * 1'000'000'000;

  static std::int64_t Stamp(double t) { return kEpochNs + Nanoseconds(t); }
  void Push(double at_s, Happening what, std::size_t a, std::size_t b = 0,
            std::uint32_t version = 0, Town::Lane lane = {});
  bool Measured(double t) const { return t >= begin_s_ && t < end_s_; }
  bool Hostile(std::size_t vehicle) const { return hostile_[vehicle]; }
  zone::ClassModel ClassOf(const Thing& thing) const { return classes_[thing.kind]; }
  ClassFigures& FiguresOf(const Thing& thing) { return figures_.classes[kNature[thing.kind].name]; }
  geo::GeoPoint PlaceOf(const Thing& thing) const { return town_.At(thing.road, thing.offset_m); }

  // What there is: study.cpp.
  void PlanHazards();
  std::size_t AddThing(std::size_t kind, bool real, double begins_s, double life_s,
                       std::size_t road, double offset_m);
  void Handle(const Event& event);
  void BeginDay(int day);
  // What vehicles do: study_vehicles.cpp.
  void Invent(std::size_t vehicle, double t, const Town::Lane& lane);
  void Traverse(const Event& event);
  void Approach(const Event& event);
  void Pass(std::size_t vehicle, Thing& thing, std::size_t index, double t);
  void PassHostile(std::size_t vehicle, Thing& thing, std::size_t index, double t);
  void Answer(const Event& event);
  void Tell(std::size_t vehicle, std::size_t thing, zone::EvidenceKind kind, double t);
  // What the zone makes of it: study_map.cpp.
  void Follow(std::size_t item, const zone::LifecycleUpdate& step, bool denied, double t);
  void Count(Item& item, zone::EvidenceKind kind, zone::LifecycleUpdate& step, double t);
  void Enter(Item& item, const zone::LifecycleTransition& transition, double t);
  void StopTelling(Item& item, Thing& thing, double t);
  void Finish();

  StudyConfig config_;
  protocol::HazardCatalogue catalogue_;
  datasets::SeededRandom world_, traffic_, senses_, malice_;
  Town town_;
  Fleet fleet_;
  zone::SurvivalModel survival_;
  zone::HazardLifecycle rules_;
  zone::VehicleAllowance allowance_;
  zone::VehicleTrust trust_;
  Polling polling_;
  std::vector<bool> hostile_;
  std::vector<std::string> names_;
  std::vector<std::uint64_t> keys_;
  std::map<std::string, std::size_t> vehicle_of_name_;
  std::array<zone::ClassModel, kClasses> classes_;
  std::vector<Thing> things_;
  std::vector<Item> items_;
  std::vector<std::vector<std::size_t>> things_on_;  // By road: those that stand or are on the map.
  std::priority_queue<Event> events_;
  std::uint64_t order_ = 0;
  double begin_s_, end_s_, last_s_;
  StudyFigures figures_;
};

}  // namespace livemap::bench
