#include "zone/admission/report_validation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "imaging/image_header.h"
#include "protocol/text_rules.h"

namespace livemap::zone {
namespace {

using Why = std::optional<Refusal>;

constexpr std::size_t kMaxFrameIdBytes = 255;  // ROS sets no limit to the name of a frame.

Refusal MalformedReport(std::string sentence) {
  return {RefusalKind::kMalformed, std::move(sentence)};
}

Why WhyReportTextRefused(const char* name, const std::string& text, const ReportLimits& limits) {
  if (protocol::IsAcceptableName(text, limits.max_text_bytes)) return std::nullopt;
  return MalformedReport(std::string(name) + " of " + std::to_string(text.size()) +
                         " bytes is not accepted: it must be printable UTF-8 of 1 to " +
                         std::to_string(limits.max_text_bytes) +
                         " bytes that shows something and has no blank at its ends");
}

std::string ToText(const geo::GeoPoint& point) {
  return "(" + NumberText(point.latitude_deg) + ", " + NumberText(point.longitude_deg) + ")";
}

Why WhyReportPositionRefused(const protocol::Report& report, const ReportLimits& limits) {
  if (!geo::IsValid(report.position)) {
    return MalformedReport("position " + ToText(report.position) +
                           " is no latitude and longitude in degrees");
  }
  if (IsPlaceOfNoFix(report.position)) {
    return MalformedReport("position is exactly 0, 0, which is what a receiver without a fix says");
  }
  if (limits.zone && !limits.zone->Contains(report.position)) {
    return Refusal{RefusalKind::kOutsideZone,
                   "position " + ToText(report.position) + " lies outside the zone"};
  }
  const Eigen::Matrix2d& covariance = report.covariance_m2;
  if (!covariance.allFinite()) return MalformedReport("covariance is not finite");
  // Compared with the largest entry, so that the unit does not matter; half a part per million is
  // what single precision on the way leaves.
  const double asymmetry = std::abs(covariance(0, 1) - covariance(1, 0));
  if (asymmetry > 1e-6 * covariance.cwiseAbs().maxCoeff())
    return MalformedReport("covariance is not symmetric");
  const double largest = limits.max_position_sigma_m * limits.max_position_sigma_m;
  if (covariance.cwiseAbs().maxCoeff() > largest) {
    return MalformedReport("covariance exceeds " + std::to_string(largest) + " m^2");
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues().minCoeff() > 0))
    return MalformedReport("covariance is not positive definite");
  return std::nullopt;
}

Why WhyReportBoxRefused(const protocol::Report& report, const ReportLimits& limits) {
  const std::uint32_t side = limits.max_image_side_px;
  if (report.image_width == 0 || report.image_height == 0 || report.image_width > side ||
      report.image_height > side) {
    return MalformedReport("image size " + std::to_string(report.image_width) + " x " +
                           std::to_string(report.image_height) + " is not within 1 to " +
                           std::to_string(side) + " pixels");
  }
  // A detector's edge may stand on the outer corner of the last pixel, and rounding may push it.
  constexpr float kSlackPx = 1.0F;
  const imaging::Box& box = report.box;
  const bool inside = box.x_min >= -kSlackPx && box.y_min >= -kSlackPx && box.x_min < box.x_max &&
                      box.y_min < box.y_max &&
                      box.x_max <= static_cast<float>(report.image_width) + kSlackPx &&
                      box.y_max <= static_cast<float>(report.image_height) + kSlackPx;
  if (!inside) return MalformedReport("box is empty or not inside the image");
  const imaging::PixelRegion& shown = report.shown;
  const bool shows_part = shown.width > 0 && shown.height > 0 && shown.x < report.image_width &&
                          shown.y < report.image_height &&
                          shown.width <= report.image_width - shown.x &&
                          shown.height <= report.image_height - shown.y;
  if (shows_part || (shown.IsWholeImage() && shown.x == 0 && shown.y == 0)) return std::nullopt;
  return MalformedReport("picture shows a region that is empty or not inside the image");
}

}  // namespace

bool IsPlaceOfNoFix(const geo::GeoPoint& position) {
  return position.latitude_deg == 0 && position.longitude_deg == 0;
}

