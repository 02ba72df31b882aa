#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perception/privacy/face_network.h"
#include "perception/privacy/plate_network.h"
#include "perception/privacy/private_region_finder.h"
#include "perception/privacy/road_user_network.h"

namespace livemap::perception {

/// Faces and number plates by networks: people and vehicles are found in the whole picture, then
/// faces in the whole picture and in each person, and plates in each vehicle, enlarged. Not
/// thread-safe.
class NetworkRegionFinder final : public PrivateRegionFinder {
 public:
  /// Throws Error naming the file that is missing, not the manifest's or no such network.
  explicit NetworkRegionFinder(const PrivacyNetworks& networks);

  std::string Name() const override { return "networks"; }
  /// A find that reaches beyond the picture is cut to it.
  std::vector<PrivateRegion> Find(const cv::Mat& bgr, const cv::Rect& part) override;

 private:
  float sure_face_;
  float sure_plate_;
  FaceNetwork faces_;
  PlateNetwork plates_;
  RoadUserNetwork road_users_;
};

/// The part of the picture to look for the face of a person in: the upper half of the person's box
/// with a margin, px.
cv::Rect HeadCrop(const cv::Rect2f& person, const cv::Size& picture);
/// The part of the picture to look for the plate of a vehicle in: its box with a margin, px.
cv::Rect VehicleCrop(const cv::Rect2f& vehicle, const cv::Size& picture);

}  // namespace livemap::perception
