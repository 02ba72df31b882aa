#pragma once

#include <cstdint>
#include <optional>

#include "protocol/offloaded_frame.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {

/// What a candidate frame must keep to.
struct OffloadLimits {
  /// Position, covariance, stamp, texts and picture, as for a report; a candidate's picture may
  /// have fewer bytes and pixels.
  ReportLimits report;
  double max_mounting_m = 20.0;       ///< Camera from base_link's origin, per axis.
  double max_course_sigma_rad = 1.0;  ///< A vehicle that knows its course less well places nothing.
};

/// Why the zone refuses `frame`; none when it is acceptable: everything is finite and in its range,
/// the picture is a whole JPEG whose header has the size that the intrinsics say. Decodes nothing.
/// `now_ns` is the zone's clock.
std::optional<Refusal> WhyOffloadRefused(const protocol::OffloadedFrame& frame,
                                         const OffloadLimits& limits, std::int64_t now_ns);

}  // namespace livemap::zone
