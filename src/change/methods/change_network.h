#pragma once

#include <cstddef>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "change/methods/change_manifest.h"
#include "change/methods/change_method.h"
#include "change/methods/road_look.h"
#include "perception/inference/letterbox.h"
#include "perception/inference/onnx_graph.h"

namespace livemap::change {

/// What the network's encoder makes of one picture; depends on that picture alone, so that those of
/// remembered pictures can be kept. Continuous float32, finest first.
struct ChangeFeatures {
  std::vector<cv::Mat> levels;
  cv::Size size;  ///< Of the picture, pixels.

  std::size_t Bytes() const;
};

/// The network of change (thesis, section 4.4) on OpenCV's DNN module, on the CPU. Pictures may
/// have any size: they are letterboxed to the network's, and its answer is enlarged to theirs.
/// Where the manifest says so, Run looks a second time at the middle of large pictures (CloserLook)
/// and takes that answer there, and at the road of both by itself (RoadLook). Where the pair is not
/// valid the probability of no change is 1. Not thread-safe.
class ChangeNetwork final : public ChangeMethod {
 public:
  /// Loads the three graphs and runs each once. Throws Error when a file is missing, has another
  /// SHA-256 than the manifest's, cannot be loaded, or takes or gives something else than the
  /// manifest says. `threads` > 0: of OpenCV's pool, which is one for the process.
  explicit ChangeNetwork(const ChangeManifest& manifest, int threads = 0);

  bool tells_classes() const override { return true; }
  const ChangeManifest& manifest() const { return manifest_; }

  /// `picture`: CV_8UC3, BGR; Error otherwise.
  ChangeFeatures Encode(const cv::Mat& picture);
  /// The same answer as Run's of the whole pictures, from features of both. Where `valid` (CV_8UC1,
  /// their size) is 0 the warped picture must have shown the other's pixels, see FillUnknown.
  /// Throws Error when sizes or features do not fit.
  ChangeProbabilities Compare(const ChangeFeatures& before, const ChangeFeatures& after,
                              const cv::Mat& valid);

 protected:
  ChangeProbabilities Infer(const AlignedPair& pair) override;

 private:
  using NamedTensors = std::vector<std::pair<std::string, cv::Mat>>;

  /// The network's answer to a pair, or to a part of one.
  ChangeProbabilities Look(const AlignedPair& pair);
  /// Takes on the road what the network and the road look make of both roads laid onto each other.
  void LookAtRoad(const AlignedPair& pair, ChangeProbabilities& probabilities);
  void CheckWhole();
  void CheckParts();
  /// Throws Error unless it is what the manifest says of the probabilities.
  void CheckAnswer(const perception::OnnxGraph& graph, const std::vector<cv::Mat>& answers) const;
  std::vector<cv::Mat> RunEncoder(const cv::Mat& image);
  static NamedTensors HeadInputs(const std::vector<cv::Mat>& first,
                                 const std::vector<cv::Mat>& second, const cv::Mat& validity);
  /// 1 x 1 x H x W: 1 where the pair is valid, and on the padding.
  cv::Mat Validity(const cv::Mat& valid) const;
  /// From the network's answer to images of `size`. Throws Error when it holds something that is no
  /// probability.
  ChangeProbabilities Enlarged(const cv::Mat& answer, cv::Size size) const;

  ChangeManifest manifest_;
  perception::Letterbox before_letterbox_;
  perception::Letterbox after_letterbox_;
  perception::OnnxGraph whole_;
  perception::OnnxGraph encoder_;
  perception::OnnxGraph head_;
  std::optional<RoadLook> road_look_;
};

/// The part of a picture of `size` that is looked at more closely: `share` of its width, as high as
/// the network's `input` is for its width, around 0.55 of the height, within the picture.
/// Empty where that shows no more than the whole does: `share` is 0, or the part is no larger than
/// the input.
cv::Rect CloserLook(cv::Size size, double share, cv::Size input);

/// Reads `path` and makes the network. Throws Error as ReadChangeManifest and ChangeNetwork do.
std::unique_ptr<ChangeNetwork> MakeChangeNetwork(const std::string& path, int threads = 0);

}  // namespace livemap::change
