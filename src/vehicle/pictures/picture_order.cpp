#include "vehicle/pictures/picture_order.h"

#include <optional>

namespace livemap::vehicle {

imaging::PixelRegion VisibleRegion(const PictureOrder& order) {
  const cv::Mat& bgr = order.image.picture.bgr;
  std::optional<imaging::PixelRegion> shown;
  for (const PictureOrder::Cut& cut : order.cuts) {
    const imaging::PixelRegion part =
        cut.is_whole_image ? imaging::PixelRegion{}
                           : imaging::WidestCrop(cut.subject, bgr.cols, bgr.rows, cut.crop);
    shown = shown ? imaging::Union(*shown, part) : part;
  }
  return shown.value_or(imaging::PixelRegion{});
}

std::vector<imaging::CroppedPicture> CutPictures(const PictureOrder& order,
                                                 const cv::Mat& masked_bgr) {
  std::vector<imaging::CroppedPicture> pictures;
  for (const PictureOrder::Cut& cut : order.cuts) {
    const imaging::Picture masked{masked_bgr, nullptr};
    if (cut.is_whole_image) {
      imaging::CroppedPicture whole;
      whole.jpeg = imaging::EncodeJpeg(masked, cut.crop.quality, cut.crop.max_bytes);
      whole.legible = !whole.jpeg.empty();
      pictures.push_back(std::move(whole));
    } else {
      pictures.push_back(imaging::CropPicture(masked, cut.subject, cut.crop));
    }
  }
  return pictures;
}

}  // namespace livemap::vehicle
