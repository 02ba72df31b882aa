#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "imaging/box.h"
#include "imaging/picture_marks.h"

namespace livemap::imaging {

/// An image that others own: `owner` keeps the pixels alive, so that nothing is copied.
struct Picture {
  cv::Mat bgr;  ///< 8-bit, three channels, blue first.
  std::shared_ptr<const void> owner;
};

/// The least region that contains both.
PixelRegion Union(const PixelRegion& a, const PixelRegion& b);

/// The picture as a JPEG file of at most `max_bytes`: first at `quality` (1..100), then at lower
/// ones, then at half the size and so on. Empty when there is no picture, when it is not 8-bit with
/// three channels, or when even a thumbnail of 64 pixels is too large.
std::vector<std::uint8_t> EncodeJpeg(const Picture& picture, int quality, std::size_t max_bytes);

/// How the part of an image around a hazard becomes a picture.
struct CropConfig {
  std::size_t max_bytes = 12000;  ///< Of the JPEG.
  int quality = 80;               ///< 1..100; lowered where the bytes want it.
  /// The picture shows this many times the box's sides around it, at least kMinCropPx; 0: the
  /// whole image.
  double context = 3.0;
};
/// What a legible picture keeps to: the shorter side of the box has at least so many pixels, or as
/// many as in the original where those are fewer...
constexpr int kLegibleSidePx = 32;
/// ...and no lower JPEG quality than this...
constexpr int kLegibleQuality = 40;
/// ...or than this, where the picture is kMinCropPx wide: rather a coarser picture than a smaller
/// one.
constexpr int kWideQuality = 25;
/// Width of the part that is shown with all its surroundings, and of its picture, where the image
/// has as much: so much a person needs to judge by it.
constexpr int kMinCropPx = 480;

/// A hazard's picture and what of the original image it shows.
struct CroppedPicture {
  std::vector<std::uint8_t> jpeg;  ///< Empty where there is none.
  PixelRegion shown;
  double scale = 1;  ///< Pixels of the picture per pixel of the original, at most 1.
  int quality = 0;   ///< Of the JPEG.
  bool legible = false;
};

/// All that CropPicture may show of an image of `width` x `height` pixels around `box`; the whole
/// image where it would show that.
PixelRegion WidestCrop(const Box& box, int width, int height, const CropConfig& config);

/// The surroundings of `box`, 3 to 2, within the image, as a JPEG of at most `max_bytes`. What the
/// bytes do not allow is given up in this order: quality down to kLegibleQuality, pixels down to
/// kMinCropPx of width, quality down to kWideQuality, pixels down to kLegibleSidePx of the box,
/// surroundings down to one and a half times the box. A budget that
/// even this exceeds gives a picture that is not legible, or none. Also none where there is no
/// picture, as for EncodeJpeg. A box that does not meet the image shows the whole of it. The marks
/// are drawn into the picture alone, once it has its size; null: none are.
CroppedPicture CropPicture(const Picture& picture, const Box& box, const CropConfig& config,
                           const PictureMarks* marks = nullptr);

}  // namespace livemap::imaging
