#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "imaging/report_picture.h"
#include "perception/privacy/picture_masker.h"
#include "vehicle/pictures/picture_order.h"

namespace livemap::nodelets {

/// Makes the pictures of reports and answers of the camera's images: faces and number plates are
/// masked, then the parts are cut out, marked with boxes and encoded. It fails closed: an
/// image that cannot be masked makes no picture. Thread-safe, one Make at a time.
///
/// Typical usage: CountFrame for every image of the camera, whose number goes with the image
/// (vehicle::CameraImage::number); Make for the orders.
class PictureMaker {
 public:
  /// Throws Error when a detector of faces or plates cannot be loaded. `log_name` stands before
  /// what is said of withheld pictures. `draws_boxes`: false for pictures to train on.
  PictureMaker(const perception::PictureMasker::Config& config, std::string log_name,
               bool draws_boxes = true);

  /// An image came from the camera, whether or not a picture of it is wanted. Its number.
  std::uint64_t CountFrame() { return masker_.CountFrame(); }
  /// One picture for each cut of the order; nothing at all when the image is withheld. What lies
  /// beyond all cuts is pixelated in the picture from which they are cut.
  std::vector<imaging::CroppedPicture> Make(const vehicle::PictureOrder& order);

  const perception::PictureMasker& masker() const { return masker_; }
  perception::PictureMasker::Counters counters() const { return masker_.counters(); }

 private:
  const std::string log_name_;
  const bool draws_boxes_;
  perception::PictureMasker masker_;
};

}  // namespace livemap::nodelets
