#include "nodelets/hazard_reporting/picture_maker.h"

#include <ros/console.h>

#include <algorithm>
#include <utility>

#include "nodelets/nodelet_support.h"

namespace livemap::nodelets {
namespace {

/// The pixels of the image that the box touches.
cv::Rect PixelsOf(const imaging::Box& box, const cv::Size& image) {
  // Written so that NaN is 0.
  const auto within = [](float edge, int length) {
    return std::max(0.0F, std::min(edge, static_cast<float>(length)));
  };
  const cv::Point first(cvFloor(within(box.x_min, image.width)),
                        cvFloor(within(box.y_min, image.height)));
  const cv::Point end(cvCeil(within(box.x_max, image.width)),
                      cvCeil(within(box.y_max, image.height)));
  return {first, end};
}

/// The part of `bgr` in whole pixels.
cv::Rect ToRect(const imaging::PixelRegion& part, const cv::Mat& bgr) {
  if (part.IsWholeImage()) return {{}, bgr.size()};
  return {static_cast<int>(part.x), static_cast<int>(part.y), static_cast<int>(part.width),
          static_cast<int>(part.height)};
}

}  // namespace

PictureMaker::PictureMaker(const perception::PictureMasker::Config& config, std::string log_name,
                           bool draws_boxes)
    : log_name_(std::move(log_name)), draws_boxes_(draws_boxes), masker_(config) {}

std::vector<imaging::CroppedPicture> PictureMaker::Make(const vehicle::PictureOrder& order) {
  const cv::Mat& bgr = order.image.picture.bgr;
  std::vector<cv::Rect> subjects;
  for (const vehicle::PictureOrder::Cut& cut : order.cuts) {
    subjects.push_back(PixelsOf(cut.subject, bgr.size()));
  }
  const perception::PictureMasker::Masked masked =
      masker_.Mask(bgr, order.image.number, ToRect(vehicle::VisibleRegion(order), bgr), subjects);
  if (masked.bgr.empty()) {
    ROS_ERROR_THROTTLE(kSayAgainS, "%s: a picture is withheld: %s", log_name_.c_str(),
                       masked.why_withheld.c_str());
    return {};
  }
  return vehicle::CutPictures(order, masked.bgr, draws_boxes_);
}

}  // namespace livemap::nodelets
