#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "perception/privacy/privacy_mask.h"

namespace livemap::perception {

/// The one way by which pictures leave the vehicle: faces and number plates are masked in a copy of
/// the camera's image. It fails closed: a picture that cannot be masked is withheld. Thread-safe.
///
/// Typical usage: CountFrame for every image of the camera, as it comes; Mask, with the number that
/// it gave, for those of which a picture is wanted, before anything is drawn into it or cut out of
/// it.
class PictureMasker {
 public:
  struct Config {
    bool privacy = true;  ///< False: pictures leave as the camera saw them.
    PrivacyMask::Config mask;
  };

  struct Masked {
    cv::Mat bgr;               ///< Empty when the picture is withheld.
    std::string why_withheld;  ///< Valid when it is.
  };

  struct Counters {
    std::uint64_t masked_regions = 0;  ///< Over all pictures.
    std::uint64_t withheld = 0;        ///< Pictures that could not be masked.
  };

  /// Throws Error when a detector of faces or plates cannot be loaded.
  explicit PictureMasker(const Config& config);
  /// With another mask; throws Error when there is none.
  explicit PictureMasker(std::unique_ptr<PrivacyMask> mask);

  /// An image came from the camera, whether or not a picture of it is wanted: masks are kept for a
  /// number of images. The number of the image.
  std::uint64_t CountFrame() { return ++frame_; }
  /// `bgr` (8 bit, 3 channels), the image of number `frame`, as it may leave the vehicle, with all
  /// but `part` made unrecognisable too. Over the `subjects`, the boxes of what the picture is
  /// about, only sure faces and plates are masked. Without privacy the result shares the pixels of
  /// `bgr`; else it has its own.
  Masked Mask(const cv::Mat& bgr, std::uint64_t frame, const cv::Rect& part,
              const std::vector<cv::Rect>& subjects = {});

  /// What looks for faces and plates: "networks", "cascades", or "nothing" without privacy.
  const std::string& finder() const { return finder_; }

  /// Never waits for a picture that is being masked.
  Counters counters() const { return {masked_regions_, withheld_}; }

 private:
  std::string finder_;
  std::atomic<std::uint64_t> frame_{0};
  std::atomic<std::uint64_t> masked_regions_{0};
  std::atomic<std::uint64_t> withheld_{0};
  Mutex mutex_;
  /// None: privacy is off.
  std::unique_ptr<PrivacyMask> mask_ GUARDED_BY(mutex_) PT_GUARDED_BY(mutex_);
};

}  // namespace livemap::perception
