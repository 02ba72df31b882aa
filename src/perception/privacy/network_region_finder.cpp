#include "perception/privacy/network_region_finder.h"

#include <algorithm>
#include <cstddef>

#include "common/error.h"
#include "perception/privacy/scored_box.h"

namespace livemap::perception {
namespace {

/// Smaller people and vehicles have no face or plate that anybody knows: a face is a seventh of a
/// person, a plate a quarter of a car.
constexpr float kMinPersonPx = 48;   ///< Height.
constexpr float kMinVehiclePx = 32;  ///< Width.
/// With more than these the picture shows no street, or the network answers nonsense. It bounds the
/// time that a picture can cost.
constexpr std::size_t kMaxRoadUsers = 100;
/// Share of a person's box from its top in which the head is.
constexpr float kHeadShare = 0.45F;
constexpr float kHeadMargin = 0.2F;     ///< Around it, share of the box's width.
constexpr float kVehicleMargin = 0.1F;  ///< Around a vehicle, share of its sides.
constexpr float kSameFindIou = 0.3F;
/// The networks frame a face from brow to chin and a plate by its letters: finds are made larger by
/// this share of their sides, so that a mask covers all of them.
constexpr float kTightness = 0.2F;

/// What a plate looks like, however it stands: LPD-YuNet finds others in crops of few pixels.
constexpr float kMaxPlateShare = 0.35F;  ///< Width, share of the picture's.
constexpr float kMinPlateAspect = 0.9F;  ///< Width per height: plates of two lines stand aslant.
constexpr float kMaxPlateAspect = 7;
constexpr float kMinPlatePx = 4;         ///< Height.
constexpr float kMaxPlateBeyond = 0.1F;  ///< Share of its sides that lies beyond the picture.

bool IsLikePlate(const cv::Rect2f& box, const cv::Size& picture) {
  const float x_beyond = kMaxPlateBeyond * box.width;
  const float y_beyond = kMaxPlateBeyond * box.height;
  return box.width <= kMaxPlateShare * static_cast<float>(picture.width) &&
         box.width >= kMinPlateAspect * box.height && box.width <= kMaxPlateAspect * box.height &&
         box.height >= kMinPlatePx && box.x >= -x_beyond && box.y >= -y_beyond &&
         box.br().x <= static_cast<float>(picture.width) + x_beyond &&
         box.br().y <= static_cast<float>(picture.height) + y_beyond;
}

cv::Rect GrownCrop(const cv::Rect2f& box, float x_margin, float y_margin, const cv::Size& picture) {
  return PixelsOf(
      {box.x - x_margin, box.y - y_margin, box.width + 2 * x_margin, box.height + 2 * y_margin},
      picture);
}

/// What the crops that meet the wanted part show, in pixels of the picture.
template <typename Network>
void FindInCrops(Network& network, const cv::Mat& bgr, const std::vector<cv::Rect>& crops,
                 const cv::Rect& part, std::vector<ScoredBox>& found) {
  for (const cv::Rect& crop : crops) {
    if ((crop & part).empty()) continue;
    for (const ScoredBox& each : network.Find(bgr(crop))) {
      found.push_back({Moved(each.box, crop.tl()), each.score});
    }
  }
}

void AddPrivateRegions(const std::vector<ScoredBox>& found, float sure, const cv::Size& picture,
                       std::vector<PrivateRegion>& regions) {
  for (const ScoredBox& each : Suppressed(found, kSameFindIou)) {
    const float x = kTightness / 2 * each.box.width;
    const float y = kTightness / 2 * each.box.height;
    const cv::Rect box = GrownCrop(each.box, x, y, picture);
    if (!box.empty()) regions.push_back({box, each.score >= sure});
  }
}

}  // namespace

cv::Rect HeadCrop(const cv::Rect2f& person, const cv::Size& picture) {
  const float margin = kHeadMargin * person.width;
  return GrownCrop({person.x, person.y, person.width, kHeadShare * person.height}, margin, margin,
                   picture);
}

cv::Rect VehicleCrop(const cv::Rect2f& vehicle, const cv::Size& picture) {
  return GrownCrop(vehicle, kVehicleMargin * vehicle.width, kVehicleMargin * vehicle.height,
                   picture);
}

NetworkRegionFinder::NetworkRegionFinder(const PrivacyNetworks& networks)
    : sure_face_(networks.faces.sure),
      sure_plate_(networks.plates.sure),
      faces_(networks.faces),
      plates_(networks.plates),
      road_users_(networks.road_users) {}

std::vector<PrivateRegion> NetworkRegionFinder::Find(const cv::Mat& bgr, const cv::Rect& part) {
  if (bgr.empty() || bgr.type() != CV_8UC3) {
    throw Error("faces and plates are looked for in images of 8 bit and 3 channels only");
  }
  const RoadUsers users = road_users_.Find(bgr);
  if (users.people.size() + users.vehicles.size() > kMaxRoadUsers) {
    throw Error("the network of road users found " +
                std::to_string(users.people.size() + users.vehicles.size()) +
                " people and vehicles, accepted are at most " + std::to_string(kMaxRoadUsers));
  }
  std::vector<cv::Rect> heads;
  for (const cv::Rect2f& person : users.people) {
    if (person.height >= kMinPersonPx) heads.push_back(HeadCrop(person, bgr.size()));
  }
  std::vector<cv::Rect> vehicles;
  for (const cv::Rect2f& vehicle : users.vehicles) {
    if (vehicle.width >= kMinVehiclePx) vehicles.push_back(VehicleCrop(vehicle, bgr.size()));
  }
  std::vector<ScoredBox> faces = faces_.Find(bgr);
  FindInCrops(faces_, bgr, heads, part, faces);
  std::vector<ScoredBox> plates;
  FindInCrops(plates_, bgr, vehicles, part, plates);
  plates.erase(
      std::remove_if(plates.begin(), plates.end(),
                     [&](const ScoredBox& plate) { return !IsLikePlate(plate.box, bgr.size()); }),
      plates.end());
  std::vector<PrivateRegion> regions;
  AddPrivateRegions(faces, sure_face_, bgr.size(), regions);
  AddPrivateRegions(plates, sure_plate_, bgr.size(), regions);
  return regions;
}

}  // namespace livemap::perception
