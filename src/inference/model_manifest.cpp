#include "inference/model_manifest.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/sha256.h"

namespace livemap {
namespace {

constexpr std::size_t kMostManifestBytes = std::size_t{64} * 1024;
constexpr std::size_t kMostModelBytes = std::size_t{256} * 1024 * 1024;
constexpr std::size_t kMostClasses = 1000;
constexpr int kLargestSide = 4096;

/// A value as text for an error message: short, whatever the file holds.
std::string Shown(const YAML::Node& node) {
  if (!node.IsDefined()) return "missing";
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  if (!node.IsScalar()) return "empty";
  const std::string& text = node.Scalar();
  return "'" + (text.size() <= 80 ? text : text.substr(0, 77) + "...") + "'";
}

/// One map of the manifest, read key by key.
class Section {
 public:
  /// Refuses keys that are not in `keys` or `optional`, that are repeated, and missing `keys`.
  Section(const YAML::Node& node, std::string origin, std::string path,
          const std::vector<std::string>& keys, const std::vector<std::string>& optional = {})
      : node_(node), origin_(std::move(origin)), path_(std::move(path)) {
    if (!node.IsMap()) Refuse(path_.empty() ? "the file" : path_, node, "a map");
    std::set<std::string> seen;
    for (const auto& entry : node) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
      const auto has = [&key](const std::vector<std::string>& list) {
        return std::find(list.begin(), list.end(), key) != list.end();
      };
      if (!has(keys) && !has(optional)) {
        throw Error("model manifest '" + origin_ + "': unknown key " + Shown(entry.first) +
                    Where() + ", accepted are: " + Join(keys) +
                    (optional.empty() ? "" : ", " + Join(optional)));
      }
      if (!seen.insert(key).second) {
        throw Error("model manifest '" + origin_ + "': key '" + key + "'" + Where() +
                    " stands twice, accepted is once");
      }
    }
    for (const std::string& key : keys) {
      if (seen.count(key) == 0) {
        throw Error("model manifest '" + origin_ + "': key '" + key + "'" + Where() +
                    " is missing, needed are: " + Join(keys));
      }
    }
  }

  Section Sub(const std::string& key, const std::vector<std::string>& keys) const {
    return {node_[key], origin_, Path(key), keys};
  }

  bool Has(const std::string& key) const { return node_[key].IsDefined(); }

  std::string Text(const std::string& key) const { return TextOf(node_[key], Path(key)); }

  int Integer(const std::string& key, int min, int max) const {
    return IntegerOf(node_[key], Path(key), min, max);
  }

  float Number(const std::string& key, double min, double max) const {
    return NumberOf(node_[key], Path(key), min, max);
  }

  /// A list of `min_size` to `max_size` entries, each read by `read(entry, path)`.
  template <typename Read>
  auto List(const std::string& key, std::size_t min_size, std::size_t max_size, Read read) const {
    const YAML::Node list = node_[key];
    if (!list.IsSequence() || list.size() < min_size || list.size() > max_size) {
      Refuse(Path(key), list,
             "a list of " + std::to_string(min_size) +
                 (min_size == max_size ? "" : " to " + std::to_string(max_size)));
    }
    std::vector<decltype(read(list, std::string()))> values;
    for (std::size_t i = 0; i < list.size(); ++i) {
      values.push_back(read(list[i], Path(key) + "[" + std::to_string(i) + "]"));
    }
    return values;
  }

  std::string TextOf(const YAML::Node& node, const std::string& path) const {
    if (!node.IsScalar() || node.Scalar().empty() || node.Scalar().size() > 1000) {
      Refuse(path, node, "a text of 1 to 1000 bytes");
    }
    return node.Scalar();
  }

  int IntegerOf(const YAML::Node& node, const std::string& path, int min, int max) const {
    int value = 0;
    if (!node.IsScalar() || !YAML::convert<int>::decode(node, value) || value < min ||
        value > max) {
      Refuse(path, node,
             "a whole number from " + std::to_string(min) + " to " + std::to_string(max));
    }
    return value;
  }

