#include "perception/privacy/private_region_finder.h"

#include "common/error.h"
#include "perception/privacy/cascade_region_finder.h"
#include "perception/privacy/network_region_finder.h"
#include "perception/privacy/privacy_networks.h"

namespace livemap::perception {
namespace {

/// Whoever names a model of faces beside the cascades wants it: it stays in effect under kAuto.
bool UsesNetworks(const PrivateRegionConfig& config) {
  if (config.source == PrivateRegionSource::kCascades) return false;
  if (config.source == PrivateRegionSource::kNetworks) {
    if (config.networks.empty()) {
      throw Error(
          "no manifest of the networks that find faces and plates is named, accepted is "
          "the path of models/privacy.yaml");
    }
    if (!config.face_model.empty()) {
      throw Error("face_model is '" + config.face_model +
                  "', accepted is none where networks look for faces and plates");
    }
    return true;
  }
  if (config.networks.empty() || !config.face_model.empty()) return false;
  return IsAnyPlaced(ReadPrivacyNetworks(config.networks));
}

}  // namespace

std::unique_ptr<PrivateRegionFinder> MakePrivateRegionFinder(const PrivateRegionConfig& config) {
  if (UsesNetworks(config)) {
    return std::make_unique<NetworkRegionFinder>(ReadPrivacyNetworks(config.networks));
  }
  return MakeCascadeRegionFinder(config);
}

}  // namespace livemap::perception
