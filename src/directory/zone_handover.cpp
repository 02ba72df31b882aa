#include "directory/zone_handover.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::directory {
namespace {

void RequireHandoverNumber(const char* name, double value) {
  if (std::isfinite(value) && value >= 0) return;
  throw Error(std::string(name) + " of the zone handover is " + std::to_string(value) +
              ", accepted is a finite number from 0");
}

}  // namespace

ZoneHandover::ZoneHandover(const Config& config, const std::string& first)
    : config_(config), choice_(config.choice), present_(first), near_{first} {
  RequireHandoverNumber("near_m", config.near_m);
  RequireHandoverNumber("linger_s", config.linger_s);
  RequireHandoverNumber("longest_linger_s", config.longest_linger_s);
  if (config.max_zones == 0) {
    throw Error("max_zones of the zone handover is 0, accepted is 1 or more");
  }
}

bool ZoneHandover::Move(const ZoneDirectory& directory, const geo::GeoPoint& position) {
  const std::string before = present_;
  if (const auto chosen = choice_.Update(directory, position)) {
    present_ = directory.zones()[*chosen].id;
  }
  std::vector<std::pair<double, std::string>> others;
  for (const ZoneEntry& zone : directory.zones()) {
    if (zone.id == present_ || !zone.area.IsNear(position, config_.near_m)) continue;
    const double depth_m = zone.area.DepthM(position);
    if (depth_m >= -config_.near_m) others.emplace_back(-depth_m, zone.id);
  }
  std::sort(others.begin(), others.end());
  near_ = {present_};
  for (const auto& other : others) {
    if (near_.size() < config_.max_zones) near_.push_back(other.second);
  }
  return present_ != before;
}

void ZoneHandover::NoteMessage(const std::string& zone, double now_s) { messages_s_[zone] = now_s; }

std::vector<std::string> ZoneHandover::Wanted(double now_s,
                                              const std::vector<std::string>& waiting) {
  std::vector<std::pair<double, std::string>> lingering;
  for (auto message = messages_s_.begin(); message != messages_s_.end();) {
    const auto& [zone, sent_s] = *message;
    const bool waits = std::find(waiting.begin(), waiting.end(), zone) != waiting.end();
    const double silence_s = now_s - sent_s;
    if (silence_s > (waits ? config_.longest_linger_s : config_.linger_s)) {
      message = messages_s_.erase(message);
      continue;
    }
    if (std::find(near_.begin(), near_.end(), zone) == near_.end()) {
      lingering.emplace_back(silence_s, zone);
    }
    ++message;
  }
  std::sort(lingering.begin(), lingering.end());
  std::vector<std::string> wanted = near_;
  for (const auto& zone : lingering) {
    if (wanted.size() < config_.max_zones) wanted.push_back(zone.second);
  }
  return wanted;
}

}  // namespace livemap::directory
