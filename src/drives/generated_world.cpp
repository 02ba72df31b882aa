#include "drives/generated_world.h"

#include <algorithm>

namespace livemap {
namespace {

constexpr double kFirstHazardM = 22;
constexpr double kSpacingMinM = 14;
constexpr double kSpacingMaxM = 24;
constexpr double kViewM = 150;  // What stands behind the end of the drive is seen too.

void PlanHazards(std::mt19937_64& generator, GeneratedWorld& world) {
  double along_m = kFirstHazardM;
  for (int id = 0; along_m < world.length_m - 3; ++id) {
    GeneratedHazard hazard;
    hazard.id = id;
    hazard.along_m = along_m;
    const bool pothole = id % 3 != 1;
    hazard.class_name = pothole ? "pothole" : "traffic_cone";
    if (pothole) {
      hazard.left_m = Uniform(generator, -1.2, 1.3);
      hazard.radius_m = Uniform(generator, 0.32, 0.55);
    } else {
      const bool right = Uniform(generator, 0, 1) < 0.7;
      hazard.left_m = right ? Uniform(generator, -2.3, -1.95) : Uniform(generator, 1.6, 1.9);
      hazard.radius_m = 0.2;
    }
    hazard.seed = generator();
    world.hazards.push_back(hazard);
    along_m += Uniform(generator, kSpacingMinM, kSpacingMaxM);
  }
}

void PlanRoadside(std::mt19937_64& generator, GeneratedWorld& world) {
  const double end_m = world.length_m + kViewM;
  for (double along_m = 5; along_m < end_m; along_m += 25) {
    world.roadside.push_back({RoadsideKind::kPost, along_m, kRightVergeM - 0.6, 1.0, 0});
    world.roadside.push_back({RoadsideKind::kPost, along_m, kLeftVergeM + 0.6, 1.0, 0});
  }
  for (double along_m = 0; along_m < end_m; along_m += Uniform(generator, 2, 6)) {
    RoadsideObject object;
    const bool tree = Uniform(generator, 0, 1) < 0.55;
    object.kind = tree ? RoadsideKind::kTree : RoadsideKind::kBush;
    object.along_m = along_m;
    const double away_m = tree ? Uniform(generator, 4, 30) : Uniform(generator, 2.5, 20);
    const bool left = Uniform(generator, 0, 1) < 0.5;
    object.left_m = left ? kLeftVergeM + away_m : kRightVergeM - away_m;
    object.height_m = tree ? Uniform(generator, 4, 9) : Uniform(generator, 0.8, 2.2);
    object.variant = static_cast<int>(Uniform(generator, 0, 4));
    world.roadside.push_back(object);
  }
  std::sort(world.roadside.begin(), world.roadside.end(),
            [](const RoadsideObject& a, const RoadsideObject& b) { return a.along_m < b.along_m; });
}

}  // namespace

double Uniform(std::mt19937_64& generator, double low, double high) {
  return low + (high - low) * static_cast<double>(generator() >> 11U) / 9007199254740992.0;
}

std::uint64_t MixSeed(std::uint64_t seed, std::uint64_t salt) {
  std::uint64_t x = seed + 0x9e3779b97f4a7c15ULL * (salt + 1);
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

GeneratedWorld PlanWorld(std::uint64_t seed, double length_m) {
  GeneratedWorld world;
  world.seed = seed;
  world.length_m = length_m;
  std::mt19937_64 hazards(MixSeed(seed, 1));
  PlanHazards(hazards, world);
  std::mt19937_64 roadside(MixSeed(seed, 2));
  PlanRoadside(roadside, world);
  return world;
}

}  // namespace livemap
