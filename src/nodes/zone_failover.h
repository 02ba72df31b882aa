#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "common/mutex.h"
#include "ros/parameters/zone_cloudlet_parameters.h"
#include "web/server/standby_server.h"
#include "zone/store/zone_lease.h"

namespace livemap::nodes {

/// Whether this process is the active one of its zone or its standby. As the standby it answers at
/// the live map's address that it is one, and tells so in its diagnostics. As the active one it
/// renews the lease from a thread of its own. In both cases it tells the bridge beside it by
/// zone/active, so that only the active one's bridge is connected to the broker.
///
/// A process whose lease another one has taken ends at once, as if it were killed: all that it
/// promised is in the database, and what it has in memory is no longer true. roslaunch starts it
/// again, as the standby.
///
/// Typical usage:
///   ZoneFailover failover(node, private_node, config);
///   if (!failover.AwaitLease()) return 0;
///   config.zone.lease = failover.lease();
///   ZoneNode zone(node, private_node, config);
///   failover.SayActive();
class ZoneFailover {
 public:
  /// Connects to the database. Throws Error with one sentence.
  ZoneFailover(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
               const ros_io::ZoneCloudletConfig& config);
  /// Gives the lease back: the zone's node has ended before.
  ~ZoneFailover();
  ZoneFailover(const ZoneFailover&) = delete;
  ZoneFailover& operator=(const ZoneFailover&) = delete;

  /// Is the standby until the lease was taken; from then on it is renewed. False when the node is
  /// told to end. Throws Error when the standby's web server cannot be started.
  bool AwaitLease();
  /// The zone's node takes reports from now on: the bridge may connect.
  void SayActive();
  std::shared_ptr<const zone::ZoneLease> lease() const { return lease_; }

 private:
  bool TryTake(web::StandbyServer* web);
  void Keep();
  void Renew();
  void Publish() const;
  void Describe(diagnostic_updater::DiagnosticStatusWrapper& status) const;

  const ros_io::ZoneCloudletConfig& config_;
  ros::NodeHandle node_;
  ros::NodeHandle private_node_;
  const std::shared_ptr<zone::ZoneLease> lease_;
  ros::Publisher publisher_;
  zone::ZoneLease::Row active_;  ///< As the standby read it last.
  std::string error_;            ///< Why it could not; empty when it could.
  std::atomic<bool> is_serving_{false};
  Mutex mutex_;
  bool is_closing_ GUARDED_BY(mutex_) = false;
  ConditionVariable closing_;
  std::thread keeper_;
};

}  // namespace livemap::nodes
