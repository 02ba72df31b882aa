#pragma once

#include <optional>
#include <string>

#include "protocol/map_change_report.h"
#include "protocol/report.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {

/// What a map change has in common with a hazard's report. A report has a box in an image besides:
/// here one that every rule accepts.
protocol::Report ReportFieldsOf(const protocol::MapChangeReport& told);

/// The classes that a map change may have, with commas between.
std::string MapChangeClassNames();
/// One of the classes of base/change_class.h, and not "no_change".
bool IsMapChangeClass(const std::string& class_name);

/// Why the zone refuses what a vehicle tells of a change; none when it is acceptable. Texts,
/// position, covariance and stamp keep to the same limits as a hazard's report. `now_ns` is the
/// zone's clock.
std::optional<Refusal> WhyMapChangeRefused(const protocol::MapChangeReport& report,
                                           const ReportLimits& limits, std::int64_t now_ns);

}  // namespace livemap::zone
