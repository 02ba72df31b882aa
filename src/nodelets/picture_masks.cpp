#include "nodelets/picture_masks.h"

#include <ros/console.h>
#include <ros/package.h>

#include <utility>

namespace livemap::nodelets {

perception::PictureMasker::Config MakeMaskerConfig(bool privacy,
                                                   perception::PrivacyMask::Config mask) {
  if (mask.regions.networks.empty()) {
    const std::string package = ros::package::getPath("livemap");
    if (!package.empty()) mask.regions.networks = package + "/models/privacy.yaml";
  }
  return {privacy, std::move(mask)};
}

void SayWhatFindsFaces(const std::string& nodelet_name, const perception::PictureMasker& masker) {
  if (masker.finder() == "nothing") {
    ROS_INFO("%s: faces and number plates are not masked: privacy is false", nodelet_name.c_str());
    return;
  }
  ROS_INFO(
      "%s: %s look for faces and number plates%s", nodelet_name.c_str(), masker.finder().c_str(),
      masker.finder() == "cascades" ? "; ./livemap privacy-models places networks that miss fewer"
                                    : "");
}

}  // namespace livemap::nodelets
