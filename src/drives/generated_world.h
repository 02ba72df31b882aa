#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace livemap {

/// One hazard of a generated drive, in metres along the road and to the left of the driven line.
struct GeneratedHazard {
  int id = 0;
  std::string class_name;  ///< "pothole" or "traffic_cone".
  double along_m = 0;      ///< Of the centre.
  double left_m = 0;
  double radius_m = 0;     ///< Pothole: mean radius across the road. Cone: half its foot.
  std::uint64_t seed = 0;  ///< Of its shape.
};

enum class RoadsideKind { kTree, kBush, kPost };

/// Something upright beside the road.
struct RoadsideObject {
  RoadsideKind kind = RoadsideKind::kTree;
  double along_m = 0;
  double left_m = 0;
  double height_m = 0;
  int variant = 0;  ///< Which of the painted pictures.
};

/// A straight country road with two lanes of 3.5 m; the vehicle drives in the middle of the right
/// one, along left = 0.
struct GeneratedWorld {
  std::uint64_t seed = 0;
  double length_m = 0;                   ///< Driven.
  std::vector<GeneratedHazard> hazards;  ///< By along_m.
  std::vector<RoadsideObject> roadside;  ///< By along_m.
};

/// Edges of the road, metres left of the driven line.
constexpr double kRightEdgeM = -1.75;
constexpr double kCentreM = 1.75;
constexpr double kLeftEdgeM = 5.25;
constexpr double kRightVergeM = -2.9;
constexpr double kLeftVergeM = 6.4;

/// Plans a drive of `length_m`; the same seed gives the same world. Hazards of one class stand at
/// least 14 m apart, so that each is one hazard on the map.
GeneratedWorld PlanWorld(std::uint64_t seed, double length_m);

/// Uniform in [low, high): the library's distributions differ between platforms.
double Uniform(std::mt19937_64& generator, double low, double high);

/// Hashes two numbers to a seed (splitmix64), so that each part of a world has its own randomness.
std::uint64_t MixSeed(std::uint64_t seed, std::uint64_t salt);

}  // namespace livemap
