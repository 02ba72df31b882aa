#include "vehicle/pictures/picture_order.h"

#include <optional>

namespace livemap::vehicle {

imaging::PixelRegion VisibleRegion(const PictureOrder& order) {
  const cv::Mat& bgr = order.image.picture.bgr;
  std::optional<imaging::PixelRegion> shown;
  for (const PictureOrder::Cut& cut : order.cuts) {
    const imaging::PixelRegion part =
        imaging::WidestCrop(cut.subject, bgr.cols, bgr.rows, cut.crop);
    shown = shown ? imaging::Union(*shown, part) : part;
  }
  return shown.value_or(imaging::PixelRegion{});
}

std::vector<imaging::CroppedPicture> CutPictures(const PictureOrder& order,
                                                 const cv::Mat& masked_bgr, bool draws_boxes) {
  const imaging::Picture masked{masked_bgr, nullptr};
  imaging::PictureMarks marks;
  for (const placement::Sighting& each : order.image.sightings) marks.others.push_back(each.box);
  std::vector<imaging::CroppedPicture> pictures;
  for (const PictureOrder::Cut& cut : order.cuts) {
    marks.subject = cut.subject;
    marks.label = cut.label;
    pictures.push_back(
        imaging::CropPicture(masked, cut.subject, cut.crop, draws_boxes ? &marks : nullptr));
  }
  return pictures;
}

}  // namespace livemap::vehicle
