#include "ros/views/hazard_view.h"

#include <cmath>

#include "ros/views/class_colour.h"

namespace livemap::ros_io {
namespace {

constexpr double kDiameterM = 1.2;
constexpr double kHeightM = 0.4;
constexpr double kTextM = 1.2;
constexpr float kOwnAlpha = 0.7F;

const char* LinkNameInView(vehicle::LinkCost link) {
  switch (link) {
    case vehicle::LinkCost::kCheap:
      return "cheap";
    case vehicle::LinkCost::kMetered:
      return "metered";
    case vehicle::LinkCost::kNone:
      return "none";
    case vehicle::LinkCost::kUnknown:
      break;
  }
  return "unknown";
}

}  // namespace

visualization_msgs::MarkerArray HazardMarkers(const std::vector<vehicle::KnownHazard>& hazards,
                                              const protocol::HazardCatalogue& catalogue,
                                              const geo::LocalFrame& map,
                                              const std::string& map_frame,
                                              const ros::Time& stamp) {
  visualization_msgs::MarkerArray array;
  visualization_msgs::Marker marker;
  marker.header.frame_id = map_frame;
  marker.header.stamp = stamp;
  marker.action = visualization_msgs::Marker::DELETEALL;
  array.markers.push_back(marker);
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1;
  for (const vehicle::KnownHazard& hazard : hazards) {
    const protocol::HazardClass entry = catalogue.Get(hazard.class_name);
    const Eigen::Vector2d place_m = map.ToEnu(hazard.position);
    ++marker.id;
    marker.ns = "hazards";
    marker.type = visualization_msgs::Marker::CYLINDER;
    marker.pose.position.x = place_m.x();
    marker.pose.position.y = place_m.y();
    marker.pose.position.z = kHeightM / 2;
    marker.scale.x = marker.scale.y = kDiameterM;
    marker.scale.z = kHeightM;
    marker.color = ClassColour(entry, hazard.of_zone ? 1.0F : kOwnAlpha);
    marker.text.clear();
    array.markers.push_back(marker);
    marker.ns = "labels";
    marker.type = visualization_msgs::Marker::TEXT_VIEW_FACING;
    marker.pose.position.z = kHeightM + kTextM;
    marker.scale.z = kTextM;
    marker.color.r = marker.color.g = marker.color.b = marker.color.a = 1.0F;
    marker.text = entry.label;
    array.markers.push_back(marker);
  }
  return array;
}

geometry_msgs::PoseStamped VehiclePose(const Eigen::Vector2d& east_north_m, double course_rad,
                                       const std::string& map_frame, const ros::Time& stamp) {
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = map_frame;
  pose.header.stamp = stamp;
  pose.pose.position.x = east_north_m.x();
  pose.pose.position.y = east_north_m.y();
  // Yaw counts counterclockwise from east.
  const double yaw_rad = M_PI / 2 - course_rad;
  pose.pose.orientation.z = std::sin(yaw_rad / 2);
  pose.pose.orientation.w = std::cos(yaw_rad / 2);
  return pose;
}

bool IsFusionSilent(const vehicle::HazardReporter& reporter) {
  constexpr std::int64_t kSilentNs = 2'000'000'000;
  if (reporter.config().position_source != vehicle::PositionSource::kFused) return false;
  const auto newest_fix_ns = reporter.track().newest_ns();
  const auto newest_pose_ns = reporter.poses().newest_ns();
  return newest_fix_ns && (!newest_pose_ns || *newest_fix_ns - *newest_pose_ns > kSilentNs);
}

void DescribeHazardReporter(const vehicle::HazardReporter& reporter, double steady_s,
                            diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  const vehicle::HazardReporter::Counters& counters = reporter.counters();
  if (!reporter.store_error().empty()) {
    status.summary(DiagnosticStatus::ERROR, reporter.store_error());
  } else if (!reporter.map().set_aside().empty()) {
    status.summary(DiagnosticStatus::WARN,
                   "started anew after a corrupt store: " + reporter.map().set_aside());
  } else if (reporter.map().broken_rows().count() > 0) {
    status.summary(DiagnosticStatus::WARN, "the store holds rows of impossible values");
  } else if (!reporter.track().newest_ns()) {
    status.summary(DiagnosticStatus::WARN, "no fix yet");
  } else if (IsFusionSilent(reporter)) {
    status.summary(DiagnosticStatus::WARN, "no fused poses: hazards are placed by the fixes alone");
  } else if (!reporter.HasCamera()) {
    status.summary(DiagnosticStatus::WARN, "no camera_info or no mounting of the camera yet");
  } else {
    status.summary(DiagnosticStatus::OK, "reporting");
  }
  status.add("detections", counters.detections);
  status.add("invalid_detections", counters.invalid_detections);
  status.add("below_confidence", counters.below_confidence);
  status.add("held_back_no_fix", counters.held_back_no_fix);
  status.add("dropped_no_fix", counters.dropped_no_fix);
  status.add("dropped_no_camera", counters.dropped_no_camera);
  status.add("not_on_ground", counters.not_on_ground);
  status.add("cut_by_side", counters.cut_by_side);
  status.add("too_far", counters.too_far);
  status.add("duplicates_suppressed", counters.duplicates_suppressed);
  status.add("reports_created", counters.reports_created);
  status.add("reports_without_picture", counters.reports_without_picture);
  status.add("pictures_requested", counters.pictures_requested);
  status.add("pictures_illegible", counters.pictures_illegible);
  status.add("link", LinkNameInView(reporter.link()));
  status.add("held", reporter.HeldReports(steady_s));
  status.add("refused_map_full", counters.refused_map_full);
  status.add("reports_sent", counters.reports_sent);
  status.add("resends", counters.resends);
  status.add("committed", counters.committed);
  status.add("refused", counters.refused);
  status.add("pending", reporter.map().pending_count());
  status.add("pending_bytes", reporter.map().pending_bytes());
  status.add("salvaged", reporter.map().salvage().reports);
  status.add("broken_rows", reporter.map().broken_rows().count());
  status.add("map_sequence", reporter.map().map_sequence());
  status.add("notices_missing", reporter.map().has_gap());
  status.add("zones_known", reporter.map().zone_count());
  status.add("forgotten_unannounced", counters.forgotten_unannounced);
  status.add("redirected", counters.redirected);
  status.add("known", reporter.map().known_count());
  status.add("waiting_frames", reporter.waiting_frames());
  status.add("notices", counters.notices);
  status.add("invalid_notices", counters.invalid_notices);
  status.add("cells_heard", reporter.cells().heard());
  status.add("cells_unanswered", reporter.cells().unanswered());
  status.add("cell_requests", counters.cell_requests);
  status.add("cell_answers", counters.cell_answers);
  status.add("notices_beyond_zone", reporter.map().beyond_zone());
  status.add("fixes", counters.fixes);
  status.add("invalid_fixes", counters.invalid_fixes);
  status.add("no_fixes", counters.no_fixes);
  status.add("jumps", counters.jumps);
  status.add("fixes_bad_stamp", counters.fixes_bad_stamp);
  status.add("store_errors", counters.store_errors);
  status.add("poses", counters.poses);
  status.add("invalid_poses", counters.invalid_poses);
  status.add("placed_by_fusion", counters.placed_by_fusion);
  status.add("placed_by_fixes", counters.placed_by_fixes);
  status.add("distances_by_depth", counters.distances_by_depth);
  status.add("sights_used", counters.sights_used);
  status.add("settling_reports", reporter.settling_reports());
}

void DescribePollResponder(const vehicle::PollResponder& responder,
                           diagnostic_updater::DiagnosticStatusWrapper& status) {
  const vehicle::PollResponder::Counters& counters = responder.counters();
  status.add("polls", counters.polls);
  status.add("polls_open", responder.open());
  status.add("polls_repeated", counters.repeated);
  status.add("polls_not_taken", counters.not_taken);
  status.add("polls_yes", counters.yes);
  status.add("polls_no", counters.no);
  status.add("polls_no_by_change", counters.no_by_change);
  status.add("polls_cant_see", counters.cant_see);
  status.add("polls_disagreed", counters.disagreed);
  status.add("polls_unanswered", counters.unanswered);
  status.add("poll_pictures", counters.pictures);
  status.add("poll_picture_bytes", counters.picture_bytes);
}

std::string DescribeBrokenRows(const std::string& path, const vehicle::LocalHazardMap& map) {
  const vehicle::InvalidRows& broken = map.broken_rows();
  return "the local hazard map '" + path +
         "' holds values that this program did not write: " + std::to_string(broken.known) +
         " rows of what the zone told are taken out, " + std::to_string(broken.reports) +
         " unfinished reports are left there and not sent";
}

std::string DescribeSetAside(const std::string& path, const vehicle::LocalHazardMap& map) {
  const vehicle::Salvage& salvage = map.salvage();
  std::string sentence = "the local hazard map '" + path + "' was corrupt: moved to '" +
                         map.set_aside() + "', starting anew with ";
  if (!salvage.error.empty()) return sentence + "none of its reports (" + salvage.error + ")";
  sentence += std::to_string(salvage.reports) + " of its unfinished reports";
  if (salvage.unreadable > 0) {
    sentence += ", " + std::to_string(salvage.unreadable) + " more are not readable";
  }
  return sentence;
}

}  // namespace livemap::ros_io
