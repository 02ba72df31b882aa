#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "hazard/report.h"
#include "zone/hazard.h"

namespace livemap {

/// What a report must keep to. A report beyond a limit is refused for good.
struct ReportLimits {
  std::optional<GeoBox> zone;          ///< Positions outside it are refused; none: everywhere.
  std::size_t max_text_bytes = 64;     ///< Of class name, vehicle id and drive id each.
  double max_position_sigma_m = 50.0;  ///< Along the worst direction.
  double max_future_s = 300.0;         ///< An image stamp this far ahead of the zone's clock.
  std::int64_t min_stamp_ns = 946684800'000'000'000;  ///< 2000-01-01: older clocks were never set.
  std::uint32_t max_image_side_px = 16384;            ///< Of the original image and of the picture.
  std::size_t max_image_bytes = 1 << 20;              ///< Of the picture as a compressed file.
};

/// Valid UTF-8 without control characters, line separators or invisible and direction-changing
/// format characters, and neither empty nor longer than `max_bytes`.
bool IsPrintableText(const std::string& text, std::size_t max_bytes);

/// Why the zone refuses `report`, as one sentence; none when it is acceptable. Looks at the
/// picture's header only and decodes nothing. `now_ns` is the zone's clock.
std::optional<std::string> WhyRefused(const Report& report, const ReportLimits& limits,
                                      std::int64_t now_ns);

}  // namespace livemap
