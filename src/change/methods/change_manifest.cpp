#include "change/methods/change_manifest.h"

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "perception/inference/manifest_section.h"
#include "protocol/change_class.h"

namespace livemap::change {
namespace {

/// Names of features are told apart by one digit.
constexpr int kMaxLevels = 10;

ChangeManifest::Graph ReadManifestGraph(const perception::ManifestSection& graphs,
                                        const std::string& part,
                                        const std::filesystem::path& directory) {
  const perception::ManifestSection graph = graphs.Sub(part, {"file", "sha256"});
  return {(directory / graph.Text("file")).string(), graph.Hash("sha256")};
}

/// Their order is that of the channels of the answer, so it must be the program's.
void CheckManifestClasses(const perception::ManifestSection& root) {
  const std::vector<std::string> classes = root.DistinctTexts("classes", 1000);
  std::string accepted;
  bool same = classes.size() == static_cast<std::size_t>(protocol::kChangeClasses);
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    const std::string name = protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i));
    accepted += (accepted.empty() ? "" : ", ") + name;
    same = same && classes[static_cast<std::size_t>(i)] == name;
  }
  if (!same) root.Refuse("classes", "in this order " + accepted);
}

double ManifestThreshold(const perception::ManifestSection& thresholds, const std::string& key) {
  return static_cast<double>(thresholds.Number(key, 1e-6, 1));
}

ChangeManifest::RoadLook ReadRoadLook(const perception::ManifestSection& root,
                                      const ChangeManifest::Graph& graph) {
  const perception::ManifestSection section = root.Sub(
      "road", {"width", "height", "output", "least_agreement", "features", "colours", "bias"});
  ChangeManifest::RoadLook road;
  road.graph = graph;
  road.width = section.Integer("width", 64, perception::kLargestInputSide);
  road.height = section.Integer("height", 64, perception::kLargestInputSide);
  for (const auto& [key, size] :
       {std::pair("width", road.width), std::pair("height", road.height)}) {
    if (size % 8 != 0) section.Refuse(key, "a multiple of 8");
  }
  road.output = section.Text("output");
  road.least_agreement = static_cast<double>(section.Number("least_agreement", 1e-6, 1));
  road.features = static_cast<double>(section.Number("features", 0, 100));
  road.colours = static_cast<double>(section.Number("colours", 0, 100));
  road.bias = static_cast<double>(section.Number("bias", -100, 100));
  return road;
}

}  // namespace

ChangeManifest ParseChangeManifest(const std::string& yaml, const std::string& origin,
                                   const std::string& directory) {
  if (yaml.size() > perception::kMaxManifestBytes) {
    throw Error("model manifest '" + origin + "' has " + std::to_string(yaml.size()) +
                " bytes, at most " + std::to_string(perception::kMaxManifestBytes) +
                " are accepted");
  }
  try {
    const YAML::Node file = YAML::Load(yaml);
    if (file.IsMap() && !file["kind"].IsDefined()) {
      throw Error("model manifest '" + origin +
                  "' has no key 'kind', accepted is a network of change: kind: change");
    }
    const perception::ManifestSection root(
        file, origin, "",
        {"name", "kind", "graphs", "classes", "input", "normalisation", "head", "thresholds"},
        {"road"});
    root.Choice("kind", {"change"});
    ChangeManifest manifest;
    manifest.name = root.Text("name");
    CheckManifestClasses(root);
    const perception::ManifestSection graphs =
        root.Sub("graphs", {"whole", "encoder", "head"}, {"road"});
    manifest.whole = ReadManifestGraph(graphs, "whole", directory);
    manifest.encoder = ReadManifestGraph(graphs, "encoder", directory);
    manifest.head = ReadManifestGraph(graphs, "head", directory);
    if (graphs.Has("road") != root.Has("road")) {
      throw Error(
          "model manifest '" + origin + "' has " +
          (root.Has("road") ? "'road' without 'graphs.road'" : "'graphs.road' without 'road'") +
          ", accepted are both or none");
    }
    if (root.Has("road")) {
      manifest.road = ReadRoadLook(root, ReadManifestGraph(graphs, "road", directory));
    }
    const perception::ManifestSection input =
        root.Sub("input", {"width", "height", "channels", "resize", "pad_value", "invalid"},
                 {"closer_look"});
    manifest.input = perception::ReadManifestInput(input);
    input.Choice("invalid", {"other_picture"});
    if (input.Has("closer_look")) {
      manifest.closer_look = static_cast<double>(input.Number("closer_look", 0.1, 0.9));
    }
    manifest.normalisation = perception::ReadManifestNormalisation(root);
    const perception::ManifestSection head = root.Sub("head", {"type", "levels", "output"});
    head.Choice("type", {"change"});
    manifest.levels = head.Integer("levels", 1, kMaxLevels);
    manifest.output = head.Text("output");
    const perception::ManifestSection thresholds =
        root.Sub("thresholds", {"changed", "changed_at_fpr_0.01", "changed_at_fpr_0.10"});
    manifest.changed = ManifestThreshold(thresholds, "changed");
    manifest.changed_at_fpr_001 = ManifestThreshold(thresholds, "changed_at_fpr_0.01");
    manifest.changed_at_fpr_010 = ManifestThreshold(thresholds, "changed_at_fpr_0.10");
    return manifest;
  } catch (const YAML::Exception& error) {
    throw Error("model manifest '" + origin + "' is no valid YAML: " + error.what());
  }
}

ChangeManifest ReadChangeManifest(const std::string& path) {
  const std::string yaml = ReadTextFile(path, perception::kMaxManifestBytes);
  return ParseChangeManifest(yaml, path, std::filesystem::path(path).parent_path().string());
}

}  // namespace livemap::change
