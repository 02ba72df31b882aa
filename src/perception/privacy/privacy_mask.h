#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "perception/privacy/private_region_finder.h"

namespace livemap::perception {

/// Makes faces and number plates unrecognisable in pictures before they leave the car. It fails
/// closed: a picture is masked, or Apply throws and the picture must not be sent. Not thread-safe.
class PrivacyMask {
 public:
  struct Config {
    PrivateRegionConfig regions;
    /// A region is masked this much larger than it was found, as a share of its sides.
    double grow = 0.25;
    /// One that is not found any more stays masked for this many frames, growing on.
    int keep_frames = 10;
  };

  /// Throws Error when a detector cannot be loaded.
  explicit PrivacyMask(const Config& config);
  /// With another finder.
  PrivacyMask(const Config& config, std::unique_ptr<PrivateRegionFinder> finder);

  /// Masks `bgr` (8 bit, 3 channels) in place. `frame` counts the camera's frames, also those that
  /// nobody wants a picture of; it never falls. Throws Error when it cannot: the picture is then to
  /// be thrown away.
  void Apply(cv::Mat& bgr, std::uint64_t frame);
  /// The same where only `part`, inside `bgr`, is wanted, in two thirds of the time: everything
  /// around it is pixelated, whatever it shows.
  void Apply(cv::Mat& bgr, std::uint64_t frame, const cv::Rect& part);

  /// What the last call masked, px; without all that lies around a part.
  std::vector<cv::Rect> Masked() const;

 private:
  struct Region {
    cv::Rect box;
    std::uint64_t found_at = 0;
  };

  Config config_;
  std::unique_ptr<PrivateRegionFinder> finder_;
  std::vector<Region> regions_;
};

/// Coarse blocks instead of the pixels of `region`, at most kMaskCells along its shorter side: what
/// is left has fewer points than a face or a plate needs to be told from another.
void Pixelate(cv::Mat& bgr, const cv::Rect& region);
constexpr int kMaskCells = 5;

}  // namespace livemap::perception
