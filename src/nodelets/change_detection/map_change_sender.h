#pragma once

#include <livemap/ReportReceipt.h>
#include <ros/ros.h>

#include <random>
#include <string>
#include <vector>

#include "change/objects/change_detector.h"
#include "common/mutex.h"
#include "nodelets/diagnostics.h"
#include "vehicle/outbox/map_change_outbox.h"

namespace livemap::nodelets {

/// MapChangeOutbox with topics and clocks: sends change/map_change, hears change/receipt.
class MapChangeSender {
 public:
  struct Config {
    std::string drive_id;
    double min_confidence = 0.5;  ///< Less sure objects are not told.
    vehicle::ZoneFinder zones;
    vehicle::MapChangeOutbox::Config outbox;
  };

  /// Throws StoreError.
  MapChangeSender(const Config& config, ros::NodeHandle& node, std::int64_t now_ns);

  /// What the zone is to know of objects that the vehicle has passed. Any thread.
  void Tell(const std::vector<change::PlacedChange>& passed);
  void Diagnose(Diagnostics::Status& status) const;

 private:
  void OnReceipt(const ReportReceipt& message);
  void OnTick(const ros::SteadyTimerEvent&);
  void TellStoreError(const Error& error) REQUIRES(mutex_);

  Config config_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  ros::SteadyTimer timer_;
  mutable Mutex mutex_;
  std::mt19937_64 random_ GUARDED_BY(mutex_);
  vehicle::MapChangeOutbox outbox_ GUARDED_BY(mutex_);
  std::uint64_t unsure_ GUARDED_BY(mutex_) = 0;
  std::uint64_t store_errors_ GUARDED_BY(mutex_) = 0;
};

}  // namespace livemap::nodelets
