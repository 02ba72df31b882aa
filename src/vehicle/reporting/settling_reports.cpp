#include "vehicle/reporting/settling_reports.h"

#include <algorithm>
#include <string>
#include <utility>

#include "common/time.h"
#include "geo/wgs84.h"
#include "placement/road_ground_contact.h"

namespace livemap::vehicle {
namespace {

/// A hazard that the images of so long a time do not show is out of view.
constexpr double kOutOfViewS = 0.09;

/// Whether the next image will hardly show the whole box.
bool IsLeavingImage(const imaging::Box& box, double bottom_step_px, std::uint32_t height) {
  return box.y_max + 1.5 * std::max(0.0, bottom_step_px) >= height - 1.0;
}

/// The frame with this candidate alone, which need not wait again.
WaitingFrame ViewOfOne(const WaitingFrame& frame, std::size_t index, double now_s) {
  WaitingFrame view;
  view.frame = frame.frame;
  view.arrival_s = now_s;
  view.placed = true;
  view.image = frame.image;
  view.candidates = {frame.candidates[index]};
  view.candidates.front().has_settled = true;
  return view;
}

}  // namespace

bool SettlingReports::HasToWait(const PlacedSighting& candidate) const {
  return config_.wait_s > 0 && candidate.pass != 0 && !candidate.has_settled &&
         catalogue_.Get(candidate.sighting.class_name).urgency > 1;
}

/// The same hazard where it waits already.
SettlingReports::Settling* SettlingReports::Find(const PlacedSighting& candidate,
                                                 const PassSights& passes) {
  const std::string& name = candidate.sighting.class_name;
  const double radius_m = catalogue_.Get(name).duplicate_radius_m;
  const auto found =
      std::find_if(settling_.begin(), settling_.end(), [&](const Settling& settling) {
        const PlacedSighting& other = settling.hazard();
        if (other.pass == candidate.pass) return true;
        const auto place = passes.Place(other.pass);
        const geo::GeoPoint& there = place ? place->place.position : other.place.position;
        return other.sighting.class_name == name &&
               geo::GeodesicDistanceM(there, candidate.place.position) <= radius_m;
      });
  return found == settling_.end() ? nullptr : &*found;
}

/// The newest sight of a hazard is the nearest: of all pictures its own shows most.
bool SettlingReports::Add(const WaitingFrame& frame, std::size_t index, const PassSights& passes,
                          double now_s, double steady_s) {
  const PlacedSighting& candidate = frame.candidates[index];
  Settling* settling = Find(candidate, passes);
  if (settling == nullptr) {
    settling_.push_back({ViewOfOne(frame, index, now_s), 0, now_s, steady_s, false});
    return true;
  }
  const bool is_newer = frame.frame.stamp_ns > settling->view.frame.stamp_ns;
  if (settling->is_due || !is_newer || settling->hazard().pass != candidate.pass) return false;
  settling->bottom_step_px = static_cast<double>(candidate.sighting.box.y_max) -
                             static_cast<double>(settling->hazard().sighting.box.y_max);
  settling->view = ViewOfOne(frame, index, now_s);
  return false;
}

bool SettlingReports::AddPictures(std::uint64_t order,
                                  std::vector<imaging::CroppedPicture>& pictures) {
  for (Settling& settling : settling_) {
    if (settling.view.order != order) continue;
    settling.view.pictures = std::move(pictures);
    return true;
  }
  return false;
}

bool SettlingReports::IsOutOfView(const Settling& settling, std::int64_t shown_ns) {
  const placement::SightingFrame& frame = settling.view.frame;
  return IsLeavingImage(settling.hazard().sighting.box, settling.bottom_step_px,
                        frame.image_height) ||
         Seconds(shown_ns - frame.stamp_ns) >= kOutOfViewS;
}

bool SettlingReports::IsSure(const Settling& settling, const PassSights& passes) const {
  const auto place = passes.Place(settling.hazard().pass);
  return !place || placement::LargestSigmaM(place->seen_from_vehicle_m2) <= config_.sigma_m;
}

bool SettlingReports::HasWaited(Settling& settling, double now_s, double steady_s) const {
  settling.since_s = std::min(settling.since_s, now_s);  // A clock that was set back.
  return now_s - settling.since_s >= config_.wait_s ||
         steady_s - settling.since_steady_s >= 2 * config_.wait_s;
}

void SettlingReports::WorkOff(const PassSights& passes, std::int64_t shown_ns, double now_s,
                              double steady_s, const Report& report) {
  for (auto settling = settling_.begin(); settling != settling_.end();) {
    if (!settling->is_due && (HasWaited(*settling, now_s, steady_s) ||
                              IsOutOfView(*settling, shown_ns) || IsSure(*settling, passes))) {
      settling->is_due = true;
      settling->view.arrival_s = now_s;
    }
    const bool is_reported = settling->is_due && report(settling->view);
    settling = is_reported ? settling_.erase(settling) : settling + 1;
  }
}

std::vector<WaitingFrame> SettlingReports::TakeAll() {
  std::vector<WaitingFrame> views;
  for (Settling& settling : std::exchange(settling_, {})) {
    views.push_back(std::move(settling.view));
  }
  return views;
}

}  // namespace livemap::vehicle
