#include "perception/privacy/picture_masker.h"

#include <exception>
#include <utility>

#include "common/error.h"

namespace livemap::perception {

PictureMasker::PictureMasker(const Config& config)
    : mask_(config.privacy ? std::make_unique<PrivacyMask>(config.mask) : nullptr) {}

PictureMasker::PictureMasker(std::unique_ptr<PrivacyMask> mask) : mask_(std::move(mask)) {
  if (!mask_) throw Error("pictures cannot be masked without a mask");
}

PictureMasker::Masked PictureMasker::Mask(const cv::Mat& bgr, const cv::Rect& part) {
  const MutexLock lock(mutex_);
  if (!mask_) return {bgr, ""};
  try {
    Masked masked{bgr.clone(), ""};
    mask_->Apply(masked.bgr, frame_, part);
    counters_.masked_regions += mask_->Masked().size();
    return masked;
  } catch (const std::exception& error) {
    ++counters_.withheld;
    return {cv::Mat(), error.what()};
  }
}

PictureMasker::Counters PictureMasker::counters() const {
  const MutexLock lock(mutex_);
  return counters_;
}

}  // namespace livemap::perception
