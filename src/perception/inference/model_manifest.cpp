#include "perception/inference/model_manifest.h"

#include <yaml-cpp/yaml.h>

#include <filesystem>

#include "common/error.h"
#include "common/text_file.h"
#include "perception/inference/manifest_section.h"

namespace livemap::perception {
namespace {

constexpr std::size_t kMaxClasses = 1000;
constexpr int kMaxViews = 4;

/// A file and its hash, of which a manifest has both or none.
void ReadOptionalFile(const ManifestSection& root, const std::filesystem::path& directory,
                      const std::string& kind, std::string& file, std::string& sha256) {
  const std::string file_key = kind + "_file";
  const std::string hash_key = kind + "_sha256";
  if (root.Has(file_key) != root.Has(hash_key)) {
    const std::string missing = root.Has(file_key) ? hash_key : file_key;
    root.Refuse(missing, "both " + file_key + " and " + hash_key + " or none of them");
  }
  if (!root.Has(file_key)) return;
  file = (directory / root.Text(file_key)).string();
  sha256 = root.Hash(hash_key);
}

void ReadManifestEngine(const ManifestSection& root, ModelManifest& manifest) {
  if (root.Has("engine")) {
    const std::string engine = root.Choice("engine", {"opencv", "torch"});
    manifest.engine = engine == "torch" ? EngineKind::kTorch : EngineKind::kOpenCv;
    if (manifest.engine == EngineKind::kTorch && manifest.torch_file.empty()) {
      root.Refuse("engine", "opencv where no torch_file is given");
    }
  }
  if (!root.Has("precision")) return;
  const std::string precision = root.Choice("precision", {"fp32", "int8"});
  manifest.precision = precision == "int8" ? Precision::kInt8 : Precision::kFp32;
  if (manifest.precision == Precision::kInt8 && manifest.int8_file.empty()) {
    root.Refuse("precision", "fp32 where no int8_file is given");
  }
  if (manifest.precision == Precision::kInt8 && manifest.engine != EngineKind::kTorch) {
    root.Refuse("precision", "fp32 where engine is not torch");
  }
}

void ReadManifestFiles(const ManifestSection& root, const std::filesystem::path& directory,
                       ModelManifest& manifest) {
  manifest.file = (directory / root.Text("file")).string();
  manifest.sha256 = root.Hash("sha256");
  ReadOptionalFile(root, directory, "torch", manifest.torch_file, manifest.torch_sha256);
  ReadOptionalFile(root, directory, "int8", manifest.int8_file, manifest.int8_sha256);
  if (!manifest.int8_file.empty() && manifest.torch_file.empty()) {
    root.Refuse("int8_file", "a torch_file beside it, for processors without instructions for it");
  }
  ReadManifestEngine(root, manifest);
}

void ReadManifestNames(const ManifestSection& root, ModelManifest& manifest) {
  manifest.name = root.Text("name");
  manifest.classes = root.DistinctTexts("classes", kMaxClasses);
}

void ReadModelInput(const ManifestSection& root, ModelManifest& manifest) {
  manifest.input =
      ReadManifestInput(root.Sub("input", {"width", "height", "channels", "resize", "pad_value"}));
  manifest.normalisation = ReadManifestNormalisation(root);
}

/// Which keys are needed depends on the head, so its type is looked at before they are checked.
HeadType ManifestHeadType(const YAML::Node& file) {
  if (!file.IsMap() || !file["head"].IsDefined() || !file["head"].IsMap()) return HeadType::kYolox;
  const YAML::Node type = file["head"]["type"];
  const bool is_score = type.IsDefined() && type.IsScalar() && type.Scalar() == "score";
  return is_score ? HeadType::kScore : HeadType::kYolox;
}

void ReadManifestThresholds(const ManifestSection& root, ModelManifest& manifest) {
  const ManifestSection thresholds = root.Sub("thresholds", manifest.classes);
  for (const std::string& name : manifest.classes) {
    manifest.thresholds.push_back(thresholds.Number(name, 0.001, 0.999));
  }
}

void ReadManifestScoreHead(const ManifestSection& root, ModelManifest& manifest) {
  const ManifestSection head = root.Sub("head", {"type", "output"});
  manifest.head.type = HeadType::kScore;
  manifest.head.output = head.Text("output");
}

void ReadManifestYoloxHead(const ManifestSection& root, ModelManifest& manifest) {
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
  const cv::Size largest(manifest.input.width, manifest.input.height);
  for (int view = 0; view < manifest.head.views && !manifest.int8_file.empty(); ++view) {
    const cv::Size size = manifest.SizeOfView(view);
    if (size.width > largest.width || size.height > largest.height) {
      head.Refuse("strides",
                  "cells of each view at least as large as those of the first view, "
                  "where there is an int8_file");
    }
  }
  if (head.Has("mirrored")) {
    manifest.head.mirrored = head.Choice("mirrored", {"true", "false"}) == "true";
  }
  manifest.nms_iou = root.Number("nms_iou", 0.0, 1.0);
}

}  // namespace

int ModelManifest::AnchorCount() const {
  int count = 0;
  for (int view = 0; view < head.views; ++view) count += AnchorCountOfView(view);
  return count;
}

int ModelManifest::AnchorCountOfView(int view) const {
  const auto levels = static_cast<int>(head.strides.size()) / head.views;
  int count = 0;
  for (int level = view * levels; level < (view + 1) * levels; ++level) {
    const int stride = head.strides[static_cast<std::size_t>(level)];
    count += (input.width / stride) * (input.height / stride);
  }
  return count;
}

cv::Size ModelManifest::SizeOfView(int view) const {
  if (head.strides.empty()) return {input.width, input.height};
  const std::size_t levels = head.strides.size() / static_cast<std::size_t>(head.views);
  const int stride = head.strides[static_cast<std::size_t>(view) * levels];
  // Whole numbers: every stride divides the input's sides.
  return {input.width / stride * head.strides[0], input.height / stride * head.strides[0]};
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
    const HeadType head = ManifestHeadType(file);
    std::vector<std::string> keys = {"name",  "file",          "sha256", "classes",
                                     "input", "normalisation", "head",   "thresholds"};
    std::vector<std::string> optional = {"engine", "torch_file", "torch_sha256"};
    if (head == HeadType::kYolox) {
      keys.emplace_back("nms_iou");
      optional.insert(optional.end(), {"int8_file", "int8_sha256", "precision"});
    }
    const ManifestSection root(file, origin, "", keys, optional);
    ModelManifest manifest;
    ReadManifestNames(root, manifest);
    ReadManifestFiles(root, directory, manifest);
    ReadModelInput(root, manifest);
    head == HeadType::kScore ? ReadManifestScoreHead(root, manifest)
                             : ReadManifestYoloxHead(root, manifest);
    ReadManifestThresholds(root, manifest);
    return manifest;
  } catch (const YAML::Exception& error) {
    throw Error("model manifest '" + origin + "' is no valid YAML: " + error.what());
  }
}

ModelManifest ReadModelManifest(const std::string& path) {
  const std::string yaml = ReadTextFile(path, kMaxManifestBytes);
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

std::string ReadInt8File(const ModelManifest& manifest) {
  if (manifest.int8_file.empty()) {
    throw Error("model '" + manifest.name +
                "' was asked for in 8 bits, and its manifest has no int8_file: accepted is "
                "precision fp32, or training/export_int8.py adds one");
  }
  return ReadHashedFile(manifest.name, manifest.int8_file, manifest.int8_sha256);
}

}  // namespace livemap::perception
