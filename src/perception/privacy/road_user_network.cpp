#include "perception/privacy/road_user_network.h"

#include <algorithm>
#include <string>

#include "perception/detection/yolox_decoder.h"
#include "perception/privacy/network_answer.h"
#include "perception/privacy/scored_box.h"

namespace livemap::perception {
namespace {

constexpr char kRoadUserModel[] = "road_users";
constexpr std::size_t kCocoClasses = 80;
constexpr int kCocoPerson = 0;
constexpr int kCocoVehicles[] = {2, 3, 5, 7};  ///< Car, motorcycle, bus, truck.
/// No score is as high: of the other classes nothing is wanted.
constexpr float kNeverScored = 2.0F;
constexpr float kRoadUserIou = 0.6F;

bool IsCocoVehicle(int index) {
  return std::find(std::begin(kCocoVehicles), std::end(kCocoVehicles), index) !=
         std::end(kCocoVehicles);
}

}  // namespace

ModelManifest RoadUserManifest(const PrivacyNetworks::Network& network) {
  ModelManifest manifest;
  manifest.name = kRoadUserModel;
  manifest.file = network.file;
  manifest.sha256 = network.sha256;
  manifest.input = network.input;
  manifest.normalisation = network.normalisation;
  manifest.head.strides = {8, 16, 32};
  manifest.head.output = "output";
  manifest.nms_iou = kRoadUserIou;
  for (std::size_t i = 0; i < kCocoClasses; ++i) {
    const auto index = static_cast<int>(i);
    manifest.classes.push_back("coco" + std::to_string(i));
    manifest.thresholds.push_back(index == kCocoPerson || IsCocoVehicle(index) ? network.found
                                                                               : kNeverScored);
  }
  return manifest;
}

RoadUsers DecodeRoadUsers(const cv::Mat& predictions, const ModelManifest& manifest, double scale,
                          cv::Size picture) {
  RequireNumbers(predictions, manifest.AnchorCount(), static_cast<int>(5 + kCocoClasses),
                 kRoadUserModel, manifest.head.output);
  RoadUsers users;
  std::vector<ScoredBox> vehicles;
  for (const HazardDetection& each : DecodeYolox(predictions, manifest, scale, picture)) {
    if (each.class_index == kCocoPerson) {
      users.people.push_back(each.box);
    } else {
      vehicles.push_back({each.box, each.confidence});
    }
  }
  for (const ScoredBox& each : Suppressed(vehicles, kRoadUserIou)) {
    users.vehicles.push_back(each.box);
  }
  return users;
}

RoadUserNetwork::RoadUserNetwork(const PrivacyNetworks::Network& network)
    : manifest_(RoadUserManifest(network)),
      engine_(MakeInferenceEngine(manifest_, 0, EngineKind::kOpenCv)),
      letterbox_(manifest_) {}

RoadUsers RoadUserNetwork::Find(const cv::Mat& bgr) {
  return DecodeRoadUsers(engine_->Run(letterbox_.Fill(bgr)), manifest_,
                         letterbox_.Scale(bgr.size()), bgr.size());
}

}  // namespace livemap::perception
