#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::vehicle {

/// What change detection knows of one place: a thing went or came since an earlier drive.
struct ChangeEvidence {
  std::int64_t stamp_ns = 0;  ///< Of the last image that shows it.
  std::string change_class;   ///< "barrier", "sign", ... as ChangeClassName has it.
  bool vanished = false;      ///< Else it appeared.
  geo::GeoPoint position;
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< East-north axes.
  float confidence = 0;                                     ///< 0..1.
};

/// Whether a thing of the class of change may be a hazard of that class: a sign a road work sign, a
/// vehicle a stopped accident; what is of no certain class (other_objects) any hazard but a
/// pothole, which is no thing.
bool MayBe(const std::string& change_class, const std::string& hazard_class);

}  // namespace livemap::vehicle
