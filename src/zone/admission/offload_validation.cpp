#include "zone/admission/offload_validation.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "imaging/image_header.h"
#include "protocol/text_rules.h"

namespace livemap::zone {
namespace {

using Why = std::optional<Refusal>;

Refusal UnusableOffload(std::string sentence) {
  return {RefusalKind::kMalformed, std::move(sentence)};
}

/// The parts that a candidate shares with a report, as the smallest report that has them.
protocol::Report OffloadPartsOf(const protocol::OffloadedFrame& frame) {
  protocol::Report report;
  report.uuid.bytes[0] = 1;
  report.vehicle_id = frame.vehicle_id;
  report.drive_id = frame.drive_id;
  report.stamp_ns = frame.stamp_ns;
  report.class_name = "candidate";
  report.confidence = frame.score;
  report.box = {0, 0, 1, 1};
  report.position = frame.base.position;
  report.covariance_m2 = frame.base.covariance_m2;
  report.image_width = static_cast<std::uint32_t>(std::max(0, frame.intrinsics.width));
  report.image_height = static_cast<std::uint32_t>(std::max(0, frame.intrinsics.height));
  return report;
}

Why WhyOffloadPoseRefused(const geo::TrackPose& base, const OffloadLimits& limits) {
  if (!(std::abs(base.course_rad) <= 4 * M_PI)) {
    return UnusableOffload("course " + NumberText(base.course_rad) + " rad is not within +-4 pi");
  }
  const double most = limits.max_course_sigma_rad * limits.max_course_sigma_rad;
  if (!(base.course_variance_rad2 >= 0 && base.course_variance_rad2 <= most)) {
    return UnusableOffload("variance of the course " + NumberText(base.course_variance_rad2) +
                           " rad^2 is not within 0 to " + std::to_string(most));
  }
  // A correlation beyond 1 per axis belongs to no covariance; a thousandth is rounding's.
  for (int axis = 0; axis < 2; ++axis) {
    const double largest =
        std::sqrt(base.covariance_m2(axis, axis) * base.course_variance_rad2) * 1.001 + 1e-9;
    if (!(std::abs(base.position_course(axis)) <= largest)) {
      return UnusableOffload("covariance of position and course is none");
    }
  }
  return std::nullopt;
}

Why WhyOffloadCameraRefused(const protocol::OffloadedFrame& frame, const OffloadLimits& limits) {
  const geo::CameraIntrinsics& camera = frame.intrinsics;
  const auto is_focal_length = [](double f) { return f >= 1 && f <= 1e5; };
  if (!is_focal_length(camera.fx) || !is_focal_length(camera.fy)) {
    return UnusableOffload("focal lengths " + NumberText(camera.fx) + " and " +
                           NumberText(camera.fy) + " are not within 1 to 100000 pixels");
  }
  const auto is_near = [](double c, int side) { return c >= -2.0 * side && c <= 3.0 * side; };
  if (!is_near(camera.cx, camera.width) || !is_near(camera.cy, camera.height)) {
    return UnusableOffload("principal point is far outside of the picture");
  }
  const Eigen::Vector3d place_m = frame.base_from_optical.translation();
  if (!(place_m.cwiseAbs().maxCoeff() <= limits.max_mounting_m) || !place_m.allFinite()) {
    return UnusableOffload("camera is not within " + std::to_string(limits.max_mounting_m) +
                           " m of the vehicle's origin");
  }
  const Eigen::Matrix3d turn = frame.base_from_optical.linear();
  const bool is_rotation = turn.allFinite() && turn.determinant() > 0 &&
                           (turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3;
  if (!is_rotation) return UnusableOffload("orientation of the camera is no rotation");
  return std::nullopt;
}

Why WhyOffloadJpegRefused(const protocol::OffloadedFrame& frame, const OffloadLimits& limits) {
  if (auto why = WhyPictureRefused(frame.image, limits.report)) return why;
  const auto header = imaging::ReadImageHeader(frame.image.data(), frame.image.size());
  if (!header || header->format != imaging::ImageHeader::Format::kJpeg) {
    return UnusableOffload("picture is no JPEG");
  }
  if (header->width != frame.intrinsics.width || header->height != frame.intrinsics.height) {
    return UnusableOffload("picture is " + std::to_string(header->width) + " x " +
                           std::to_string(header->height) + " pixels, its intrinsics are of " +
                           std::to_string(frame.intrinsics.width) + " x " +
                           std::to_string(frame.intrinsics.height));
  }
  if (!imaging::HasImageEnd(frame.image.data(), frame.image.size(), header->format)) {
    return UnusableOffload("picture is cut off");
  }
  return std::nullopt;
}

}  // namespace

std::optional<Refusal> WhyOffloadRefused(const protocol::OffloadedFrame& frame,
                                         const OffloadLimits& limits, std::int64_t now_ns) {
  if (auto why = WhyRefused(OffloadPartsOf(frame), limits.report, now_ns)) return why;
  if (auto why = WhyOffloadPoseRefused(frame.base, limits)) return why;
  if (auto why = WhyOffloadCameraRefused(frame, limits)) return why;
  if (!frame.image_frame_id.empty() &&
      !protocol::IsPrintableText(frame.image_frame_id, limits.report.max_text_bytes)) {
    return UnusableOffload("frame_id of " + std::to_string(frame.image_frame_id.size()) +
                           " bytes is not accepted: it must be printable UTF-8 of up to " +
                           std::to_string(limits.report.max_text_bytes) + " bytes");
  }
  return WhyOffloadJpegRefused(frame, limits);
}

}  // namespace livemap::zone
