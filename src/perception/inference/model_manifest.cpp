#include "perception/inference/model_manifest.h"

#include <yaml-cpp/yaml.h>

#include <filesystem>

#include "common/error.h"
#include "perception/inference/manifest_section.h"

namespace livemap::perception {
namespace {

constexpr std::size_t kMaxClasses = 1000;
constexpr int kMaxViews = 4;

void ReadFiles(const ManifestSection& root, const std::filesystem::path& directory,
               ModelManifest& manifest) {
  manifest.file = (directory / root.Text("file")).string();
  manifest.sha256 = root.Hash("sha256");
  if (root.Has("torch_file") != root.Has("torch_sha256")) {
    const std::string missing = root.Has("torch_file") ? "torch_sha256" : "torch_file";
    root.Refuse(missing, "both torch_file and torch_sha256 or none of them");
  }
  if (root.Has("torch_file")) {
    manifest.torch_file = (directory / root.Text("torch_file")).string();
    manifest.torch_sha256 = root.Hash("torch_sha256");
  }
  if (!root.Has("engine")) return;
  const std::string engine = root.Choice("engine", {"opencv", "torch"});
  manifest.engine = engine == "torch" ? EngineKind::kTorch : EngineKind::kOpenCv;
  if (manifest.engine == EngineKind::kTorch && manifest.torch_file.empty()) {
    root.Refuse("engine", "opencv where no torch_file is given");
  }
}

void ReadNames(const ManifestSection& root, ModelManifest& manifest) {
  manifest.name = root.Text("name");
  manifest.classes = root.DistinctTexts("classes", kMaxClasses);
}

void ReadInput(const ManifestSection& root, ModelManifest& manifest) {
  manifest.input =
      ReadManifestInput(root.Sub("input", {"width", "height", "channels", "resize", "pad_value"}));
  manifest.normalisation = ReadManifestNormalisation(root);
}

/// Which keys are needed depends on the head, so its type is looked at before they are checked.
HeadType HeadTypeOf(const YAML::Node& file) {
  if (!file.IsMap() || !file["head"].IsDefined() || !file["head"].IsMap()) return HeadType::kYolox;
  const YAML::Node type = file["head"]["type"];
  const bool is_score = type.IsDefined() && type.IsScalar() && type.Scalar() == "score";
  return is_score ? HeadType::kScore : HeadType::kYolox;
}

void ReadThresholds(const ManifestSection& root, ModelManifest& manifest) {
  const ManifestSection thresholds = root.Sub("thresholds", manifest.classes);
  for (const std::string& name : manifest.classes) {
    manifest.thresholds.push_back(thresholds.Number(name, 0.001, 0.999));
  }
}

void ReadScoreHead(const ManifestSection& root, ModelManifest& manifest) {
  const ManifestSection head = root.Sub("head", {"type", "output"});
  manifest.head.type = HeadType::kScore;
  manifest.head.output = head.Text("output");
}

void ReadYoloxHead(const ManifestSection& root, ModelManifest& manifest) {
  const ManifestSection head =
      root.Sub("head", {"type", "strides", "output"}, {"views", "mirrored"});
  if (head.Text("type") != "yolox") head.Refuse("type", "yolox or score");
  manifest.head.output = head.Text("output");
  manifest.head.strides =
      head.List("strides", 1, 16, [&](const YAML::Node& node, const std::string& path) {
        const int stride = head.IntegerOf(node, path, 1, kLargestInputSide);
        if (manifest.input.width % stride != 0 || manifest.input.height % stride != 0) {
          head.RefuseNode(path, node,
                          "a divisor of the input's width " + std::to_string(manifest.input.width) +
                              " and height " + std::to_string(manifest.input.height));
        }
        return stride;
      });
  if (head.Has("views")) manifest.head.views = head.Integer("views", 1, kMaxViews);
  if (manifest.head.strides.size() % static_cast<std::size_t>(manifest.head.views) != 0) {
    head.Refuse("views", "a divisor of the number of strides, " +
                             std::to_string(manifest.head.strides.size()));
  }
  if (head.Has("mirrored")) {
    manifest.head.mirrored = head.Choice("mirrored", {"true", "false"}) == "true";
  }
  manifest.nms_iou = root.Number("nms_iou", 0.0, 1.0);
}

}  // namespace

int ModelManifest::AnchorCount() const {
  int count = 0;
  for (const int stride : head.strides) {
    count += (input.width / stride) * (input.height / stride);
  }
  return count;
}

std::vector<std::int64_t> ModelManifest::OutputShape() const {
  const auto class_count = static_cast<std::int64_t>(classes.size());
  if (head.type == HeadType::kScore) return {1, class_count};
  return {1, AnchorCount(), 5 + class_count};
}

ModelManifest ParseModelManifest(const std::string& yaml, const std::string& origin,
                                 const std::string& directory) {
  if (yaml.size() > kMaxManifestBytes) {
    throw Error("model manifest '" + origin + "' has " + std::to_string(yaml.size()) +
                " bytes, accepted is a manifest (models/NAME.yaml) of at most " +
                std::to_string(kMaxManifestBytes));
  }
  try {
    const YAML::Node file = YAML::Load(yaml);
    const HeadType head = HeadTypeOf(file);
    std::vector<std::string> keys = {"name",  "file",          "sha256", "classes",
                                     "input", "normalisation", "head",   "thresholds"};
    if (head == HeadType::kYolox) keys.emplace_back("nms_iou");
    const ManifestSection root(file, origin, "", keys, {"engine", "torch_file", "torch_sha256"});
    ModelManifest manifest;
    ReadNames(root, manifest);
    ReadFiles(root, directory, manifest);
    ReadInput(root, manifest);
    head == HeadType::kScore ? ReadScoreHead(root, manifest) : ReadYoloxHead(root, manifest);
    ReadThresholds(root, manifest);
    return manifest;
  } catch (const YAML::Exception& error) {
    throw Error("model manifest '" + origin + "' is no valid YAML: " + error.what());
  }
}

ModelManifest ReadModelManifest(const std::string& path) {
  const std::string yaml = ReadFile(path, kMaxManifestBytes);
  return ParseModelManifest(yaml, path, std::filesystem::path(path).parent_path().string());
}

std::string ReadModelFile(const ModelManifest& manifest) {
  return ReadHashedFile(manifest.name, manifest.file, manifest.sha256);
}

std::string ReadTorchFile(const ModelManifest& manifest) {
  if (manifest.torch_file.empty()) {
    throw Error("the torch engine was asked for model '" + manifest.name +
                "', whose manifest has no torch_file: accepted is opencv, or "
                "training/export_torch.py adds one");
  }
  return ReadHashedFile(manifest.name, manifest.torch_file, manifest.torch_sha256);
}

}  // namespace livemap::perception
