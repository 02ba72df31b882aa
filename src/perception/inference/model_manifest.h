#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

namespace livemap::perception {

/// Order of the three channels in which a network wants an image.
enum class ChannelOrder { kRgb, kBgr };

/// The library that runs a network.
enum class EngineKind { kOpenCv, kTorch };
/// The numbers in which libtorch runs a network.
enum class Precision {
  kFp32,  ///< float32
  kInt8,  ///< Weights and activations are whole numbers of 8 bits.
};
/// What a network's answer is.
enum class HeadType {
  kYolox,  ///< Boxes with a score per class.
  kScore,  ///< One score per class for the whole image.
};

/// Everything that must be known about a model to run it: the content of models/NAME.yaml, checked.
/// models/README.md describes the file key by key.
struct ModelManifest {
  std::string name;          ///< Goes into DetectionArray.model.
  std::string file;          ///< Path of the ONNX file.
  std::string sha256;        ///< Of that file, 64 lower-case hexadecimal digits.
  std::string torch_file;    ///< Path of the TorchScript file; empty: there is none.
  std::string torch_sha256;  ///< Of that file; empty where there is none.
  std::string int8_file;     ///< Path of the TorchScript file in 8 bits; empty: there is none.
  std::string int8_sha256;   ///< Of that file; empty where there is none.
  EngineKind engine = EngineKind::kOpenCv;  ///< What runs it unless a parameter says otherwise.
  /// In what libtorch runs it: kInt8 is int8_file. OpenCV always runs `file`, in float32.
  Precision precision = Precision::kFp32;
  std::vector<std::string> classes;  ///< By class index; names as in config/hazards.yaml.

  /// The network's input tensor `images`: 1 x 3 x height x width, float32. An image is scaled to
  /// fit and padded on the right and at the bottom with `pad_value` (letterbox).
  struct Input {
    int width = 0;   ///< px
    int height = 0;  ///< px
    ChannelOrder channels = ChannelOrder::kRgb;
    int pad_value = 114;  ///< 0..255, before normalisation
  } input;

  /// x = (pixel - mean) / std, pixel 0..255, per channel in the order of `input.channels`.
  struct Normalisation {
    std::array<float, 3> mean{};
    std::array<float, 3> std{};
  } normalisation;

  /// kYolox (Ge et al. 2021): one output 1 x N x (5 + classes), rows (tx, ty, tw, th, objectness,
  /// class scores) of all grid cells, level by level in the order of `strides`, rows of cells
  /// first. kScore: one output 1 x classes, scores of the whole image, without strides.
  struct Head {
    HeadType type = HeadType::kYolox;
    std::vector<int> strides;  ///< px of the input per cell
    /// The network looks at its input so many times, at different scales: the strides are as many
    /// groups of one length, one after the other.
    int views = 1;
    bool mirrored = false;  ///< kYolox: it looks at the mirrored image too, in a second run.
    std::string output;     ///< name of the output tensor
  } head;

  std::vector<float> thresholds;  ///< Least confidence that is reported, by class index, (0, 1).
  float nms_iou = 0.5F;  ///< kYolox: of two boxes of a class overlapping more, the weaker goes.

  /// Rows of the output tensor: the cells of all levels.
  int AnchorCount() const;
  /// Rows of one view, from 0 to head.views - 1.
  int AnchorCountOfView(int view) const;
  /// The picture that a view looks at, in pixels: the first has the input's size, and the others
  /// are as much smaller as their cells are larger. `view`: from 0 to head.views - 1.
  cv::Size SizeOfView(int view) const;
  /// Of the output tensor, by the type of the head.
  std::vector<std::int64_t> OutputShape() const;
};

/// Reads and checks a manifest file; its files are resolved against the manifest's folder. The
/// model itself is not touched. Throws Error naming the file, the key, its value and what is
/// accepted; unknown, missing and repeated keys are errors too; engine, torch_file, torch_sha256,
/// int8_file, int8_sha256 and precision may be left out.
ModelManifest ReadModelManifest(const std::string& path);

/// The same from text; `origin` names it in errors and `directory` is what its files are relative
/// to.
ModelManifest ParseModelManifest(const std::string& yaml, const std::string& origin,
                                 const std::string& directory);

/// The bytes of the model file, whose SHA-256 is the manifest's: what is checked is what is loaded.
/// Throws Error when the file is missing, too large (256 MiB) or another one.
std::string ReadModelFile(const ModelManifest& manifest);

/// The same for the TorchScript file and its hash. Throws Error also when the manifest names none.
std::string ReadTorchFile(const ModelManifest& manifest);

/// The same for the TorchScript file in 8 bits.
std::string ReadInt8File(const ModelManifest& manifest);

}  // namespace livemap::perception
