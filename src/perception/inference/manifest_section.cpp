#include "perception/inference/manifest_section.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <utility>

#include "common/error.h"
#include "common/sha256.h"
#include "perception/inference/unpack.h"

namespace livemap::perception {
namespace {

constexpr std::size_t kMaxModelBytes = std::size_t{256} * 1024 * 1024;

/// A value as text for an error message: short, whatever the file holds.
std::string ManifestValueText(const YAML::Node& node) {
  if (!node.IsDefined()) return "missing";
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  if (!node.IsScalar()) return "empty";
  const std::string& text = node.Scalar();
  return "'" + (text.size() <= 80 ? text : text.substr(0, 77) + "...") + "'";
}

std::string JoinManifestKeys(const std::vector<std::string>& keys, const std::string& separator) {
  std::string list;
  for (const std::string& key : keys) list += (list.empty() ? "" : separator) + key;
  return list;
}

bool IsManifestKeyIn(const std::vector<std::string>& list, const std::string& text) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

}  // namespace

ManifestSection::ManifestSection(const YAML::Node& node, std::string origin, std::string path,
                                 const std::vector<std::string>& keys,
                                 const std::vector<std::string>& optional)
    : node_(node), origin_(std::move(origin)), path_(std::move(path)) {
  if (!node.IsMap()) RefuseNode(path_.empty() ? "the file" : path_, node, "a map");
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (!IsManifestKeyIn(keys, key) && !IsManifestKeyIn(optional, key)) {
      throw Error("model manifest '" + origin_ + "': unknown key " +
                  ManifestValueText(entry.first) + Where() +
                  ", accepted are: " + JoinManifestKeys(keys, ", ") +
                  (optional.empty() ? "" : ", " + JoinManifestKeys(optional, ", ")));
    }
    if (!seen.insert(key).second) {
      throw Error("model manifest '" + origin_ + "': key '" + key + "'" + Where() +
                  " stands twice, accepted is once");
    }
  }
  for (const std::string& key : keys) {
    if (seen.count(key) == 0) {
      throw Error("model manifest '" + origin_ + "': key '" + key + "'" + Where() +
                  " is missing, needed are: " + JoinManifestKeys(keys, ", "));
    }
  }
}

std::string ManifestSection::Choice(const std::string& key,
                                    const std::vector<std::string>& accepted) const {
  std::string text = Text(key);
  if (!IsManifestKeyIn(accepted, text)) Refuse(key, JoinManifestKeys(accepted, " or "));
  return text;
}

std::string ManifestSection::Hash(const std::string& key) const {
  std::string hash = Text(key);
  if (hash.size() != 64 || hash.find_first_not_of("0123456789abcdef") != std::string::npos) {
    Refuse(key, "64 lower-case hexadecimal digits");
  }
  return hash;
}

std::vector<std::string> ManifestSection::DistinctTexts(const std::string& key,
                                                        std::size_t most) const {
  std::vector<std::string> texts =
      List(key, 1, most,
           [&](const YAML::Node& node, const std::string& path) { return TextOf(node, path); });
  std::set<std::string> distinct;
  for (const std::string& text : texts) {
    if (!distinct.insert(text).second) {
      Refuse(key, "a list of distinct names, '" + text + "' stands there twice");
    }
  }
  return texts;
}

std::string ManifestSection::TextOf(const YAML::Node& node, const std::string& path) const {
  if (!node.IsScalar() || node.Scalar().empty() || node.Scalar().size() > 1000) {
    RefuseNode(path, node, "a text of 1 to 1000 bytes");
  }
  return node.Scalar();
}

int ManifestSection::IntegerOf(const YAML::Node& node, const std::string& path, int min,
                               int max) const {
  int value = 0;
  if (!node.IsScalar() || !YAML::convert<int>::decode(node, value) || value < min || value > max) {
    RefuseNode(path, node,
               "a whole number from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return value;
}

float ManifestSection::NumberOf(const YAML::Node& node, const std::string& path, double min,
                                double max) const {
  double value = 0;
  // Written so that NaN is refused too.
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) ||
      !(value >= min && value <= max)) {
    std::ostringstream accepted;
    accepted << "a number from " << min << " to " << max;
    RefuseNode(path, node, accepted.str());
  }
  return static_cast<float>(value);
}

void ManifestSection::RefuseNode(const std::string& path, const YAML::Node& node,
                                 const std::string& accepted) const {
  throw Error("model manifest '" + origin_ + "': " + path + " is " + ManifestValueText(node) +
              ", accepted is " + accepted);
}

ModelManifest::Input ReadManifestInput(const ManifestSection& section) {
  ModelManifest::Input input;
  input.width = section.Integer("width", 1, kLargestInputSide);
  input.height = section.Integer("height", 1, kLargestInputSide);
  input.channels =
      section.Choice("channels", {"rgb", "bgr"}) == "rgb" ? ChannelOrder::kRgb : ChannelOrder::kBgr;
  section.Choice("resize", {"letterbox"});
  input.pad_value = section.Integer("pad_value", 0, 255);
  return input;
}

ModelManifest::Normalisation ReadManifestNormalisation(const ManifestSection& root) {
  const ManifestSection section = root.Sub("normalisation", {"mean", "std"});
  const auto read_three = [&](const std::string& key, double min) {
    const std::vector<float> values =
        section.List(key, 3, 3, [&](const YAML::Node& node, const std::string& path) {
          return section.NumberOf(node, path, min, 1000.0);
        });
    return std::array<float, 3>{values[0], values[1], values[2]};
  };
  return {read_three("mean", -1000.0), read_three("std", 1e-3)};
}

std::string ReadHashedFile(const std::string& name, const std::string& file,
                           const std::string& sha256) {
  std::string bytes = ReadFile(file, kMaxModelBytes);
  const std::string found = Sha256Hex(bytes);
  if (found != sha256) {
    throw Error("model file '" + file + "' has SHA-256 " + found + ", the manifest of '" + name +
                "' accepts " + sha256);
  }
  return Unpacked(std::move(bytes), file, kMaxModelBytes);
}

}  // namespace livemap::perception
