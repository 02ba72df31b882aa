#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <livemap/CellRequest.h>
#include <livemap/HazardPollAnswer.h>
#include <livemap/HazardReport.h>
#include <livemap/VehiclePosition.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "nodes/catch_up_publisher.h"
#include "nodes/cell_publisher.h"
#include "nodes/map_change_receiver.h"
#include "nodes/notice_sender.h"
#include "orders/desk/order_desk.h"
#include "region/neighbours.h"
#include "ros/conversions/zone_conversions.h"
#include "ros/parameters/zone_cloudlet_parameters.h"
#include "web/server/web_server.h"
#include "zone/inbox/catch_up_planner.h"
#include "zone/inbox/cell_allowance.h"
#include "zone/inbox/zone_inbox.h"
#include "zone/registry/cell_log.h"
#include "zone/registry/map_origin.h"
#include "zone/service/erasure_desk.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// With the streets of its file, where it names one. Throws Error for a file that is refused.
ros_io::ZoneCloudletConfig WithStreets(ros_io::ZoneCloudletConfig config);

/// The zone cloudlet as a ROS node. The callbacks' thread takes positions and puts reports, map
/// changes, poll answers and orders to tell single vehicles what they missed into the worker's
/// inbox, which wakes it. The worker thread commits what waits in groups, answers with receipts,
/// tells vehicles, lets time pass and asks polls; NoticeSender's thread tells everybody what is
/// announced, and the threads of OrderDesk send work orders.
class ZoneNode {
 public:
  /// Opens the store, starts the web server and subscribes. `config` has its streets already
  /// (WithStreets). Throws Error with one sentence.
  ZoneNode(ros::NodeHandle node, const ros::NodeHandle& private_node,
           ros_io::ZoneCloudletConfig config);
  /// Commits what is queued and stops.
  ~ZoneNode();
  ZoneNode(const ZoneNode&) = delete;
  ZoneNode& operator=(const ZoneNode&) = delete;

 private:
  void OnReport(const HazardReportConstPtr& message);
  void OnPosition(const VehiclePosition& message);
  void OnAnswer(const HazardPollAnswer& message);
  void OnCellRequest(const CellRequest& message);
  void OnEvent(const zone::ZoneEvent& event);
  void OnMarkerTimer(const ros::SteadyTimerEvent&);
  void OnDiagnosticsTimer(const ros::SteadyTimerEvent&);
  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  /// Makes `datum` the origin of the map frame.
  void SetMap(const geo::GeoPoint& datum) REQUIRES(mutex_);
  void FollowNeighbours();
  void SayReady() const;
  void SayCertificate(const web::CertificateState& certificate);
  void WorkUntilClosed();
  void CommitReports(const std::vector<protocol::Report>& reports);
  void CommitMapChanges(const std::vector<protocol::MapChangeReport>& reports);
  void NoteCommit();
  void NoteFailedCommit(const Error& error);
  void RecordNewReports(const zone::VehicleState& vehicle, std::uint64_t map_sequence);
  bool TellVehicles(std::deque<zone::CatchUpOrder> orders);
  bool TellCells(std::deque<protocol::CellRequest> requests);
  void RestoreCells();
  void HandleAnswers(const std::deque<protocol::PollAnswer>& answers);
  void CheckStore();
  void LetTimePass();
  template <typename Change>
  void Count(const Change& change);

  const ros_io::ZoneCloudletConfig config_;
  zone::ZoneService zone_;
  zone::ZoneInbox inbox_;  ///< What waits for the worker.

  Mutex mutex_;
  ros_io::ZoneCloudletCounters counters_ GUARDED_BY(mutex_);
  ros_io::VehiclePaths paths_ GUARDED_BY(mutex_);
  std::optional<geo::LocalFrame> map_ GUARDED_BY(mutex_);
  zone::MapOrigin origin_ GUARDED_BY(mutex_);
  zone::CatchUpPlanner catch_up_ GUARDED_BY(mutex_);
  zone::CellAllowance cell_allowance_ GUARDED_BY(mutex_);

  MapChangeReceiver map_changes_;
  NoticePictures pictures_;
  zone::CellLog cells_;
  std::unique_ptr<CatchUpPublisher> teller_;    ///< The worker's.
  std::unique_ptr<CellPublisher> cell_teller_;  ///< The worker's.
  std::int64_t advanced_ns_ = 0;                ///< The worker's: when time last passed, steady.
  std::int64_t store_checked_ns_ = 0;           ///< The worker's, steady.
  bool is_store_away_ = false;                  ///< The worker's: what the last check found.
  std::unique_ptr<NoticeSender> notices_;
  std::atomic<bool> view_changed_{true};
  ros::Publisher receipt_publisher_;
  ros::Publisher poll_publisher_;
  ros::Publisher marker_publisher_;
  tf2_ros::StaticTransformBroadcaster transform_broadcaster_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::SteadyTimer> timers_;
  diagnostic_updater::Updater updater_;
  int subscription_ = 0;
  std::unique_ptr<orders::OrderDesk> orders_;  ///< Null: the zone has no work orders.
  std::unique_ptr<zone::ErasureDesk> erasures_;
  std::unique_ptr<region::Neighbours> neighbours_;  ///< Null: no other zone is followed.
  std::unique_ptr<web::WebServer> web_;
  web::CertificateState certificate_;  ///< As it was told last; the diagnostics' timer's.
  std::thread worker_;
};

}  // namespace livemap::nodes
