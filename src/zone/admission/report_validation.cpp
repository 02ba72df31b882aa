#include "zone/admission/report_validation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "imaging/image_header.h"

namespace livemap::zone {
namespace {

using Why = std::optional<Refusal>;

Refusal Malformed(std::string sentence) { return {RefusalKind::kMalformed, std::move(sentence)}; }

/// Decodes the code point at the front of `text` and removes it; none for invalid UTF-8 (RFC 3629:
/// overlong forms, surrogates, above U+10FFFF).
std::optional<std::uint32_t> TakeCodePoint(std::string_view& text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) {
    text.remove_prefix(1);
    return lead;
  }
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return std::nullopt;
  std::uint32_t code_point = lead & (0x7fU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return std::nullopt;
    code_point = code_point << 6 | (byte(i) & 0x3fU);
  }
  constexpr std::array<std::uint32_t, 5> kMinOfLength{0, 0, 0x80, 0x800, 0x10000};
  if (code_point < kMinOfLength[length] || code_point > 0x10ffff) return std::nullopt;
  if (code_point >= 0xd800 && code_point <= 0xdfff) return std::nullopt;
  text.remove_prefix(length);
  return code_point;
}

bool IsPrintable(std::uint32_t code_point) {
  struct Range {
    std::uint32_t first;
    std::uint32_t last;
  };
  // C0, DEL and C1; soft hyphen; zero width and direction marks; separators and embeddings;
  // invisible operators and isolates; byte order mark; interlinear annotation; tags; noncharacters.
  constexpr std::array<Range, 11> kHidden{{{0x00, 0x1f},
                                           {0x7f, 0x9f},
                                           {0xad, 0xad},
                                           {0x61c, 0x61c},
                                           {0x200b, 0x200f},
                                           {0x2028, 0x202e},
                                           {0x2060, 0x206f},
                                           {0xfeff, 0xfeff},
                                           {0xfff9, 0xfffb},
                                           {0xfffe, 0xffff},
                                           {0xe0000, 0xe0fff}}};
  return std::none_of(kHidden.begin(), kHidden.end(), [code_point](const Range& range) {
    return code_point >= range.first && code_point <= range.last;
  });
}

Why WhyTextRefused(const char* name, const std::string& text, const ReportLimits& limits) {
  if (IsPrintableText(text, limits.max_text_bytes)) return std::nullopt;
  return Malformed(std::string(name) + " of " + std::to_string(text.size()) +
                   " bytes is not accepted: it must be printable UTF-8 of 1 to " +
                   std::to_string(limits.max_text_bytes) + " bytes");
}

std::string ToText(const geo::GeoPoint& point) {
  return "(" + NumberText(point.latitude_deg) + ", " + NumberText(point.longitude_deg) + ")";
}

Why WhyPositionRefused(const protocol::Report& report, const ReportLimits& limits) {
  if (!geo::IsValid(report.position)) {
    return Malformed("position " + ToText(report.position) +
                     " is no latitude and longitude in degrees");
  }
  if (limits.zone && !limits.zone->Contains(report.position)) {
    return Refusal{RefusalKind::kOutsideZone,
                   "position " + ToText(report.position) + " lies outside the zone"};
  }
  const Eigen::Matrix2d& covariance = report.covariance_m2;
  if (!covariance.allFinite()) return Malformed("covariance is not finite");
  // Compared with the largest entry, so that the unit does not matter; half a part per million is
  // what single precision on the way leaves.
  const double asymmetry = std::abs(covariance(0, 1) - covariance(1, 0));
  if (asymmetry > 1e-6 * covariance.cwiseAbs().maxCoeff())
    return Malformed("covariance is not symmetric");
  const double largest = limits.max_position_sigma_m * limits.max_position_sigma_m;
  if (covariance.cwiseAbs().maxCoeff() > largest) {
    return Malformed("covariance exceeds " + std::to_string(largest) + " m^2");
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues().minCoeff() > 0))
    return Malformed("covariance is not positive definite");
  return std::nullopt;
}