  float NumberOf(const YAML::Node& node, const std::string& path, double min, double max) const {
    double value = 0;
    // Written so that NaN is refused too.
    if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) ||
        !(value >= min && value <= max)) {
      std::ostringstream accepted;
      accepted << "a number from " << min << " to " << max;
      Refuse(path, node, accepted.str());
    }
    return static_cast<float>(value);
  }

  [[noreturn]] void Refuse(const std::string& path, const YAML::Node& node,
                           const std::string& accepted) const {
    throw Error("model manifest '" + origin_ + "': " + path + " is " + Shown(node) +
                ", accepted is " + accepted);
  }

  const YAML::Node& node() const { return node_; }
  std::string Path(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

 private:
  std::string Where() const { return path_.empty() ? "" : " in '" + path_ + "'"; }

  static std::string Join(const std::vector<std::string>& keys) {
    std::string list;
    for (const std::string& key : keys) list += (list.empty() ? "" : ", ") + key;
    return list;
  }

  YAML::Node node_;
  std::string origin_;
  std::string path_;
};

std::string HashOf(const Section& root, const std::string& key) {
  std::string hash = root.Text(key);
  if (hash.size() != 64 || hash.find_first_not_of("0123456789abcdef") != std::string::npos) {
    root.Refuse(key, root.node()[key], "64 lower-case hexadecimal digits");
  }
  return hash;
}

void ReadFiles(const Section& root, const std::filesystem::path& directory,
               ModelManifest& manifest) {
  manifest.file = (directory / root.Text("file")).string();
  manifest.sha256 = HashOf(root, "sha256");
  if (root.Has("torch_file") != root.Has("torch_sha256")) {
    const std::string missing = root.Has("torch_file") ? "torch_sha256" : "torch_file";
    root.Refuse(missing, root.node()[missing], "both torch_file and torch_sha256 or none of them");
  }
  if (root.Has("torch_file")) {
    manifest.torch_file = (directory / root.Text("torch_file")).string();
    manifest.torch_sha256 = HashOf(root, "torch_sha256");
  }
  if (!root.Has("engine")) return;
  const std::string engine = root.Text("engine");
  if (engine != "opencv" && engine != "torch") {
    root.Refuse("engine", root.node()["engine"], "opencv or torch");
  }
  manifest.engine = engine == "torch" ? EngineKind::kTorch : EngineKind::kOpenCv;
  if (manifest.engine == EngineKind::kTorch && manifest.torch_file.empty()) {
    root.Refuse("engine", root.node()["engine"], "opencv where no torch_file is given");
  }
}

void ReadNames(const Section& root, ModelManifest& manifest) {
  manifest.name = root.Text("name");
  manifest.classes = root.List(
      "classes", 1, kMostClasses,
      [&](const YAML::Node& node, const std::string& path) { return root.TextOf(node, path); });
  std::set<std::string> distinct;
  for (const std::string& name : manifest.classes) {
    if (!distinct.insert(name).second) {
      root.Refuse("classes", root.node()["classes"],
                  "a list of distinct names, '" + name + "' stands there twice");
    }
  }
}

void ReadInput(const Section& root, ModelManifest& manifest) {
  const Section input = root.Sub("input", {"width", "height", "channels", "resize", "pad_value"});
  manifest.input.width = input.Integer("width", 1, kLargestSide);
  manifest.input.height = input.Integer("height", 1, kLargestSide);
  const std::string channels = input.Text("channels");
  if (channels != "rgb" && channels != "bgr") {
    input.Refuse("input.channels", input.node()["channels"], "rgb or bgr");
  }
  manifest.input.channels = channels == "rgb" ? ChannelOrder::kRgb : ChannelOrder::kBgr;
  if (input.Text("resize") != "letterbox") {
    input.Refuse("input.resize", input.node()["resize"], "letterbox");
  }
  manifest.input.pad_value = input.Integer("pad_value", 0, 255);

  const Section normalisation = root.Sub("normalisation", {"mean", "std"});
  const auto read_three = [&](const std::string& key, double min) {
    const std::vector<float> values =
        normalisation.List(key, 3, 3, [&](const YAML::Node& node, const std::string& path) {
          return normalisation.NumberOf(node, path, min, 1000.0);
        });
    return std::array<float, 3>{values[0], values[1], values[2]};
  };
  manifest.normalisation.mean = read_three("mean", -1000.0);
  manifest.normalisation.std = read_three("std", 1e-3);
}

