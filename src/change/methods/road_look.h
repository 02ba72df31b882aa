#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "change/methods/change_manifest.h"
#include "change/methods/change_method.h"
#include "perception/inference/letterbox.h"
#include "perception/inference/onnx_graph.h"

namespace livemap::change {

/// A second look at the road alone, in full resolution, for things that are a few pixels in the
/// network's picture. The roads of both pictures are laid onto each other (AlignRoad). Then a thing
/// that came or went differs from the other picture in two ways: in a detector's features, and in
/// colour. Both are measured to the nearest of what the other picture has within a cell or two, so
/// that a pixel's misfit counts for nothing. Not thread-safe.
class RoadLook {
 public:
  /// Loads the graph and runs it once. Throws Error when it is missing, has another SHA-256 than
  /// the manifest's, cannot be loaded, or takes or gives something else than the manifest says.
  explicit RoadLook(const ChangeManifest& manifest);

  /// The pair with its roads laid onto each other; none where they agree too little to say
  /// anything, as between two seasons.
  std::optional<AlignedPair> Align(const AlignedPair& pair) const;

  /// CV_32FC1 of the pair's size: log odds that something on the road changed. Very low off the
  /// road and where the pair is not valid. `pair`: as Align gives it.
  cv::Mat LogOdds(const AlignedPair& pair);

 private:
  /// Of the band of a picture that shows the road: CV_32FC1, a row per cell, a column per channel.
  cv::Mat Describe(const cv::Mat& band);
  /// Distance of features, CV_32FC1 of the band's size.
  cv::Mat FeatureDistance(const cv::Mat& before, const cv::Mat& after);

  ChangeManifest::RoadLook config_;
  perception::Letterbox letterbox_;
  perception::OnnxGraph graph_;
};

/// Makes each pixel of `probabilities` at least as likely to have changed as `log_odds` says. The
/// change keeps its class; where no class is likelier than another it is `other_objects`.
void RaiseChange(const cv::Mat& log_odds, ChangeProbabilities& probabilities);

}  // namespace livemap::change
