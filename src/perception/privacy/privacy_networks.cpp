#include "perception/privacy/privacy_networks.h"

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <vector>

#include "common/error.h"
#include "common/text_file.h"
#include "perception/inference/manifest_section.h"

namespace livemap::perception {
namespace {

PrivacyNetworks::Network ReadPrivacyNetwork(const ManifestSection& root, const std::string& key,
                                            const std::filesystem::path& directory,
                                            bool is_sure_read) {
  const ManifestSection section = root.Sub(
      key, {"file", "sha256", "origin", "licence", "input", "normalisation", "thresholds"});
  PrivacyNetworks::Network network;
  network.file = (directory / section.Text("file")).string();
  network.sha256 = section.Hash("sha256");
  network.origin = section.Text("origin");
  network.licence = section.Text("licence");
  network.input = ReadManifestInput(
      section.Sub("input", {"width", "height", "channels", "resize", "pad_value"}));
  network.normalisation = ReadManifestNormalisation(section);
  std::vector<std::string> names = {"found"};
  if (is_sure_read) names.emplace_back("sure");
  const ManifestSection thresholds = section.Sub("thresholds", names);
  network.found = thresholds.Number("found", 0.001, 0.999);
  if (is_sure_read) {
    network.sure = thresholds.Number("sure", static_cast<double>(network.found), 1);
  }
  return network;
}

}  // namespace

PrivacyNetworks ParsePrivacyNetworks(const std::string& yaml, const std::string& origin,
                                     const std::string& directory) {
  if (yaml.size() > kMaxManifestBytes) {
    throw Error("model manifest '" + origin + "' has " + std::to_string(yaml.size()) +
                " bytes, accepted is a manifest (models/privacy.yaml) of at most " +
                std::to_string(kMaxManifestBytes));
  }
  try {
    const ManifestSection root(YAML::Load(yaml), origin, "",
                               {"name", "kind", "faces", "plates", "road_users"});
    root.Text("name");
    root.Choice("kind", {"privacy"});
    PrivacyNetworks networks;
    networks.faces = ReadPrivacyNetwork(root, "faces", directory, /*is_sure_read=*/true);
    networks.plates = ReadPrivacyNetwork(root, "plates", directory, /*is_sure_read=*/true);
    networks.road_users = ReadPrivacyNetwork(root, "road_users", directory, /*is_sure_read=*/false);
    return networks;
  } catch (const YAML::Exception& error) {
    throw Error("model manifest '" + origin + "' is no valid YAML: " + error.what());
  }
}

PrivacyNetworks ReadPrivacyNetworks(const std::string& path) {
  const std::string yaml = ReadTextFile(path, kMaxManifestBytes);
  return ParsePrivacyNetworks(yaml, path, std::filesystem::path(path).parent_path().string());
}

bool IsAnyPlaced(const PrivacyNetworks& networks) {
  for (const PrivacyNetworks::Network* network :
       {&networks.faces, &networks.plates, &networks.road_users}) {
    std::error_code error;
    const auto status = std::filesystem::symlink_status(network->file, error);
    if (status.type() != std::filesystem::file_type::not_found) return true;
  }
  return false;
}

}  // namespace livemap::perception
