#include "web/feeds/formats/work_zones.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace livemap::web {
namespace {

constexpr double kJoinM = 60;

/// The direction along which a zone is passed, east-north: where its devices have a course the mean
/// of these, else the longest extent.
Eigen::Vector2d AxisOf(const WorkZones::Zone& zone, const std::vector<Eigen::Vector2d>& places_m) {
  Eigen::Vector2d course = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < zone.size(); ++i) {
    mean += places_m[i] / static_cast<double>(zone.size());
    if (!std::isfinite(zone[i].course_rad)) continue;
    course += Eigen::Vector2d(std::sin(zone[i].course_rad), std::cos(zone[i].course_rad));
  }
  if (course.norm() > 0.1) return course.normalized();
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& place : places_m)
    spread += (place - mean) * (place - mean).transpose();
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvectors().col(1);
}

void SortAlongTheWay(WorkZones::Zone& zone) {
  if (zone.size() < 2) return;
  const geo::LocalFrame frame(zone.front().position);
  std::vector<Eigen::Vector2d> places_m;
  places_m.reserve(zone.size());
  for (const WorkZones::Device& device : zone) places_m.push_back(frame.ToEnu(device.position));
  const Eigen::Vector2d axis = AxisOf(zone, places_m);
  std::vector<std::pair<double, std::size_t>> order;
  order.reserve(zone.size());
  for (std::size_t i = 0; i < zone.size(); ++i) order.emplace_back(axis.dot(places_m[i]), i);
  std::sort(order.begin(), order.end());
  WorkZones::Zone sorted;
  sorted.reserve(zone.size());
  for (const auto& place : order) sorted.push_back(zone[place.second]);
  zone = std::move(sorted);
}

}  // namespace

WorkZones::WorkZones() : grid_(geo::SpatialGrid::ForRadius(kJoinM)) {}

std::uint32_t WorkZones::Intern(const std::string& text) {
  if (text.empty()) return 0;
  const auto [entry, is_new] = numbers_.emplace(text, static_cast<std::uint32_t>(names_.size()));
  if (is_new) names_.push_back(text);
  return entry->second;
}

std::size_t WorkZones::RootOf(std::size_t device) {
  while (parents_[device] != device) {
    parents_[device] = parents_[parents_[device]];
    device = parents_[device];
  }
  return device;
}

bool WorkZones::MayJoin(const Device& a, const Device& b) const {
  const bool differ_in_street = a.street != 0 && b.street != 0 && a.street != b.street;
  const bool differ_in_direction =
      a.direction != 0 && b.direction != 0 && a.direction != b.direction;
  return !differ_in_street && !differ_in_direction;
}

void WorkZones::Add(const FeedHazard& hazard) {
  if (hazard.codes.work == WorkDeviceKind::kNone) return;
  const zone::Hazard& fact = hazard.hazard;
  Device device;
  device.id = fact.uuid;
  device.position = fact.position;
  device.first_seen_ns = fact.first_seen_ns;
  device.updated_ns = fact.updated_ns;
  device.ends_ns = hazard.ends_ns;
  device.course_rad = fact.course_rad;
  device.street = Intern(hazard.words.street);
  device.direction = Intern(hazard.words.direction);
  device.near = Intern(hazard.words.near);
  device.kind = hazard.codes.work;
  const std::size_t number = devices_.size();
  devices_.push_back(device);
  parents_.push_back(number);
  for (const auto& neighbour : grid_.Within(device.position, kJoinM)) {
    const auto other = static_cast<std::size_t>(neighbour.id);
    if (!MayJoin(device, devices_[other])) continue;
    const std::size_t a = RootOf(number);
    const std::size_t b = RootOf(other);
    parents_[std::max(a, b)] = std::min(a, b);
  }
  grid_.Insert(device.position, number);
}

void WorkZones::Close() {
  const std::size_t none = devices_.size();
  next_in_zone_.assign(none, none);
  std::vector<std::size_t> last(none, none);
  for (std::size_t i = 0; i < none; ++i) {
    const std::size_t root = RootOf(i);
    if (last[root] != none) next_in_zone_[last[root]] = i;
    last[root] = i;
  }
}

WorkZones::Zone WorkZones::Next() {
  for (; next_ < devices_.size(); ++next_) {
    if (parents_[next_] != next_) continue;
    Zone zone;
    for (std::size_t i = next_; i != devices_.size(); i = next_in_zone_[i]) {
      zone.push_back(devices_[i]);
    }
    if (zone.size() == 1 && zone.front().kind == WorkDeviceKind::kChannel) continue;
    ++next_;
    SortAlongTheWay(zone);
    return zone;
  }
  return {};
}

}  // namespace livemap::web