Why WhyStampRefused(const protocol::Report& report, const ReportLimits& limits,
                    std::int64_t now_ns) {
  if (report.stamp_ns < limits.min_stamp_ns) {
    return Refusal{RefusalKind::kTooOld, "stamp " + std::to_string(report.stamp_ns) +
                                             " ns lies before " +
                                             std::to_string(limits.min_stamp_ns) + " ns"};
  }
  // A difference of two arbitrary 64-bit stamps could overflow; of two non-negative ones it cannot.
  const double ahead_s =
      static_cast<double>(report.stamp_ns - std::max<std::int64_t>(now_ns, 0)) * 1e-9;
  if (ahead_s > limits.max_future_s) {
    return Refusal{RefusalKind::kFuture,
                   "stamp lies " + std::to_string(ahead_s) + " s in the future, at most " +
                       std::to_string(limits.max_future_s) + " s are accepted"};
  }
  if (-ahead_s > limits.max_age_s) {
    return Refusal{RefusalKind::kTooOld, "stamp lies " + std::to_string(-ahead_s) +
                                             " s in the past, at most " +
                                             std::to_string(limits.max_age_s) + " s are accepted"};
  }
  return std::nullopt;
}

Why WhyBoxRefused(const protocol::Report& report, const ReportLimits& limits) {
  const std::uint32_t side = limits.max_image_side_px;
  if (report.image_width == 0 || report.image_height == 0 || report.image_width > side ||
      report.image_height > side) {
    return Malformed("image size " + std::to_string(report.image_width) + " x " +
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
  if (!inside) return Malformed("box is empty or not inside the image");
  const imaging::PixelRegion& shown = report.shown;
  const bool shows_part = shown.width > 0 && shown.height > 0 && shown.x < report.image_width &&
                          shown.y < report.image_height &&
                          shown.width <= report.image_width - shown.x &&
                          shown.height <= report.image_height - shown.y;
  if (shows_part || (shown.IsWholeImage() && shown.x == 0 && shown.y == 0)) return std::nullopt;
  return Malformed("picture shows a region that is empty or not inside the image");
}

}  // namespace

bool IsPrintableText(const std::string& text, std::size_t max_bytes) {
  if (text.empty() || text.size() > max_bytes) return false;
  std::string_view rest = text;
  while (!rest.empty()) {
    const auto code_point = TakeCodePoint(rest);
    if (!code_point || !IsPrintable(*code_point)) return false;
  }
  return true;
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
  }
  return "unknown";
}

std::optional<Refusal> WhyPictureRefused(const std::vector<std::uint8_t>& image,
                                         const ReportLimits& limits) {
  if (image.size() > limits.max_image_bytes) {
    return Malformed("picture has " + std::to_string(image.size()) + " bytes, at most " +
                     std::to_string(limits.max_image_bytes) + " are accepted");
  }
  const auto header = imaging::ReadImageHeader(image.data(), image.size());
  if (!header || header->format == imaging::ImageHeader::Format::kWebp) {
    return Malformed("picture is no JPEG or PNG");
  }
  const auto longer_side = static_cast<std::uint32_t>(std::max(header->width, header->height));
  if (longer_side > limits.max_image_side_px) {
    return Malformed("picture is " + std::to_string(header->width) + " x " +
                     std::to_string(header->height) + " pixels, at most " +
                     std::to_string(limits.max_image_side_px) + " per side are accepted");
  }
  const std::int64_t pixels = static_cast<std::int64_t>(header->width) * header->height;
  if (pixels > limits.max_image_pixels) {
    return Malformed("picture has " + std::to_string(pixels) + " pixels, at most " +
                     std::to_string(limits.max_image_pixels) + " are accepted");
  }
  return std::nullopt;
}

std::optional<Refusal> WhyRefused(const protocol::Report& report, const ReportLimits& limits,
                                  std::int64_t now_ns) {
  if (report.uuid.IsNil()) return Malformed("report has no uuid");
  if (auto why = WhyTextRefused("vehicle_id", report.vehicle_id, limits)) return why;
  if (!report.drive_id.empty()) {
    if (auto why = WhyTextRefused("drive_id", report.drive_id, limits)) return why;
  }
  if (auto why = WhyTextRefused("class name", report.class_name, limits)) return why;
  // Written so that NaN is refused too.
  if (!(report.confidence >= 0.0F && report.confidence <= 1.0F)) {
    return Malformed("confidence " + std::to_string(report.confidence) + " is not within 0 to 1");
  }
  if (auto why = WhyPositionRefused(report, limits)) return why;
  if (auto why = WhyStampRefused(report, limits, now_ns)) return why;
  if (auto why = WhyBoxRefused(report, limits)) return why;
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
