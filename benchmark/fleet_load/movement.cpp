#include "fleet_load/movement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>

#include "common/error.h"

namespace livemap::bench {
namespace {

constexpr double kMaxSpeedMps = 60;
constexpr double kQuarterTurnRad = 1.57079632679489661923;
// North, east, south, west.
constexpr std::array<std::array<int, 2>, 4> kHeadings = {{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};

/// Drives along streets from crossing to crossing.
class StreetDriver {
 public:
  StreetDriver(const Movement::Config& city, std::uint64_t seed) : city_(city), random_(seed) {
    const int blocks = Blocks();
    std::uniform_int_distribution<int> crossing(0, blocks);
    at_ = {crossing(random_), crossing(random_)};
    speed_mps_ = std::uniform_real_distribution<>(7, 15)(random_);
    Turn();
    along_m_ = std::uniform_real_distribution<>(0, city_.block_m)(random_);
  }

  VehicleStep Now() const {
    const auto& heading = kHeadings[heading_];
    return {Eigen::Vector2d(at_[0] * city_.block_m + heading[0] * along_m_,
                            at_[1] * city_.block_m + heading[1] * along_m_),
            static_cast<double>(heading_) * kQuarterTurnRad, speed_mps_};
  }

  void Drive() {
    along_m_ += speed_mps_;
    if (along_m_ < city_.block_m) return;
    along_m_ -= city_.block_m;
    at_[0] += kHeadings[heading_][0];
    at_[1] += kHeadings[heading_][1];
    Turn();
  }

 private:
  int Blocks() const { return static_cast<int>(city_.side_m / city_.block_m); }

  /// Mostly straight on, never back and never out of the city.
  void Turn() {
    const auto leads_out = [this](std::size_t heading) {
      const int east = at_[0] + kHeadings[heading][0];
      const int north = at_[1] + kHeadings[heading][1];
      return east < 0 || north < 0 || east > Blocks() || north > Blocks();
    };
    const int draw = std::uniform_int_distribution<int>(0, 3)(random_);
    const std::size_t before = heading_;
    heading_ = (before + (draw == 0 ? 3 : draw == 1 ? 1 : 0)) % 4;
    while (leads_out(heading_) || heading_ == (before + 2) % 4) heading_ = (heading_ + 1) % 4;
  }

  const Movement::Config city_;
  std::mt19937_64 random_;
  std::array<int, 2> at_{};
  std::size_t heading_ = 0;
  double along_m_ = 0;
  double speed_mps_ = 0;
};

}  // namespace

Movement::Movement(const Config& config) : config_(config) {
  steps_.resize(config_.vehicles * config_.seconds);
  for (std::size_t vehicle = 0; vehicle < config_.vehicles; ++vehicle) {
    StreetDriver driver(config_, config_.seed + vehicle);
    for (std::size_t second = 0; second < config_.seconds; ++second, driver.Drive()) {
      steps_[second * config_.vehicles + vehicle] = driver.Now();
    }
  }
}

Movement::Movement(const Config& config, const std::string& trace) : config_(config) {
  std::ifstream file(trace, std::ios::binary);
  std::array<std::uint32_t, 2> size{};
  file.read(reinterpret_cast<char*>(size.data()), sizeof(size));
  if (!file || size[0] < config_.vehicles || size[1] < config_.seconds) {
    throw Error("trace '" + trace + "' has " + std::to_string(size[0]) + " vehicles and " +
                std::to_string(size[1]) + " seconds, at least " + std::to_string(config_.vehicles) +
                " and " + std::to_string(config_.seconds) + " are wanted");
  }
  steps_.resize(config_.vehicles * config_.seconds);
  for (std::size_t second = 0; second < config_.seconds; ++second) {
    const std::uint64_t row = std::uint64_t{second} * size[0];
    file.seekg(static_cast<std::streamoff>(sizeof(size) + row * 4 * sizeof(float)));
    for (std::size_t vehicle = 0; vehicle < config_.vehicles; ++vehicle) {
      std::array<float, 4> values{};
      file.read(reinterpret_cast<char*>(values.data()), sizeof(values));
      const bool is_place = file && values[0] >= -100 && values[0] <= config_.side_m + 100 &&
                            values[1] >= -100 && values[1] <= config_.side_m + 100 &&
                            std::isfinite(values[2]) && values[3] >= 0 && values[3] <= kMaxSpeedMps;
      if (!is_place) {
        throw Error("trace '" + trace + "' has no place in the city for vehicle " +
                    std::to_string(vehicle) + " in second " + std::to_string(second));
      }
      steps_[second * config_.vehicles + vehicle] = {Eigen::Vector2d(values[0], values[1]),
                                                     values[2], values[3]};
    }
  }
}

Eigen::Vector2d Movement::RandomPlace(std::mt19937_64& random) const {
  const int blocks = static_cast<int>(config_.side_m / config_.block_m);
  const double across_m = std::uniform_int_distribution<int>(0, blocks)(random) * config_.block_m;
  const double along_m = std::uniform_real_distribution<>(0, config_.side_m)(random);
  return random() % 2 == 0 ? Eigen::Vector2d(across_m, along_m)
                           : Eigen::Vector2d(along_m, across_m);
}

}  // namespace livemap::bench
