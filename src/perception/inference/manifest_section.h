#pragma once

#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <string>
#include <vector>

#include "perception/inference/model_manifest.h"

namespace livemap::perception {

constexpr std::size_t kMaxManifestBytes = std::size_t{64} * 1024;
constexpr int kLargestInputSide = 4096;  ///< px

/// One map of a model's manifest, read key by key: what all kinds of manifests are read with.
/// Everything throws Error that names the file, the key, its value and what is accepted.
class ManifestSection {
 public:
  /// Refuses keys that are not in `keys` or `optional`, that are repeated, and missing `keys`.
  /// `origin` names the file and `path` the map within it; empty: the whole file.
  ManifestSection(const YAML::Node& node, std::string origin, std::string path,
                  const std::vector<std::string>& keys,
                  const std::vector<std::string>& optional = {});

  ManifestSection Sub(const std::string& key, const std::vector<std::string>& keys,
                      const std::vector<std::string>& optional = {}) const {
    return {node_[key], origin_, Path(key), keys, optional};
  }

  bool Has(const std::string& key) const { return node_[key].IsDefined(); }

  /// 1 to 1000 bytes.
  std::string Text(const std::string& key) const { return TextOf(node_[key], Path(key)); }
  /// One of these texts.
  std::string Choice(const std::string& key, const std::vector<std::string>& accepted) const;
  /// A file's SHA-256: 64 lower-case hexadecimal digits.
  std::string Hash(const std::string& key) const;
  int Integer(const std::string& key, int min, int max) const {
    return IntegerOf(node_[key], Path(key), min, max);
  }
  float Number(const std::string& key, double min, double max) const {
    return NumberOf(node_[key], Path(key), min, max);
  }
  /// Distinct texts.
  std::vector<std::string> DistinctTexts(const std::string& key, std::size_t most) const;

  /// A list of `min_size` to `max_size` entries, each read by `read(entry, path)`.
  template <typename Read>
  auto List(const std::string& key, std::size_t min_size, std::size_t max_size, Read read) const {
    const YAML::Node list = node_[key];
    if (!list.IsSequence() || list.size() < min_size || list.size() > max_size) {
      Refuse(key, "a list of " + std::to_string(min_size) +
                      (min_size == max_size ? "" : " to " + std::to_string(max_size)));
    }
    std::vector<decltype(read(list, std::string()))> values;
    for (std::size_t i = 0; i < list.size(); ++i) {
      values.push_back(read(list[i], Path(key) + "[" + std::to_string(i) + "]"));
    }
    return values;
  }

  /// The same of a node somewhere below, `path` names it.
  std::string TextOf(const YAML::Node& node, const std::string& path) const;
  int IntegerOf(const YAML::Node& node, const std::string& path, int min, int max) const;
  float NumberOf(const YAML::Node& node, const std::string& path, double min, double max) const;

  /// "model manifest 'FILE': PATH is VALUE, accepted is ..."
  [[noreturn]] void RefuseNode(const std::string& path, const YAML::Node& node,
                               const std::string& accepted) const;
  [[noreturn]] void Refuse(const std::string& key, const std::string& accepted) const {
    RefuseNode(Path(key), node_[key], accepted);
  }

 private:
  std::string Path(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }
  std::string Where() const { return path_.empty() ? "" : " in '" + path_ + "'"; }

  YAML::Node node_;
  std::string origin_;
  std::string path_;
};

/// The map `input`; `section` was made with at least width, height, channels, resize and pad_value.
ModelManifest::Input ReadManifestInput(const ManifestSection& section);
/// The map `normalisation` below `root`.
ModelManifest::Normalisation ReadManifestNormalisation(const ManifestSection& root);

/// The bytes of one of the files of model `name`. Throws Error when it is missing, larger than
/// 256 MiB, or its SHA-256 is another one.
std::string ReadHashedFile(const std::string& name, const std::string& file,
                           const std::string& sha256);

}  // namespace livemap::perception