std::optional<Refusal> WhyStampRefused(std::int64_t stamp_ns, const ReportLimits& limits,
                                       double max_age_s, std::int64_t now_ns) {
  if (stamp_ns < limits.min_stamp_ns) {
    return Refusal{RefusalKind::kTooOld, "stamp " + std::to_string(stamp_ns) + " ns lies before " +
                                             std::to_string(limits.min_stamp_ns) + " ns"};
  }
  // A difference of two arbitrary 64-bit stamps could overflow; of two non-negative ones it cannot.
  const double ahead_s = static_cast<double>(stamp_ns - std::max<std::int64_t>(now_ns, 0)) * 1e-9;
  if (ahead_s > limits.max_future_s) {
    return Refusal{RefusalKind::kFuture,
                   "stamp lies " + std::to_string(ahead_s) + " s in the future, at most " +
                       std::to_string(limits.max_future_s) + " s are accepted"};
  }
  if (-ahead_s > max_age_s) {
    return Refusal{RefusalKind::kTooOld, "stamp lies " + std::to_string(-ahead_s) +
                                             " s in the past, at most " +
                                             std::to_string(max_age_s) + " s are accepted"};
  }
  return std::nullopt;
}

const char* RefusalName(RefusalKind kind) {
  switch (kind) {
    case RefusalKind::kMalformed:
      return "malformed";
    case RefusalKind::kOutsideZone:
      return "outside_zone";
    case RefusalKind::kTooOld:
      return "too_old";
    case RefusalKind::kFuture:
      return "future";
    case RefusalKind::kReplay:
      return "replay";
    case RefusalKind::kSpeed:
      return "speed";
    case RefusalKind::kMapFull:
      return "map_full";
    case RefusalKind::kUnknownClass:
      return "unknown_class";
    case RefusalKind::kOneWitness:
      return "one_witness";
  }
  return "unknown";
}

std::optional<Refusal> WhyPictureRefused(const std::vector<std::uint8_t>& image,
                                         const ReportLimits& limits) {
  if (image.size() > limits.max_image_bytes) {
    return MalformedReport("picture has " + std::to_string(image.size()) + " bytes, at most " +
                           std::to_string(limits.max_image_bytes) + " are accepted");
  }
  const auto header = imaging::ReadImageHeader(image.data(), image.size());
  if (!header || header->format == imaging::ImageHeader::Format::kWebp) {
    return MalformedReport("picture is no JPEG or PNG");
  }
  const auto longer_side = static_cast<std::uint32_t>(std::max(header->width, header->height));
  if (longer_side > limits.max_image_side_px) {
    return MalformedReport("picture is " + std::to_string(header->width) + " x " +
                           std::to_string(header->height) + " pixels, at most " +
                           std::to_string(limits.max_image_side_px) + " per side are accepted");
  }
  const std::int64_t pixels = static_cast<std::int64_t>(header->width) * header->height;
  if (pixels > limits.max_image_pixels) {
    return MalformedReport("picture has " + std::to_string(pixels) + " pixels, at most " +
                           std::to_string(limits.max_image_pixels) + " are accepted");
  }
  return std::nullopt;
}

std::optional<Refusal> WhyRefused(const protocol::Report& report, const ReportLimits& limits,
                                  std::int64_t now_ns) {
  if (report.uuid.IsNil()) return MalformedReport("report has no uuid");
  if (auto why = WhyReportTextRefused("vehicle_id", report.vehicle_id, limits)) return why;
  if (!report.drive_id.empty()) {
    if (auto why = WhyReportTextRefused("drive_id", report.drive_id, limits)) return why;
  }
  // Blanks around a class's name are nobody's intention; see HazardCatalogue::HeadingOf.
  const std::string class_name = report.class_name.size() > limits.max_text_bytes
                                     ? report.class_name
                                     : protocol::Trimmed(report.class_name);
  if (auto why = WhyReportTextRefused("class name", class_name, limits)) return why;
  // Written so that NaN is refused too.
  if (!(report.confidence >= 0.0F && report.confidence <= 1.0F)) {
    return MalformedReport("confidence " + std::to_string(report.confidence) +
                           " is not within 0 to 1");
  }
  if (auto why = WhyReportPositionRefused(report, limits)) return why;
  if (auto why = WhyStampRefused(report.stamp_ns, limits, limits.max_age_s, now_ns)) return why;
  if (auto why = WhyReportBoxRefused(report, limits)) return why;
  for (const std::string* text : {&report.image_frame_id, &report.image_format}) {
    if (!text->empty() && !protocol::IsAcceptableText(*text, kMaxFrameIdBytes)) {
      return MalformedReport("frame_id or format of the picture has " +
                             std::to_string(text->size()) +
                             " bytes, accepted is printable UTF-8 of at most " +
                             std::to_string(kMaxFrameIdBytes) + " bytes");
    }
  }
  if (report.image.empty()) return std::nullopt;
  return WhyPictureRefused(report.image, limits);
}

std::string NumberText(double number) {
  constexpr double kManyDigits = 1e12;
  if (!(std::abs(number) >= kManyDigits)) return std::to_string(number);
  char text[32];
  std::snprintf(text, sizeof text, "%.6e", number);
  return text;
}

}  // namespace livemap::zone
