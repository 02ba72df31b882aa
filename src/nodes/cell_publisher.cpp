#include "nodes/cell_publisher.h"

#include <algorithm>
#include <utility>

#include "ros/conversions/cell_conversions.h"

namespace livemap::nodes {
namespace {

/// Of one portion, at least one request.
constexpr std::size_t kHazardsOfPortion = 2000;
constexpr std::size_t kRequestsOfPortion = 200;
/// Of one message, if not those of one cell are more: the receiver takes 1024 elements.
constexpr std::size_t kHazardsOfMessage = 500;
/// That wait for one vehicle; it asks again about others.
constexpr std::size_t kMaxWaitingCells = 2 * protocol::kMaxRequestedCells;

}  // namespace

CellPublisher::CellPublisher(const zone::ZoneService& zone, const zone::CellLog& log,
                             const ros::Publisher& publisher)
    : zone_(zone), log_(log), publisher_(publisher) {}

void CellPublisher::Add(protocol::CellRequest request) {
  const auto waiting = requests_.find(request.vehicle_id);
  if (waiting == requests_.end()) {
    waiting_.push_back(request.vehicle_id);
    requests_.emplace(request.vehicle_id, std::move(request));
    return;
  }
  std::vector<protocol::CellRequest::Cell>& cells = waiting->second.cells;
  for (const protocol::CellRequest::Cell& asked : request.cells) {
    const auto same = std::find_if(cells.begin(), cells.end(),
                                   [&asked](const auto& cell) { return cell.cell == asked.cell; });
    if (same != cells.end()) {
      *same = asked;
    } else if (cells.size() < kMaxWaitingCells) {
      cells.push_back(asked);
    }
  }
}

void CellPublisher::Invite(const std::string& vehicle_id) const {
  protocol::CellNews invitation;
  invitation.vehicle_id = vehicle_id;
  publisher_.publish(ros_io::ToMessage(invitation));
}

/// What the vehicle lacks of a cell. A hazard may have changed since the log was read: then its
/// announcement comes, too, and the vehicle hears of it twice.
protocol::CellNews::Cell CellPublisher::Read(const protocol::CellRequest::Cell& asked) const {
  const zone::CellLog::News news =
      log_.Since(asked.cell, asked.sequence, protocol::kMaxHazardsOfCell);
  protocol::CellNews::Cell cell{asked.cell, asked.sequence, news.sequence, {}};
  if (news.is_whole && asked.sequence <= news.sequence) cell.since = 0;
  for (const auto& [uuid, sequence] : news.gone) {
    protocol::CellNews::Hazard removed;
    removed.hazard_uuid = uuid;
    removed.sequence = sequence;
    removed.removed = true;
    cell.hazards.push_back(std::move(removed));
  }
  for (const Uuid& uuid : news.there) {
    const auto known = zone_.Find(uuid);
    // One that has crossed an edge since is told as having left.
    if (!known || !zone::IsTold(known->state)) continue;
    if (geo::MapCell::At(known->position) != asked.cell) continue;
    protocol::CellNews::Hazard hazard;
    hazard.hazard_uuid = uuid;
    hazard.sequence = known->announced_sequence;
    hazard.class_name = known->class_name;
    hazard.confidence = known->confidence;
    hazard.position = known->position;
    hazard.stamp_ns = known->updated_ns;
    hazard.course_rad = known->course_rad;
    hazard.trails = known->trails;
    cell.hazards.push_back(std::move(hazard));
  }
  return cell;
}

/// Returns how many hazards it told.
std::size_t CellPublisher::Answer(const protocol::CellRequest& request) {
  std::size_t all = 0;
  std::size_t in_message = 0;
  protocol::CellNews news;
  news.vehicle_id = request.vehicle_id;
  const auto publish = [&] {
    if (news.cells.empty()) return;
    publisher_.publish(ros_io::ToMessage(news));
    news.cells.clear();
    in_message = 0;
  };
  for (const protocol::CellRequest::Cell& asked : request.cells) {
    protocol::CellNews::Cell cell = Read(asked);
    const std::size_t hazards = cell.hazards.size();
    const bool is_full = in_message + hazards > kHazardsOfMessage ||
                         news.cells.size() >= protocol::kMaxRequestedCells;
    if (is_full) publish();
    in_message += hazards;
    all += hazards;
    news.cells.push_back(std::move(cell));
  }
  publish();
  cells_ += request.cells.size();
  hazards_ += all;
  return all;
}

void CellPublisher::PublishBatch() {
  std::size_t hazards = 0;
  for (std::size_t i = 0; i < kRequestsOfPortion && !waiting_.empty(); ++i) {
    const auto request = requests_.find(waiting_.front());
    hazards += Answer(request->second);
    requests_.erase(request);
    waiting_.pop_front();
    if (hazards >= kHazardsOfPortion) return;
  }
}

}  // namespace livemap::nodes
