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
  kMalformed,     ///< Numbers, texts, box or picture that no honest vehicle sends.
  kOutsideZone,   ///< A position that this zone does not serve.
  kTooOld,        ///< A stamp before ReportLimits::max_age_s.
  kFuture,        ///< A stamp ahead of the zone's clock.
  kReplay,        ///< The uuid of another vehicle's committed report.
  kSpeed,         ///< No vehicle gets there so fast from its last report.
  kMapFull,       ///< A new hazard beyond the maximum.
  kUnknownClass,  ///< A class that the catalogue does not name; see UnknownClasses.
  kOneWitness,    ///< A new hazard of a vehicle on whose word alone too many rest.
};
constexpr std::size_t kRefusalKinds = 9;
/// "malformed", "outside_zone", "too_old", "future", "replay", "speed", "map_full", "unknown_class"
/// or "one_witness".
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

/// What becomes of reports of a class that the catalogue does not name.
enum class UnknownClasses {
  kOther,   ///< All are counted under one heading, protocol::kOtherClass.
  kRefuse,  ///< Refused for good.
};

/// Exactly 0, 0: what a receiver without a fix says, far out at sea. No report is from there.
bool IsPlaceOfNoFix(const geo::GeoPoint& position);

/// Why the zone refuses the stamp of an image or a fix: it lies outside the window from
/// `max_age_s` behind `now_ns`, the zone's clock, to ReportLimits::max_future_s ahead of it.
std::optional<Refusal> WhyStampRefused(std::int64_t stamp_ns, const ReportLimits& limits,
                                       double max_age_s, std::int64_t now_ns);

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
