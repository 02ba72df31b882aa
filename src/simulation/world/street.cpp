#include "simulation/world/street.h"

#include <cmath>

#include "simulation/world/block_builder.h"

namespace livemap::simulation {
namespace {

/// Streams of randomness: one per kind of thing, so that none shifts another.
enum StreetStream : std::uint64_t { kHazards = 11, kCrossings = 12, kGroundDetails = 13 };

std::uint64_t StreetItem(int index) { return static_cast<std::uint64_t>(index) + 1000; }

StreetHazard DrawStreetHazard(ObjectClass object_class, double along, double left, double radius,
                              CounterRandom& random) {
  StreetHazard hazard;
  hazard.object_class = object_class;
  hazard.along_m = along;
  hazard.left_m = left;
  hazard.radius_m = radius;
  hazard.seed = random.Bits();
  return hazard;
}

/// A place where people work on the parking lane: sign, barrier, cones, perhaps a machine.
void DrawStreetWorkSite(double begin, const StreetProfile& profile, CounterRandom& random,
                        std::vector<StreetHazard>& hazards) {
  const auto lane = static_cast<double>(profile.lane_width_m);
  const double edge = -lane - 0.15;
  hazards.push_back(
      DrawStreetHazard(ObjectClass::kRoadWorkSign, begin + 4, -lane - 0.9, 0.5, random));
  hazards.push_back(DrawStreetHazard(ObjectClass::kBarrier, begin + 10, -lane - 1.2, 0.9, random));
  for (int cone = 0; cone < 4; ++cone) {
    hazards.push_back(
        DrawStreetHazard(ObjectClass::kTrafficCone, begin + 10.5 + 3.5 * cone, edge, 0.2, random));
  }
  if (random.Chance(0.6)) {
    hazards.push_back(
        DrawStreetHazard(ObjectClass::kConstructionMachine, begin + 17, -lane - 1.75, 1.9, random));
  }
}

void DrawSingleStreetHazard(double begin, const StreetProfile& profile, CounterRandom& random,
                            std::vector<StreetHazard>& hazards) {
  const auto lane = static_cast<double>(profile.lane_width_m);
  const double along = begin + random.Uniform(14.0, 26.0);
  const double kind = random.Uniform(0.0, 1.0);
  if (kind < 0.22) {
    hazards.push_back(DrawStreetHazard(ObjectClass::kDebris, along,
                                       random.Chance(0.5) ? 0.4 : -lane - 0.3, 0.5, random));
  } else if (kind < 0.42) {
    hazards.push_back(DrawStreetHazard(ObjectClass::kDeer, along,
                                       random.Chance(0.5) ? random.Uniform(1.0, 2.5) : -lane - 0.9,
                                       0.6, random));
  } else if (kind < 0.58) {
    hazards.push_back(
        DrawStreetHazard(ObjectClass::kStoppedAccident, along, 0.5 * lane + 0.5, 3.2, random));
  } else if (kind < 0.8) {
    hazards.push_back(DrawStreetHazard(ObjectClass::kTrafficCone, along,
                                       random.Chance(0.5) ? 0.05 : -lane, 0.2, random));
  } else {
    hazards.push_back(
        DrawStreetHazard(ObjectClass::kBarrier, along, 0.5 * lane + 0.4, 0.9, random));
  }
}

double StreetHazardRadius(ObjectClass object_class, CounterRandom& random) {
  switch (object_class) {
    case ObjectClass::kPothole:
      return random.Uniform(0.24, 0.5);
    case ObjectClass::kTrafficCone:
      return 0.2;
    case ObjectClass::kConstructionMachine:
      return 1.9;
    case ObjectClass::kStoppedAccident:
      return 3.2;
    case ObjectClass::kBarrier:
      return 0.9;
    default:
      return 0.5;
  }
}

}  // namespace

Street::Street(const WorldDescription& description, std::uint64_t seed, double length_m,
               bool leaves, const StreetPass& pass)
    : description_(description),
      seed_(seed),
      leaves_(leaves),
      pass_(pass),
      line_(description.bearing_deg,
            description.pieces.empty() ? DrawRoad(seed, length_m) : description.pieces) {
  profile_.lane_width_m = static_cast<float>(description.lane_width_m);
  profile_.parking_width_m = static_cast<float>(description.parking_width_m);
  profile_.pavement_width_m = static_cast<float>(description.pavement_width_m);
}

std::vector<double> Street::Crossings(int index) const {
  std::vector<double> crossings;
  if (description_.crossings_m) {
    for (const double at : *description_.crossings_m) {
      if (at >= index * kBlockM && at < (index + 1) * kBlockM) crossings.push_back(at);
    }
    return crossings;
  }
  CounterRandom random(seed_, kCrossings, StreetItem(index));
  const bool wanted = ((index % 3) + 3) % 3 == 1;
  if (wanted && random.Chance(0.75)) {
    crossings.push_back((index + 0.5) * kBlockM + random.Uniform(-6.0, 6.0));
  }
  return crossings;
}

std::vector<StreetHazard> Street::Hazards(int index) const {
  std::vector<StreetHazard> hazards;
  CounterRandom random(seed_, kHazards, StreetItem(index));
  const double begin = index * kBlockM;
  if (description_.hazards) {
    std::uint64_t number = 0;
    for (const PlacedHazard& placed : *description_.hazards) {
      ++number;
      if (placed.at_m < begin || placed.at_m >= begin + kBlockM) continue;
      CounterRandom own(seed_, kHazards + 100, number);
      StreetHazard hazard = DrawStreetHazard(
          placed.object_class, placed.at_m, placed.left_m,
          placed.radius_m > 0 ? placed.radius_m : StreetHazardRadius(placed.object_class, own),
          own);
      hazard.water = placed.water ? *placed.water : own.Chance(0.35);
      hazards.push_back(hazard);
    }
  } else if (index >= 0) {
    const double lane = description_.lane_width_m;
    for (const double along : {random.Uniform(7.0, 14.0), random.Uniform(28.0, 34.0)}) {
      if (random.Chance(0.25)) continue;
      StreetHazard hole = DrawStreetHazard(
          ObjectClass::kPothole, begin + along,
          random.Chance(0.75) ? random.Uniform(-lane + 0.5, -0.5) : random.Uniform(0.6, lane - 0.5),
          random.Uniform(0.24, 0.5), random);
      hole.water = random.Chance(0.3);
      hazards.push_back(hole);
    }
    const bool quiet = Crossings(index).empty();
    if (quiet && description_.parking_width_m > 1.5 && random.Chance(0.45)) {
      DrawStreetWorkSite(begin, profile_, random, hazards);
    } else if (random.Chance(0.85)) {
      DrawSingleStreetHazard(begin, profile_, random, hazards);
    }
  }
  for (std::size_t i = 0; i < hazards.size(); ++i) {
    const auto serial =
        static_cast<std::uint32_t>(index + 8) * 1024U + static_cast<std::uint32_t>(i);
    hazards[i].instance = MakeInstance(serial, hazards[i].object_class);
  }
  return hazards;
}

GroundPlan Street::PlanGround(int index) const {
  GroundPlan plan;
  plan.profile = profile_;
  plan.seed = static_cast<std::uint32_t>(CounterRandom(seed_, kGroundDetails).Bits());
  for (int near = index - 1; near <= index + 1; ++near) {
    for (const double at : Crossings(near)) plan.crossings_m.push_back(static_cast<float>(at));
    for (const StreetHazard& hazard : Hazards(near)) {
      if (hazard.object_class != ObjectClass::kPothole) continue;
      CounterRandom random(hazard.seed, 1);
      Pothole hole;
      hole.along_m = static_cast<float>(hazard.along_m);
      hole.left_m = static_cast<float>(hazard.left_m);
      hole.radius_m = static_cast<float>(hazard.radius_m);
      hole.depth_m = random.Uniform(0.05F, 0.09F);
      hole.water_m = hazard.water ? hole.depth_m * random.Uniform(0.5F, 0.75F) : 0.0F;
      hole.seed = random.Bits32();
      hole.instance = hazard.instance;
      plan.potholes.push_back(hole);
    }
    CounterRandom random(seed_, kGroundDetails, StreetItem(near));
    const auto begin = static_cast<float>(near * kBlockM);
    const float road = profile_.half_road_m();
    for (int i = 0; i < 2; ++i) {
      if (random.Chance(0.4)) continue;
      plan.manholes.push_back({begin + random.Uniform(2.0F, 38.0F),
                               random.Uniform(-0.9F, 0.9F) * profile_.lane_width_m, 0.32F,
                               random.Bits32()});
    }
    for (int i = 0; i < 3; ++i) {
      if (random.Chance(0.35)) continue;
      Repair repair;
      const float along = begin + random.Uniform(1.0F, 36.0F);
      const bool trench = random.Chance(0.3);
      const float left = trench ? -road : random.Uniform(-road, road - 1.5F);
      repair.low = Vec2(along, left);
      repair.high = Vec2(along + (trench ? random.Uniform(0.6F, 1.1F) : random.Uniform(0.8F, 4.0F)),
                         trench ? road : left + random.Uniform(0.6F, 1.8F));
      repair.seed = random.Bits32();
      plan.repairs.push_back(repair);
    }
  }
  return plan;
}

StreetBlock Street::Build(int index) const {
  StreetBlock block;
  block.origin = line_.At((index + 0.5) * kBlockM, 0, 0);
  block.ground = PlanGround(index);
  BlockBuilder(*this, index, block).Build();
  return block;
}

}  // namespace livemap::simulation
