#include "ros/conversions/trail_conversions.h"

#include <string>
#include <utility>

#include "common/error.h"

namespace livemap::ros_io {

void AppendTrails(const std::vector<protocol::Trail>& trails, const geo::GeoPoint& position,
                  std::uint16_t hazard, std::vector<HazardTrail>& messages) {
  for (const protocol::Trail& trail : protocol::ValidTrails(trails, position)) {
    HazardTrail message;
    message.hazard = hazard;
    message.offsets = protocol::ToTrailOffsets(trail, position);
    messages.push_back(std::move(message));
  }
}

void TakeTrail(const HazardTrail& message, const geo::GeoPoint& position, const char* message_name,
               std::vector<protocol::Trail>& trails) {
  if (trails.size() >= protocol::kMaxTrails) {
    throw Error(std::string(message_name) + " has more than " +
                std::to_string(protocol::kMaxTrails) + " trails of one hazard");
  }
  if (geo::IsValid(position)) {
    trails.push_back(protocol::FromTrailOffsets(message.offsets, position));
  }
}

}  // namespace livemap::ros_io
