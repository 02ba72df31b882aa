#include "nodes/map_change_receiver.h"

#include <livemap/ReportReceipt.h>
#include <ros/console.h>

#include <utility>

#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/map_change_conversions.h"

namespace livemap::nodes {
namespace {

constexpr double kRepeatS = 60.0;

}  // namespace

MapChangeReceiver::MapChangeReceiver(ros::NodeHandle node, zone::ZoneService& zone,
                                     zone::ZoneInbox& inbox)
    : zone_(zone), inbox_(inbox) {
  receipt_publisher_ = node.advertise<ReportReceipt>("change/receipt", 20000);
  subscriber_ = node.subscribe("change/map_change", 1000, &MapChangeReceiver::OnMapChange, this);
}

void MapChangeReceiver::OnMapChange(const MapChange& message) {
  try {
    const bool queued = inbox_.Push(ros_io::FromMessage(message));
    const MutexLock lock(mutex_);
    ++counters_.received;
    if (!queued) ++counters_.not_queued;
  } catch (const Error& error) {
    {
      const MutexLock lock(mutex_);
      ++counters_.received;
      ++counters_.malformed;
    }
    ReportReceipt receipt;
    receipt.schema_version = ReportReceipt::SCHEMA_VERSION;
    receipt.status = ReportReceipt::REFUSED;
    receipt.report_uuid = message.uuid;
    receipt.vehicle_id = message.vehicle_id;
    receipt.reason = error.what();
    receipt_publisher_.publish(receipt);
    ROS_WARN_THROTTLE(kRepeatS, "map change refused: %s", error.what());
  }
}

void MapChangeReceiver::Commit(const std::vector<protocol::MapChangeReport>& reports) {
  for (const protocol::Receipt& receipt : zone_.HandleMapChanges(reports)) {
    if (receipt.status == protocol::Receipt::Status::kRefused) {
      ROS_WARN_THROTTLE(kRepeatS, "map change of '%.64s' refused: %s", receipt.vehicle_id.c_str(),
                        receipt.reason.c_str());
    }
    receipt_publisher_.publish(ros_io::ToMessage(receipt));
  }
}

MapChangeReceiver::Counters MapChangeReceiver::counters() const {
  const MutexLock lock(mutex_);
  return counters_;
}

}  // namespace livemap::nodes
