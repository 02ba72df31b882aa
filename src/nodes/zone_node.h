#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <livemap/HazardReport.h>
#include <livemap/VehiclePosition.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_set>
#include <vector>

#include "ros/zone_conversions.h"
#include "ros/zone_parameters.h"
#include "web/server.h"
#include "zone/report_queue.h"
#include "zone/zone_service.h"

namespace livemap {

/// The zone cloudlet as a ROS node. The callbacks' thread queues reports and takes positions; one
/// worker thread commits what is queued in groups, answers with receipts and tells joining vehicles
/// what is around; events become notices from whichever thread caused them.
class ZoneNode {
 public:
  /// Opens the store, starts the web server and subscribes. Throws Error with one sentence.
  ZoneNode(ros::NodeHandle node, const ros::NodeHandle& private_node, ZoneCloudletConfig config);
  /// Commits what is queued and stops.
  ~ZoneNode();
  ZoneNode(const ZoneNode&) = delete;
  ZoneNode& operator=(const ZoneNode&) = delete;

 private:
  void OnReport(const HazardReportConstPtr& message);
  void OnPosition(const VehiclePosition& message);
  void OnEvent(const ZoneEvent& event);
  void OnMarkerTimer(const ros::SteadyTimerEvent&);
  void OnDiagnosticsTimer(const ros::SteadyTimerEvent&);
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  /// Makes `datum` the origin of the map frame; mutex_ is held or no other thread runs yet.
  void SetMap(const GeoPoint& datum);
  void WorkUntilClosed();
  void CommitBatch(const std::vector<Report>& reports);
  void NoteJoin(const VehicleState& vehicle);
  bool TellJoined();
  template <typename Change>
  void Count(const Change& change);

  const ZoneCloudletConfig config_;
  ZoneService zone_;
  ReportQueue queue_;

  std::mutex mutex_;  ///< Guards the next five.
  ZoneCloudletCounters counters_;
  VehiclePaths paths_;
  std::optional<LocalFrame> map_;
  std::map<std::string, std::int64_t> last_heard_ns_;  ///< By vehicle, steady clock.
  std::deque<GeoPoint> joined_;                        ///< Places of vehicles still to be told.

  std::deque<Uuid> to_tell_;          ///< The worker's: hazards for vehicles that joined.
  std::unordered_set<Uuid> in_line_;  ///< The same, to keep each once.
  std::atomic<bool> view_changed_{true};
  ros::Publisher receipt_publisher_;
  ros::Publisher notice_publisher_;
  ros::Publisher marker_publisher_;
  tf2_ros::StaticTransformBroadcaster transform_broadcaster_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::SteadyTimer> timers_;
  diagnostic_updater::Updater updater_;
  int subscription_ = 0;
  std::unique_ptr<WebServer> web_;
  std::thread worker_;
};

}  // namespace livemap
