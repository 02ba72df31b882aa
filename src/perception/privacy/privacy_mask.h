#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perception/privacy/private_region_finder.h"

namespace livemap::perception {

/// Makes faces and number plates unrecognisable in pictures before they leave the car. It fails
/// closed: a picture is masked, or Apply throws and the picture must not be sent. Not thread-safe.
///
/// What a picture is about, its subjects, is worth more than a doubtful find: there only what is
/// surely a face or a plate is masked.
class PrivacyMask {
 public:
  struct Config {
    PrivateRegionConfig regions;
    /// A region is masked this much larger than it was found, as a share of its sides.
    double grow = 0.25;
    /// One that is not found any more stays masked for this many frames, growing on; in pictures of
    /// so many frames before it was found, too.
    int keep_frames = 10;
  };

  /// Throws Error when a detector cannot be loaded.
  explicit PrivacyMask(const Config& config);
  /// With another finder.
  PrivacyMask(const Config& config, std::unique_ptr<PrivateRegionFinder> finder);

  /// Masks `bgr` (8 bit, 3 channels) in place. `frame` is the number of the camera's frame that it
  /// shows, those counted that nobody wants a picture of; pictures may be wanted in another order.
  /// Throws Error when it cannot: the picture is then to be thrown away.
  void Apply(cv::Mat& bgr, std::uint64_t frame);
  /// The same where only `part`, inside `bgr`, is wanted, in two thirds of the time: everything
  /// around it is pixelated, whatever it shows. `subjects` are what the picture is about, px; they
  /// may reach beyond the picture.
  void Apply(cv::Mat& bgr, std::uint64_t frame, const cv::Rect& part,
             const std::vector<cv::Rect>& subjects = {});

  /// What looks for faces and plates: PrivateRegionFinder::Name.
  std::string FinderName() const { return finder_->Name(); }

  /// What the last call masked, px; without all that lies around a part, and with what it left
  /// clear of the subjects.
  std::vector<cv::Rect> Masked() const;
  /// Of these, the surely found ones, which are masked over subjects too.
  std::vector<cv::Rect> SurelyMasked() const;

 private:
  struct Region {
    cv::Rect box;
    bool is_sure = false;
    std::uint64_t found_at = 0;
  };

  void Remember(const std::vector<PrivateRegion>& found, std::uint64_t frame);
  void MaskRegions(cv::Mat& bgr, const std::vector<cv::Rect>& subjects) const;

  Config config_;
  std::unique_ptr<PrivateRegionFinder> finder_;
  std::vector<Region> regions_;  ///< Of the last picture.
  std::vector<Region> later_;    ///< Of frames too long after that of the last picture.
};

/// Coarse blocks instead of the pixels of `region`, at most kMaskCells along its shorter side: what
/// is left has fewer points than a face or a plate needs to be told from another.
void Pixelate(cv::Mat& bgr, const cv::Rect& region);
constexpr int kMaskCells = 5;

}  // namespace livemap::perception
