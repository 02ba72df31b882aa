#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "common/error.h"
#include "geo/wgs84.h"
#include "measurements.h"
#include "pair_alignment.h"
#include "tools/common/progress.h"

namespace livemap::bench {
namespace {

/// How wrong the guesses of one row are.
struct Offset {
  double translation_m = 0;
  double rotation_deg = 0;
};

std::vector<Offset> Offsets() {
  std::vector<Offset> offsets = {{0, 0}};
  for (const double size_m : {0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4}) offsets.push_back({size_m, 0});
  for (const double size_deg : {1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0}) {
    offsets.push_back({0, size_deg});
  }
  return offsets;
}

class Directions {
 public:
  explicit Directions(std::uint32_t seed) : random_(seed) {}
  Eigen::Vector3d Next() {
    const double z = 2 * Share() - 1, angle = 2 * M_PI * Share(), r = std::sqrt(1 - z * z);
    return {r * std::cos(angle), r * std::sin(angle), z};
  }

 private:
  /// Not the standard's distributions, which differ from library to library.
  double Share() { return (static_cast<double>(random_()) + 0.5) / 4294967296.0; }
  std::mt19937 random_;
};

Eigen::Isometry3d Moved(const Eigen::Isometry3d& truth, const Offset& offset,
                        const Eigen::Vector3d& direction) {
  odometry::Vector6d twist;
  twist << offset.translation_m * direction,
      offset.rotation_deg * geo::kRadiansPerDegree * direction;
  return truth * odometry::Se3Exp(twist);
}

bool IsNear(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
            const BasinOptions& options) {
  const Eigen::Isometry3d error = truth.inverse() * found;
  const double angle = Eigen::AngleAxisd(error.linear()).angle();
  return error.translation().norm() <= options.bound_m &&
         std::abs(angle) <= options.bound_deg * geo::kRadiansPerDegree;
}

/// First frames of pairs, spread evenly, both of whose frames have a true pose.
std::vector<std::size_t> PairsOf(const Recording& recording, std::size_t wanted) {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i + 1 < recording.size(); ++i) {
    if (recording.TruthAt(i) && recording.TruthAt(i + 1)) all.push_back(i);
  }
  if (all.empty()) throw Error("no two neighbouring frames have a true pose within 0.02 s");
  const std::size_t count = std::min(wanted, all.size());
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < count; ++i) chosen.push_back(all[i * all.size() / count]);
  return chosen;
}

}  // namespace

nlohmann::ordered_json MeasureBasin(const Recording& recording, const BasinOptions& options) {
  const auto methods = MakePairAlignments(recording.camera());
  const std::vector<std::size_t> pairs = PairsOf(recording, options.pairs);
  const std::vector<Offset> offsets = Offsets();
  std::vector<std::vector<int>> converged(offsets.size(), std::vector<int>(methods.size(), 0));
  Directions directions(options.seed);
  tools::Progress progress("basin", pairs.size());
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) {
    const std::size_t first = pairs[pair];
    const odometry::RgbdFrame reference = recording.Read(first), image = recording.Read(first + 1);
    const Eigen::Isometry3d truth =
        recording.TruthAt(first + 1)->inverse() * *recording.TruthAt(first);
    for (const auto& method : methods) method->Take(reference, image);
    for (std::size_t k = 0; k < offsets.size(); ++k) {
      const Eigen::Isometry3d guess = Moved(truth, offsets[k], directions.Next());
      for (std::size_t m = 0; m < methods.size(); ++m) {
        const auto found = methods[m]->Align(guess);
        if (found && IsNear(*found, truth, options)) ++converged[k][m];
      }
    }
    progress.At(pair + 1);
  }
  nlohmann::ordered_json json = DescriptionOf(recording);
  json["pairs"] = pairs.size();
  json["bound_m"] = options.bound_m;
  json["bound_deg"] = options.bound_deg;
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    nlohmann::ordered_json row = {{"translation_m", offsets[k].translation_m},
                                  {"rotation_deg", offsets[k].rotation_deg}};
    for (std::size_t m = 0; m < methods.size(); ++m) {
      row[methods[m]->name()] = converged[k][m] / static_cast<double>(pairs.size());
    }
    json["rows"].push_back(row);
  }
  return json;
}

}  // namespace livemap::bench
