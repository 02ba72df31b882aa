#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <sensor_msgs/NavSatFix.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

#include "common/clock.h"
#include "common/mutex.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "receiver/gpsd_client.h"
#include "receiver/receiver_watch.h"
#include "ros/conversions/positioning/receiver_conversions.h"
#include "ros/parameters/positioning/gps_receiver_parameters.h"

namespace livemap::nodelets {
namespace {

constexpr double kReceiverLookPeriodS = 0.25;

}  // namespace

/// The satellite receiver of a vehicle, through gpsd: GpsdClient and ReceiverWatch with topics,
/// clocks and words. Messages go out on the client's thread as reports come; the rest runs in the
/// nodelet's own queue. The clock is the system's, never simulated time: a receiver is live.
class GpsReceiverPart : public NodeletPart {
 public:
  ~GpsReceiverPart() override {
    diagnostics_.reset();
    look_timer_.stop();
    client_.reset();
  }

 private:
  using State = receiver::ReceiverState;

  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadGpsReceiverConfig(parameters);
    config_.gpsd.reconnect_jitter_seed = static_cast<std::uint64_t>(SystemNs());
    {
      const MutexLock lock(mutex_);
      watch_ = std::make_unique<receiver::ReceiverWatch>(config_.watch);
    }
    ros::NodeHandle& node = getNodeHandle();
    fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>("fix", 10);
    velocity_publisher_ =
        node.advertise<geometry_msgs::TwistWithCovarianceStamped>("gps/velocity", 10);
    client_ = std::make_unique<receiver::GpsdClient>(config_.gpsd, Callbacks());
    look_timer_ = node.createSteadyTimer(ros::WallDuration(kReceiverLookPeriodS),
                                         &GpsReceiverPart::OnLookTimer, this);
    diagnostics_ =
        std::make_unique<Diagnostics>(node, getPrivateNodeHandle(),
                                      Diagnostics::Config{getName(), "gps_receiver", "gps_receiver",
                                                          config_.diagnostics_period_s},
                                      [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  receiver::GpsdCallbacks Callbacks() {
    receiver::GpsdCallbacks callbacks;
    callbacks.on_connection = [this](bool connected, const std::string& reason) {
      const MutexLock lock(mutex_);
      watch_->OnConnection(connected, reason, Now());
    };
    callbacks.on_devices = [this](const std::vector<receiver::GpsdDevice>& devices) {
      const MutexLock lock(mutex_);
      watch_->OnDevices(devices);
    };
    callbacks.on_satellites = [this](const std::string& device, int used, int visible) {
      const MutexLock lock(mutex_);
      watch_->OnSatellites(device, used, visible);
    };
    callbacks.on_report = [this](const receiver::ReceiverReport& report) { OnReport(report); };
    return callbacks;
  }

  static receiver::ReceiverWatch::Now Now() { return {SystemNs(), SteadyNs()}; }

  void OnReport(const receiver::ReceiverReport& report) {
    const receiver::ReceiverWatch::Now now = Now();
    receiver::ReceiverWatch::Taken taken;
    {
      const MutexLock lock(mutex_);
      taken = watch_->OnReport(report, now);
    }
    // The velocity first: who decides at a fix has it by then.
    if (taken.velocity) {
      velocity_publisher_.publish(ros_io::ToMessage(*taken.velocity, config_.frame));
    }
    if (taken.fix) fix_publisher_.publish(ros_io::ToMessage(*taken.fix, config_.frame));
    // The time of a receiver without a fix may be anything.
    if (taken.says_no_fix) {
      fix_publisher_.publish(ros_io::NoFixMessage(now.system_ns, config_.frame));
    }
  }

  /// Says every change of the state, and again while something is wrong.
  void OnLookTimer(const ros::SteadyTimerEvent&) {
    const MutexLock lock(mutex_);
    const std::int64_t now_ns = SteadyNs();
    const State state = watch_->state(now_ns);
    const bool is_new = !said_state_ || *said_state_ != state;
    const bool is_due = state != State::kFix && SteadyS() - said_s_ >= kSayAgainS;
    if (!is_new && !is_due) return;
    said_state_ = state;
    said_s_ = SteadyS();
    if (state == State::kFix) {
      NODELET_INFO("%s", watch_->Describe(now_ns).c_str());
    } else {
      NODELET_WARN("%s", watch_->Describe(now_ns).c_str());
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const MutexLock lock(mutex_);
    const std::int64_t now_ns = SteadyNs();
    const State state = watch_->state(now_ns);
    status.summary(LevelOf(state), watch_->Describe(now_ns));
    status.add("state", receiver::NameOf(state));
    status.add("gpsd", config_.gpsd.host + ":" + std::to_string(config_.gpsd.port));
    status.add("device", watch_->device());
    const receiver::ReceiverWatch::Counters& counters = watch_->counters();
    status.add("connections", counters.connections);
    status.add("reports", counters.reports);
    status.add("reports_of_others", counters.reports_of_others);
    status.add("fixes", counters.fixes);
    status.add("velocities", counters.velocities);
    status.add("reports_without_fix", counters.no_fix);
    status.add("reports_refused", counters.refused);
    status.add("velocities_refused", counters.velocities_refused);
    status.add("fixes_withheld", counters.withheld);
    status.add("fixes_repeated", counters.repeated);
    status.add("stamps_refused", counters.strays);
    status.add("jumps", counters.jumps);
    AddKnown(status, "clock_offset_s", watch_->clock_offset_s());
    std::optional<double> sigma_m;
    if (watch_->newest() && watch_->newest()->plane_sigma_m) {
      sigma_m = watch_->newest()->plane_sigma_m->maxCoeff();
    }
    AddKnown(status, "sigma_m", sigma_m);
    status.add("satellites_used", watch_->satellites_used());
    status.add("satellites_visible", watch_->satellites_visible());
  }

  /// A value that nobody knows is "unknown".
  static void AddKnown(Diagnostics::Status& status, const char* key,
                       const std::optional<double>& value) {
    if (value) {
      status.addf(key, "%.3f", *value);
    } else {
      status.add(key, "unknown");
    }
  }

  static std::uint8_t LevelOf(State state) {
    switch (state) {
      case State::kFix:
        return diagnostic_msgs::DiagnosticStatus::OK;
      case State::kNoFix:
        return diagnostic_msgs::DiagnosticStatus::WARN;
      default:
        return diagnostic_msgs::DiagnosticStatus::ERROR;
    }
  }

  ros_io::GpsReceiverConfig config_;
  ros::Publisher fix_publisher_, velocity_publisher_;
  ros::SteadyTimer look_timer_;

  Mutex mutex_;
  std::unique_ptr<receiver::ReceiverWatch> watch_ PT_GUARDED_BY(mutex_);
  std::optional<State> said_state_ GUARDED_BY(mutex_);
  double said_s_ GUARDED_BY(mutex_) = 0;  ///< Steady.

  // Last: their callbacks use the rest.
  std::unique_ptr<receiver::GpsdClient> client_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

using GpsReceiverNodelet = PartNodelet<GpsReceiverPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::GpsReceiverNodelet, nodelet::Nodelet)
