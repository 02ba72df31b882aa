#include "perception/privacy/picture_masker.h"

#include <exception>
#include <utility>

#include "common/error.h"

namespace livemap::perception {

PictureMasker::PictureMasker(const Config& config) : finder_("nothing") {
  if (!config.privacy) return;
  auto mask = std::make_unique<PrivacyMask>(config.mask);
  finder_ = mask->FinderName();
  mask_ = std::move(mask);
}

PictureMasker::PictureMasker(std::unique_ptr<PrivacyMask> mask)
    : finder_(mask ? mask->FinderName() : ""), mask_(std::move(mask)) {
  if (!mask_) throw Error("pictures cannot be masked without a mask");
}

PictureMasker::Masked PictureMasker::Mask(const cv::Mat& bgr, std::uint64_t frame,
                                          const cv::Rect& part,
                                          const std::vector<cv::Rect>& subjects) {
  const MutexLock lock(mutex_);
  if (!mask_) return {bgr, ""};
  try {
    Masked masked{bgr.clone(), ""};
    mask_->Apply(masked.bgr, frame, part, subjects);
    masked_regions_ += mask_->Masked().size();
    return masked;
  } catch (const std::exception& error) {
    ++withheld_;
    return {cv::Mat(), error.what()};
  }
}

}  // namespace livemap::perception
