#include "zone_life/study.h"

#include <algorithm>
#include <utility>

#include "zone_life/study_state.h"

namespace livemap::bench {

Study::Study(const StudyConfig& config, const protocol::HazardCatalogue& catalogue)
    : config_(config),
      catalogue_(catalogue),
      world_(config.seed * 7919 + 1),
      traffic_(config.seed * 7919 + 2),
      senses_(config.seed * 7919 + 3),
      malice_(config.seed * 7919 + 4),
      fleet_(town_, config.vehicles, traffic_),
      survival_(catalogue),
      allowance_(zone::VehicleAllowance::Config()),
      polling_(config.polling),
      hostile_(config.vehicles),
      things_on_(town_.roads()),
      begin_s_(config.warm_up_days * kDayS),
      end_s_((config.days - config.last_days) * kDayS),
      last_s_(config.days * kDayS) {
  for (std::size_t i = 0; i < config.vehicles; ++i) {
    hostile_[i] = malice_.Uniform() < config.malicious_share;
    names_.push_back("v" + std::to_string(i));
    keys_.push_back(zone::VehicleKey(names_.back()));
    vehicle_of_name_[names_.back()] = i;
  }
  for (std::size_t i = 0; i < kClasses; ++i) {
    const protocol::HazardClass entry = catalogue_.Get(kNature[i].name);
    classes_[i] = zone::ClassModelOf(entry, survival_.Of(entry.name));
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
      const bool told = thing.item != kNone && zone::IsTold(items_[thing.item].life.state);
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
      if (item.version != event.version || !zone::IsOnMap(item.life.state)) return;
      const zone::LifecycleUpdate step =
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

StudyFigures RunStudy(const StudyConfig& config, const protocol::HazardCatalogue& catalogue) {
  return Study(config, catalogue).Run();
}

}  // namespace livemap::bench
