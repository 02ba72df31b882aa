#include "placement/road_ground_contact.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "protocol/report.h"

namespace livemap::placement {
namespace {

constexpr double kSidePx = 1.5;  // A detector's box ends within so many pixels of the side.

}  // namespace

bool IsWellFormed(const Sighting& sighting) {
  const imaging::Box& box = sighting.box;
  const bool finite = std::isfinite(box.x_min) && std::isfinite(box.y_min) &&
                      std::isfinite(box.x_max) && std::isfinite(box.y_max);
  return finite && box.x_min < box.x_max && box.y_min < box.y_max && sighting.confidence >= 0 &&
         sighting.confidence <= 1 && !sighting.class_name.empty() &&
         sighting.class_name.size() <= protocol::kMaxClassNameBytes;
}

Eigen::Vector2d ContactPixel(const imaging::Box& box) {
  return {0.5 * (static_cast<double>(box.x_min) + static_cast<double>(box.x_max)) - 0.5,
          static_cast<double>(box.y_max) - 0.5};
}

bool IsCutBySide(const imaging::Box& box, double image_width) {
  return static_cast<double>(box.x_min) < kSidePx ||
         static_cast<double>(box.x_max) > image_width - kSidePx;
}

double LargestSigmaM(const Eigen::Matrix2d& covariance_m2) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance_m2, Eigen::EigenvaluesOnly);
  return std::sqrt(axes.eigenvalues().maxCoeff());
}

bool IsNearEnough(const geo::GroundPoint& foot, double heading_variance_rad2, double max_range_m,
                  double max_sigma_m) {
  const Eigen::Vector2d swing_m(foot.position_m.y(), -foot.position_m.x());
  const Eigen::Matrix2d seen_from_vehicle_m2 =
      foot.covariance_m2 + heading_variance_rad2 * swing_m * swing_m.transpose();
  return foot.position_m.norm() <= max_range_m &&
         LargestSigmaM(seen_from_vehicle_m2) <= max_sigma_m;
}

}  // namespace livemap::placement
