#include "zone/admission/map_change_validation.h"

#include "protocol/change_class.h"

namespace livemap::zone {
namespace {

Refusal UnacceptableMapChange(std::string sentence) {
  return {RefusalKind::kMalformed, std::move(sentence)};
}

}  // namespace

protocol::Report ReportFieldsOf(const protocol::MapChangeReport& told) {
  protocol::Report report;
  report.uuid = told.uuid;
  report.vehicle_id = told.vehicle_id;
  report.drive_id = told.drive_id;
  report.stamp_ns = told.stamp_ns;
  report.class_name = told.class_name;
  report.confidence = told.confidence;
  report.position = told.position;
  report.covariance_m2 = told.covariance_m2;
  report.box = {0, 0, 1, 1};
  report.image_width = report.image_height = 1;
  return report;
}

std::string MapChangeClassNames() {
  std::string names;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    if (i > 1) names += ", ";
    names += protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i));
  }
  return names;
}

bool IsMapChangeClass(const std::string& class_name) {
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    if (class_name == protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i))) return true;
  }
  return false;
}

std::optional<Refusal> WhyMapChangeRefused(const protocol::MapChangeReport& report,
                                           const ReportLimits& limits, std::int64_t now_ns) {
  if (auto why = WhyRefused(ReportFieldsOf(report), limits, now_ns)) return why;
  if (!IsMapChangeClass(report.class_name)) {
    return UnacceptableMapChange("class name is '" + report.class_name + "', accepted is " +
                                 MapChangeClassNames());
  }
  if (report.seen < 2) {
    return UnacceptableMapChange("seen is " + std::to_string(report.seen) +
                                 ", accepted is at least 2: one image proves no change");
  }
  if (report.earlier_stamp_ns < 0 || report.earlier_stamp_ns >= report.stamp_ns) {
    return UnacceptableMapChange("earlier_stamp is " + std::to_string(report.earlier_stamp_ns) +
                                 " ns, accepted is before the stamp of " +
                                 std::to_string(report.stamp_ns) + " ns");
  }
  return std::nullopt;
}

}  // namespace livemap::zone
