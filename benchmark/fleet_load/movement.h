#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace livemap::bench {

/// Where one vehicle is in one second.
struct VehicleStep {
  Eigen::Vector2d east_north_m = Eigen::Vector2d::Zero();  ///< From the city's south-west corner.
  double course_rad = 0;                                   ///< Clockwise from true north.
  double speed_mps = 0;
};

/// A square city of straight streets that cross each other, and how its vehicles move, second by
/// second. The movement is a trace, which ./livemap bench fleet makes with SUMO, or is made up
/// here: each vehicle drives at its own speed and turns at random at crossings.
class Movement {
 public:
  struct Config {
    std::size_t vehicles = 100;
    std::size_t seconds = 60;
    double side_m = 20000;   ///< Of the city.
    double block_m = 400;    ///< Between two streets.
    std::uint64_t seed = 1;  ///< Of what is made up.
  };

  /// Made-up movement.
  explicit Movement(const Config& config);
  /// The first vehicles and seconds of a trace: the numbers of its vehicles and seconds as 32-bit
  /// integers, then per second and vehicle east, north, course and speed as 32-bit floats, all
  /// little-endian. Throws Error naming the file when it is shorter or has a value that is no place
  /// in the city.
  Movement(const Config& config, const std::string& trace);

  const Config& config() const { return config_; }
  const VehicleStep& At(std::size_t vehicle, std::size_t second) const {
    return steps_[second * config_.vehicles + vehicle];
  }
  /// A place on some street, evenly over all of them.
  Eigen::Vector2d RandomPlace(std::mt19937_64& random) const;

 private:
  Config config_;
  std::vector<VehicleStep> steps_;
};

}  // namespace livemap::bench
