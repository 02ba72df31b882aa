#include "nodes/zone_failover.h"

#include <std_msgs/Bool.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <optional>

#include "common/clock.h"
#include "nodes/json_log.h"

namespace livemap::nodes {
namespace {

/// Between two looks of the standby at the lease, and after a renewal that failed.
constexpr double kLookS = 0.2;
constexpr double kSayLeaseAgainS = 60.0;

/// For people: which machine and which of its processes.
std::string NameOfThisProcess() {
  std::array<char, 100> host{};
  if (gethostname(host.data(), host.size() - 1) != 0 || host[0] == '\0') host = {"unknown"};
  return std::string(host.data()) + ":" + std::to_string(getpid());
}

}  // namespace

ZoneFailover::ZoneFailover(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
                           const ros_io::ZoneCloudletConfig& config)
    : config_(config),
      node_(node),
      private_node_(private_node),
      lease_(std::make_shared<zone::ZoneLease>(
          zone::ZoneLease::Config{config.zone.store_url, NameOfThisProcess(), config.lease_s})) {
  publisher_ = node_.advertise<std_msgs::Bool>("zone/active", 1, /*latch=*/true);
  Publish();
}

ZoneFailover::~ZoneFailover() {
  is_serving_ = false;
  {
    const MutexLock lock(mutex_);
    is_closing_ = true;
  }
  closing_.NotifyOne();
  if (!keeper_.joinable()) return;
  keeper_.join();
  Publish();
  lease_->GiveBack();
}

bool ZoneFailover::AwaitLease() {
  if (!TryTake(nullptr)) {
    ROS_INFO("standby: the zone's active process is '%s'", active_.holder.c_str());
    std::optional<web::StandbyServer> web;
    if (config_.web) web.emplace(config_.web_options);
    diagnostic_updater::Updater updater(node_, private_node_);
    updater.setHardwareID("zone_cloudlet");
    updater.add("zone", [this](auto& status) { Describe(status); });
    double said_s = -config_.diagnostics_period_s;
    while (!TryTake(web ? &*web : nullptr)) {
      if (!ros::ok()) return false;
      const double now_s = static_cast<double>(SteadyNs()) / 1e9;
      if (now_s - said_s >= config_.diagnostics_period_s) {
        said_s = now_s;
        updater.force_update();
        Publish();
      }
      ros::spinOnce();
      ros::WallDuration(kLookS).sleep();
    }
  }
  keeper_ = std::thread([this] { Keep(); });
  ROS_INFO("active: took the zone's lease of epoch %llu from '%s'",
           static_cast<unsigned long long>(lease_->epoch()), active_.holder.c_str());
  return ros::ok();
}

bool ZoneFailover::TryTake(web::StandbyServer* web) {
  try {
    active_ = lease_->Read();
    const bool is_taken = active_.valid_s <= 0 && lease_->TryTake();
    error_.clear();
    if (web != nullptr) web->Tell(active_.epoch);
    return is_taken;
  } catch (const Error& error) {
    error_ = error.what();
    ROS_WARN_THROTTLE(kSayLeaseAgainS, "standby: %s", error.what());
    return false;
  }
}

void ZoneFailover::SayActive() {
  is_serving_ = true;
  Publish();
}

void ZoneFailover::Keep() {
  MutexLock lock(mutex_);
  double pause_s = config_.lease_renew_s;
  for (;;) {
    const auto end = SteadyDeadline(pause_s);
    while (!is_closing_ && std::chrono::steady_clock::now() < end) {
      closing_.WaitUntil(mutex_, end);
    }
    if (is_closing_) return;
    lock.Unlock();
    try {
      Renew();
      pause_s = config_.lease_renew_s;
    } catch (const Error& error) {
      ROS_WARN_THROTTLE(kSayLeaseAgainS, "%s", error.what());
      pause_s = kLookS;
    }
    Publish();
    lock.Lock();
  }
}

void ZoneFailover::Renew() {
  if (lease_->Renew()) return;
  LogTheEnd("zone_cloudlet",
            "the zone's lease of epoch " + std::to_string(lease_->epoch()) +
                " was not renewed in time and another process has it: this one ends, and waits as "
                "the standby once it is started again");
  // No destructor may publish, or write, what is no longer true.
  std::_Exit(1);
}

void ZoneFailover::Publish() const {
  std_msgs::Bool message;
  message.data = is_serving_ && lease_->IsHeld() ? 1 : 0;
  publisher_.publish(message);
}

void ZoneFailover::Describe(diagnostic_updater::DiagnosticStatusWrapper& status) const {
  using diagnostic_msgs::DiagnosticStatus;
  if (error_.empty()) {
    status.summary(DiagnosticStatus::OK, "standby");
  } else {
    status.summary(DiagnosticStatus::ERROR, error_);
  }
  status.add("zone_active", false);
  status.add("lease_holder", active_.holder);
  status.add("lease_epoch", active_.epoch);
  status.add("lease_valid_s", active_.valid_s);
}

}  // namespace livemap::nodes
