#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "imaging/box.h"
#include "imaging/report_picture.h"
#include "placement/sighting.h"

namespace livemap::vehicle {

/// An image of the vehicle's camera as the camera saw it, with what the detector found in it. It
/// must not leave the vehicle: only what a picture maker makes of it may.
struct CameraImage {
  imaging::Picture picture;  ///< Empty where the image is not there.
  std::vector<placement::Sighting> sightings;
  /// Which one of the camera's images it is: masks are kept for a number of images.
  std::uint64_t number = 0;

  bool IsMissing() const { return picture.bgr.empty(); }
};

/// The pictures that one report or answer wants of one image.
struct PictureOrder {
  /// One picture, cut out of the masked image.
  struct Cut {
    imaging::Box subject;      ///< What the picture is about, px; without area the whole image.
    imaging::CropConfig crop;  ///< How much of its surroundings, in how many bytes.
    std::string label;         ///< What is written at the subject's box.
  };

  /// By which the orderer knows the answer.
  std::uint64_t number = 0;
  CameraImage image;
  std::vector<Cut> cuts;
};

/// The least part of the order's image that contains all that its pictures may show.
imaging::PixelRegion VisibleRegion(const PictureOrder& order);

/// The pictures of `order` out of its image once that may leave the vehicle: one for each cut, in
/// their order. With `draws_boxes` the cut's subject is marked loudly, and what else the detector
/// found faintly. A cut whose bytes do not suffice has an empty picture.
std::vector<imaging::CroppedPicture> CutPictures(const PictureOrder& order,
                                                 const cv::Mat& masked_bgr, bool draws_boxes);

}  // namespace livemap::vehicle
