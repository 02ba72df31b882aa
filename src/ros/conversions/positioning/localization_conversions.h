#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/NavSatFix.h>

#include <cstdint>
#include <optional>
#include <string>

#include "geo/wgs84.h"
#include "localization/localizer_feed.h"
#include "vehicle/positioning/fix_track.h"

namespace livemap::ros_io {

/// `previous_ns` is the stamp of the odometry before: with it the covariance of the step is that of
/// the twist times the square of the time between them; without, or where the twist has none, the
/// localizer's own model counts. A twist that says that it is unknown (a variance of 1e5 or more,
/// as edge_vo has it while it is lost) makes the sample a lost one.
localization::OdometrySample ToOdometrySample(const nav_msgs::Odometry& message,
                                              std::optional<std::int64_t> previous_ns);

/// The fused position of base_link; its height is not known: NaN, with a variance of 1e6 m^2.
sensor_msgs::NavSatFix ToFusedFix(const localization::FusedPose& fused,
                                  const std::string& base_frame, std::int64_t stamp_ns);

/// Pose of base_link in the map: the odometry's with x, y and yaw as fused, roll, pitch and height
/// as the odometry has them. The twist is the odometry's.
nav_msgs::Odometry ToFusedOdometry(const localization::FusedPose& fused,
                                   const Eigen::Isometry3d& map_from_odom,
                                   const localization::OdometrySample& sample,
                                   const nav_msgs::Odometry& odometry,
                                   const std::string& map_frame);

/// Where base_link was and which way it looked, of such a message, for those who place hazards.
geo::TrackPose ToTrackPose(const nav_msgs::Odometry& message, const geo::LocalFrame& map);

/// "uninitialised", "ok" or "dead reckoning".
const char* LocalizerStateName(localization::LocalizerState state);
/// Why a fix was not used, as the end of a sentence; nothing when it was, or may yet be.
const char* RefusalReason(localization::GeoLocalizer::FixVerdict verdict);

/// Its counters, window and calibration, each under its own name.
void DescribeLocalizer(const localization::GeoLocalizer& localizer,
                       diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace livemap::ros_io
