#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geo/geo_box.h"
#include "protocol/report.h"
#include "zone/model/hazard.h"

namespace livemap::zone {

/// Kinds of refusals, for counting. The sentence of a Refusal says more.
enum class RefusalKind {
  kMalformed,    ///< Numbers, texts, box or picture that no honest vehicle sends.
  kOutsideZone,  ///< A position that this zone does not serve.
  kTooOld,       ///< A stamp before ReportLimits::max_age_s.
  kFuture,       ///< A stamp ahead of the zone's clock.
  kReplay,       ///< The uuid of another vehicle's committed report.
  kSpeed,        ///< No vehicle gets there so fast from its last report.
  kMapFull,      ///< A new hazard beyond the maximum.
};
constexpr std::size_t kRefusalKinds = 7;
/// "malformed", "outside_zone", "too_old", "future", "replay", "speed" or "map_full".
const char* RefusalName(RefusalKind kind);

/// Why a report is refused for good: `sentence` goes into its receipt.
struct Refusal {
  RefusalKind kind = RefusalKind::kMalformed;
  std::string sentence;
};

/// What a report must keep to. A report beyond a limit is refused for good.
struct ReportLimits {
  std::optional<geo::GeoBox> zone;     ///< Positions outside it are refused; none: everywhere.
  std::size_t max_text_bytes = 64;     ///< Of class name, vehicle id and drive id each.
  double max_position_sigma_m = 50.0;  ///< Along the worst direction.
  double max_future_s = 300.0;         ///< An image stamp this far ahead of the zone's clock.
  double max_age_s = 30.0 * 86400.0;   ///< An image stamp this far behind it: outboxes wait long.
  std::int64_t min_stamp_ns = 946684800'000'000'000;  ///< 2000-01-01: older clocks were never set.
  std::uint32_t max_image_side_px = 16384;            ///< Of the original image and of the picture.
  std::int64_t max_image_pixels = 20'000'000;         ///< Of the picture: PictureLimits' too.
  std::size_t max_image_bytes = 1 << 20;              ///< Of the picture as a compressed file.
};

/// Valid UTF-8 without control characters, line separators or invisible and direction-changing
/// format characters, and neither empty nor longer than `max_bytes`.
bool IsPrintableText(const std::string& text, std::size_t max_bytes);

/// Why the zone refuses a picture, by its size and header alone.
std::optional<Refusal> WhyPictureRefused(const std::vector<std::uint8_t>& image,
                                         const ReportLimits& limits);

/// Why the zone refuses `report`; none when it is acceptable. Looks at the
/// picture's header only and decodes nothing. `now_ns` is the zone's clock.
std::optional<Refusal> WhyRefused(const protocol::Report& report, const ReportLimits& limits,
                                  std::int64_t now_ns);

/// A number for a sentence that its sender reads: std::to_string writes 1e300 in 300 digits.
std::string NumberText(double number);

}  // namespace livemap::zone