/// Which keys are needed depends on the head, so its type is looked at before they are checked.
HeadType HeadTypeOf(const YAML::Node& file) {
  if (!file.IsMap() || !file["head"].IsDefined() || !file["head"].IsMap()) return HeadType::kYolox;
  const YAML::Node type = file["head"]["type"];
  const bool is_score = type.IsDefined() && type.IsScalar() && type.Scalar() == "score";
  return is_score ? HeadType::kScore : HeadType::kYolox;
}

void ReadThresholds(const Section& root, ModelManifest& manifest) {
  const Section thresholds = root.Sub("thresholds", manifest.classes);
  for (const std::string& name : manifest.classes) {
    manifest.thresholds.push_back(thresholds.Number(name, 0.001, 0.999));
  }
}

void ReadScoreHead(const Section& root, ModelManifest& manifest) {
  const Section head = root.Sub("head", {"type", "output"});
  manifest.head.type = HeadType::kScore;
  manifest.head.output = head.Text("output");
}

void ReadYoloxHead(const Section& root, ModelManifest& manifest) {
  const Section head = root.Sub("head", {"type", "strides", "output"});
  if (head.Text("type") != "yolox") {
    head.Refuse("head.type", head.node()["type"], "yolox or score");
  }
  manifest.head.output = head.Text("output");
  manifest.head.strides =
      head.List("strides", 1, 8, [&](const YAML::Node& node, const std::string& path) {
        const int stride = head.IntegerOf(node, path, 1, kLargestSide);
        if (manifest.input.width % stride != 0 || manifest.input.height % stride != 0) {
          head.Refuse(path, node,
                      "a divisor of the input's width " + std::to_string(manifest.input.width) +
                          " and height " + std::to_string(manifest.input.height));
        }
        return stride;
      });
  manifest.nms_iou = root.Number("nms_iou", 0.0, 1.0);
}

std::string ReadChecked(const ModelManifest& manifest, const std::string& file,
                        const std::string& sha256) {
  std::string bytes = ReadFile(file, kMostModelBytes);
  const std::string found = Sha256Hex(bytes);
  if (found != sha256) {
    throw Error("model file '" + file + "' has SHA-256 " + found + ", the manifest of '" +
                manifest.name + "' accepts " + sha256);
  }
  return bytes;
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
  if (yaml.size() > kMostManifestBytes) {
    throw Error("model manifest '" + origin + "' has " + std::to_string(yaml.size()) +
                " bytes, at most " + std::to_string(kMostManifestBytes) + " are accepted");
  }
  try {
    const YAML::Node file = YAML::Load(yaml);
    const HeadType head = HeadTypeOf(file);
    std::vector<std::string> keys = {"name",  "file",          "sha256", "classes",
                                     "input", "normalisation", "head",   "thresholds"};
    if (head == HeadType::kYolox) keys.emplace_back("nms_iou");
    const Section root(file, origin, "", keys, {"engine", "torch_file", "torch_sha256"});
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
  const std::string yaml = ReadFile(path, kMostManifestBytes);
  return ParseModelManifest(yaml, path, std::filesystem::path(path).parent_path().string());
}

std::string ReadModelFile(const ModelManifest& manifest) {
  return ReadChecked(manifest, manifest.file, manifest.sha256);
}

std::string ReadTorchFile(const ModelManifest& manifest) {
  if (manifest.torch_file.empty()) {
    throw Error("the torch engine was asked for model '" + manifest.name +
                "', whose manifest has no torch_file: accepted is opencv, or "
                "training/export_torch.py adds one");
  }
  return ReadChecked(manifest, manifest.torch_file, manifest.torch_sha256);
}

}  // namespace livemap
