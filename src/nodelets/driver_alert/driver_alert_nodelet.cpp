#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <livemap/HazardAlert.h>
#include <livemap/HazardNotice.h>
#include <nav_msgs/Odometry.h>
#include <ros/package.h>
#include <sensor_msgs/NavSatFix.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

#include "common/sqlite.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/stamp_checks.h"
#include "nodelets/vehicle_tf.h"
#include "ros/conversions/alert_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/parameters/driver_alert_parameters.h"
#include "streets/street_file.h"
#include "streets/street_map.h"
#include "vehicle/alerts/announced_hazards.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::nodelets {

/// Tells the driver what lies on the vehicle's own way: DriverAlerts with topics and clocks. What
/// the zone has announced comes by its notices, and by the local map that hazard_reporting keeps.
/// All callbacks run one at a time, in the nodelet's own queue.
class DriverAlertPart : public NodeletPart {
 public:
  ~DriverAlertPart() override {
    diagnostics_.reset();
    subscribers_.clear();
    map_timer_.stop();
  }

 private:
  void Initialize() override {
    using Self = DriverAlertPart;
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadDriverAlertConfig(parameters);
    if (config_.catalogue.empty()) {
      config_.catalogue = ros::package::getPath("livemap") + "/config/hazards.yaml";
    }
    const auto catalogue = protocol::HazardCatalogue::Load(config_.catalogue);
    alerts_ = std::make_unique<vehicle::DriverAlerts>(config_.alerts, catalogue, ReadStreets());
    announced_ = vehicle::AnnouncedHazards(catalogue);
    fixes_ = std::make_unique<vehicle::FixTrack>(config_.fixes);
    ros::NodeHandle& node = getNodeHandle();
    publisher_ = node.advertise<HazardAlert>("hazard/alert", 100);
    const double max_ahead_s = config_.fixes.stamps.max_ahead_s;
    stamps_ = std::make_unique<StampChecks>(getName(), max_ahead_s, [this] { StartAnew(); });
    // Notices that come from now on wait until the map has been read.
    subscribers_ = {
        node.subscribe("hazard/notice", 10000, &Self::OnNotice, this),
        node.subscribe("hazard/cell_notice", 10000, &Self::OnNotice, this),
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("gps/velocity", 100, &Self::OnVelocity, this),
    };
    if (config_.use_fused) {
      vehicle_tf_ = std::make_unique<VehicleTf>(node, getName(), config_.map_frame,
                                                config_.base_frame, max_ahead_s);
      subscribers_.push_back(node.subscribe("localization/odometry", 100, &Self::OnPose, this));
    }
    announced_.RefuseBeyond(ros_io::MakeZoneFinder(config_.zones).is_beyond);
    ReadMap();
    map_timer_ = node.createSteadyTimer(ros::WallDuration(config_.database_period_s),
                                        &Self::OnMapTimer, this);
    diagnostics_ =
        std::make_unique<Diagnostics>(getNodeHandle(), getPrivateNodeHandle(),
                                      Diagnostics::Config{getName(), "driver_alert", "driver_alert",
                                                          config_.diagnostics_period_s},
                                      [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  /// Nothing where the vehicle has no street file.
  std::shared_ptr<const streets::StreetMap> ReadStreets() {
    if (config_.streets.empty()) return nullptr;
    auto map = std::make_shared<const streets::StreetMap>(streets::ReadStreetFile(config_.streets));
    const streets::StreetMap::Counters& counters = map->counters();
    NODELET_INFO(
        "%zu streets with %zu segments in %.0f MB; left out: %zu missing nodes, %zu "
        "segments that are too long, %zu nodes beyond 85 degrees",
        map->streets(), map->segments(), static_cast<double>(map->bytes()) / 1e6,
        counters.missing_nodes, counters.long_segments, counters.off_range);
    street_segments_ = map->segments();
    return map;
  }

  void StartAnew() {
    fixes_->Reset();
    pose_steady_s_.reset();
    Tell(alerts_->StartAnew(), ros::Time::now());
  }

  void OnMapTimer(const ros::SteadyTimerEvent&) {
    stamps_->CheckClock();
    ReadMap();
  }

  void ReadMap() {
    if (config_.database.empty()) return;
    try {
      const auto stored = vehicle::ReadStoredHazards(config_.database);
      map_unreadable_ = false;
      if (stored) TakeIn(announced_.Apply(*stored), ros::Time::now());
    } catch (const Error& error) {
      map_unreadable_ = true;
      NODELET_WARN_THROTTLE(kSayAgainS, "the local hazard map '%s' cannot be read: %s",
                            config_.database.c_str(), error.what());
    }
  }

  void OnNotice(const HazardNotice& message) {
    try {
      ++notices_;
      TakeIn(announced_.Apply(ros_io::FromMessage(message)), message.stamp);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped a notice: %s", error.what());
    }
  }

  void TakeIn(const vehicle::AnnouncedHazards::Changes& changes, const ros::Time& stamp) {
    for (const vehicle::AlertHazard& hazard : changes.put) alerts_->Put(hazard);
    for (const Uuid& id : changes.gone) Tell(alerts_->Remove(id), stamp);
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    if (!stamps_->IsUsable("a fix", message.header.stamp)) return;
    const geo::Fix fix = ros_io::ToFix(message);
    using Verdict = vehicle::FixTrack::Verdict;
    const Verdict verdict = fixes_->Add(fix, RosNowNs());
    const bool counts = verdict == Verdict::kAccepted || verdict == Verdict::kRestarted;
    ++(counts ? fixes_used_ : fixes_refused_);
    if (!counts || fixes_->newest_ns() != fix.stamp_ns) return;
    const bool fused = pose_steady_s_ && SteadyS() - *pose_steady_s_ < config_.fused_wait_s;
    if (fused) return;
    if (verdict == Verdict::kRestarted) Tell(alerts_->StartAnew(), message.header.stamp);
    Tell(alerts_->Add(fix.stamp_ns, *fixes_->Newest()), message.header.stamp);
  }

  void OnVelocity(const geometry_msgs::TwistWithCovarianceStamped& message) {
    if (!stamps_->IsUsable("a receiver's velocity", message.header.stamp)) return;
    constexpr std::size_t kYY = 7;
    const auto& covariance = message.twist.covariance;
    const double variance = std::max({0.0, covariance[0], covariance[kYY]});
    const auto& linear = message.twist.twist.linear;
    alerts_->AddVelocity(ros_io::FromRosTime(message.header.stamp),
                         {{linear.x, linear.y}, std::sqrt(variance)});
  }

  void OnPose(const nav_msgs::Odometry& message) {
    const std::optional<geo::TrackPose> pose = vehicle_tf_->FusedPose(message);
    if (!pose || !stamps_->IsUsable("a fused pose", message.header.stamp)) return;
    pose_steady_s_ = SteadyS();
    Tell(alerts_->Add(ros_io::FromRosTime(message.header.stamp), *pose, true),
         message.header.stamp);
  }

  void Tell(const std::vector<vehicle::HazardAlert>& alerts, const ros::Time& stamp) {
    for (const vehicle::HazardAlert& alert : alerts) {
      publisher_.publish(ros_io::ToMessage(alert, stamp));
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const vehicle::DriverAlerts::Counters& counters = alerts_->counters();
    const std::uint64_t positions = counters.positions;
    if (map_unreadable_) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "the local map cannot be read");
    } else if (refused_.HasRisen(counters.refused_full)) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                     "too many hazards: some are left out");
    } else if (!moved_.HasRisen(positions)) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no positions");
    } else if (!alerts_->course().known()) {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "waits for a course");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    status.add("hazards", alerts_->size());
    status.add("hazards_invalid", counters.invalid_hazards);
    status.add("hazards_refused", counters.refused_full);
    status.add("notices", notices_);
    status.add("notices_beyond_zone", announced_.beyond_zone());
    status.add("hazards_of_two_zones", announced_.hidden());
    status.add("fixes", fixes_used_);
    status.add("fixes_refused", fixes_refused_);
    status.add("positions", positions);
    status.add("positions_invalid", counters.invalid_positions);
    status.add("velocities", counters.velocities);
    status.add("street_segments", street_segments_);
    status.add("on_street", alerts_->on_street());
    status.add("alerts", counters.approaches);
    status.add("alerts_passed", counters.passed);
    status.add("alerts_cancelled", counters.cancelled);
    status.add("alerts_standing", alerts_->Ahead().size());
    stamps_->Diagnose(status);
  }

  ros_io::DriverAlertConfig config_;
  std::unique_ptr<vehicle::DriverAlerts> alerts_;
  std::unique_ptr<vehicle::FixTrack> fixes_;
  vehicle::AnnouncedHazards announced_;
  std::optional<double> pose_steady_s_;  // When the newest fused pose came.
  std::size_t street_segments_ = 0;
  std::uint64_t notices_ = 0;
  std::uint64_t fixes_used_ = 0;
  std::uint64_t fixes_refused_ = 0;
  bool map_unreadable_ = false;
  CounterWatch refused_, moved_;  // Of the diagnostics.
  std::unique_ptr<StampChecks> stamps_;
  std::unique_ptr<VehicleTf> vehicle_tf_;  // Only with fused poses.
  ros::Publisher publisher_;
  std::vector<ros::Subscriber> subscribers_;
  ros::SteadyTimer map_timer_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using DriverAlertNodelet = PartNodelet<DriverAlertPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::DriverAlertNodelet, nodelet::Nodelet)
