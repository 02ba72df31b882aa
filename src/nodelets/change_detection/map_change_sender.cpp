#include "nodelets/change_detection/map_change_sender.h"

#include "nodelets/nodelet_support.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/map_change_conversions.h"

namespace livemap::nodelets {
namespace {

constexpr double kChangeTickS = 0.2;
/// At most so many a tick: a full outbox must not crowd out the reports of hazards.
constexpr std::size_t kMaxChangesPerTick = 20;

}  // namespace

MapChangeSender::MapChangeSender(const Config& config, ros::NodeHandle& node, std::int64_t now_ns)
    : config_(config),
      random_(EntropySeededGenerator()),
      outbox_(config.outbox, EntropySeededGenerator(), now_ns, SteadyS()) {
  outbox_.SetZones(config_.zones);
  if (!outbox_.set_aside().empty()) {
    ROS_ERROR("the store of changes for the zone was corrupt: it is now '%s'",
              outbox_.set_aside().c_str());
  }
  publisher_ = node.advertise<MapChange>("change/map_change", 100);
  subscriber_ = node.subscribe("change/receipt", 1000, &MapChangeSender::OnReceipt, this);
  // Steady time: a replay that stands still must not keep a report from being sent again.
  timer_ = node.createSteadyTimer(ros::WallDuration(kChangeTickS), &MapChangeSender::OnTick, this);
}

void MapChangeSender::Tell(const std::vector<change::PlacedChange>& passed) {
  const MutexLock lock(mutex_);
  for (const change::PlacedChange& change : passed) {
    auto report = ros_io::ToMapChangeReport(change, config_.drive_id, Uuid::Random(random_));
    if (!report || report->confidence < config_.min_confidence) {
      ++unsure_;
      continue;
    }
    try {
      outbox_.Add(*report, SteadyS());
    } catch (const Error& error) {
      TellStoreError(error);
    }
  }
}

void MapChangeSender::OnReceipt(const ReportReceipt& message) {
  const MutexLock lock(mutex_);
  try {
    const protocol::Receipt receipt = ros_io::FromMessage(message);
    if (receipt.status == protocol::Receipt::Status::kRefused) {
      ROS_WARN_THROTTLE(kSayAgainS, "the zone refused a change: %s", receipt.reason.c_str());
    }
    outbox_.AddReceipt(receipt);
  } catch (const StoreError& error) {
    TellStoreError(error);  // It is sent again; so the zone answers again.
  } catch (const Error& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "dropped an answer of the zone: %s", error.what());
  }
}

void MapChangeSender::OnTick(const ros::SteadyTimerEvent&) {
  if (publisher_.getNumSubscribers() == 0) return;
  const MutexLock lock(mutex_);
  try {
    for (const protocol::MapChangeReport& report : outbox_.TakeDue(SteadyS(), kMaxChangesPerTick)) {
      publisher_.publish(ros_io::ToMessage(report));
    }
  } catch (const StoreError& error) {
    TellStoreError(error);  // What was due is due again after its pause.
  }
}

void MapChangeSender::TellStoreError(const Error& error) {
  ++store_errors_;
  ROS_ERROR_THROTTLE(kSayAgainS, "a change is not kept for the zone: %s", error.what());
}

void MapChangeSender::Diagnose(Diagnostics::Status& status) const {
  const MutexLock lock(mutex_);
  const vehicle::MapChangeOutbox::Counters& counters = outbox_.counters();
  status.add("changes_unsure", unsure_);
  status.add("changes_told", counters.added);
  status.add("changes_pending", outbox_.pending());
  status.add("changes_sent", counters.sent);
  status.add("changes_resent", counters.resends);
  status.add("changes_committed", counters.committed);
  status.add("changes_refused", counters.refused);
  status.add("changes_displaced", counters.displaced);
  status.add("changes_not_kept", store_errors_);
}

}  // namespace livemap::nodelets
