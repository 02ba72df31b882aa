#include "nodes/catch_up_publisher.h"

#include <algorithm>
#include <utility>

#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodes {
namespace {

constexpr std::size_t kPortion = 200;
/// Pictures made for one portion: the thread that tells commits reports, too.
constexpr int kMaxMade = 2;

}  // namespace

CatchUpPublisher::CatchUpPublisher(const zone::ZoneService& zone, NoticePictures& pictures,
                                   const ros::Publisher& publisher, const Config& config)
    : zone_(zone), pictures_(pictures), publisher_(publisher), config_(config) {}

/// All that drivers are told of around the place: the nearest, and the radius that those fill.
void CatchUpPublisher::CollectAll(CatchUp& telling) const {
  zone::CatchUpOrder& order = telling.order;
  order.since = 0;
  telling.hazards = zone_.QueryNear(order.centre, config_.radius_m, config_.max_hazards);
  if (telling.hazards.size() < config_.max_hazards) return;
  telling.radius_m =
      telling.hazards.empty()
          ? 0
          : geo::GeodesicDistanceM(order.centre, telling.hazards.back().position) * (1 - 1e-6);
}

void CatchUpPublisher::Begin() {
  CatchUp telling;
  telling.order = std::move(orders_.front());
  orders_.pop_front();
  telling.radius_m = config_.radius_m;
  telling.picture_bytes = config_.picture_bytes;
  // Before the hazards: what is announced in between is told twice rather than not at all.
  telling.up_to = zone_.AnnouncedSequence();
  const zone::CatchUpOrder& order = telling.order;
  if (order.since > 0) {
    telling.hazards =
        zone_.ChangedAround(order.centre, config_.radius_m, order.since, config_.max_hazards + 1);
  }
  if (order.since == 0 || telling.hazards.size() > config_.max_hazards) CollectAll(telling);
  current_ = std::move(telling);
}

/// Publishes the next hazard; false when its picture is to be made in the next portion.
bool CatchUpPublisher::Tell(CatchUp& telling, int& made) {
  const zone::CatchUpOrder& order = telling.order;
  const zone::Hazard& hazard = telling.hazards[telling.told];
  const zone::HazardAction there =
      order.since == 0 ? zone::HazardAction::kAdded : zone::HazardAction::kUpdated;
  const zone::HazardAction action =
      zone::IsTold(hazard.state) ? there : zone::HazardAction::kRemoved;
  HazardNotice notice = ros_io::ToVehicleMessage(hazard, action, order.vehicle_id);
  const bool is_new = action != zone::HazardAction::kRemoved && telling.picture_bytes > 0;
  if (is_new && telling.picture_bytes >= pictures_.max_bytes()) {
    if (!pictures_.IsReady(hazard.image_sha256) && ++made > kMaxMade) return false;
    notice.image.data = pictures_.Get(hazard.image_sha256);
    telling.picture_bytes -= notice.image.data.size();
    if (!notice.image.data.empty()) notice.image.format = "jpeg";
  }
  publisher_.publish(notice);
  ++notices_;
  ++telling.told;
  return true;
}

std::optional<std::string> CatchUpPublisher::PublishBatch(std::int64_t now_ns) {
  if (!current_) {
    if (orders_.empty()) return std::nullopt;
    Begin();
  }
  CatchUp& telling = *current_;
  const zone::CatchUpOrder& order = telling.order;
  const std::size_t end = std::min(telling.told + kPortion, telling.hazards.size());
  int made = 0;
  while (telling.told < end && Tell(telling, made)) {
  }
  if (telling.told < telling.hazards.size()) return std::nullopt;
  protocol::Notice done;
  done.action = protocol::Notice::Action::kCaughtUp;
  done.vehicle_id = order.vehicle_id;
  done.sequence = telling.up_to;
  done.previous_sequence = order.known > telling.up_to ? order.known : order.since;
  done.position = order.centre;
  done.radius_m = telling.radius_m;
  done.told = static_cast<std::uint32_t>(telling.hazards.size());
  done.stamp_ns = now_ns;
  publisher_.publish(ros_io::ToMessage(done));
  ++notices_;
  std::string vehicle = order.vehicle_id;
  current_.reset();
  return vehicle;
}

}  // namespace livemap::nodes
