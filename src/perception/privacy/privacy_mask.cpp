#include "perception/privacy/privacy_mask.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/error.h"

namespace livemap::perception {
namespace {

constexpr double kSameRegionOverlap = 0.2;
/// Per frame that a kept region was not found: it may move.
constexpr double kGrowthPerFrame = 0.05;
/// With more than these the whole picture is masked.
constexpr std::size_t kMaxRegions = 100;

cv::Rect GrownMask(const cv::Rect& box, double share) {
  const int x = cvCeil(box.width * share / 2);
  const int y = cvCeil(box.height * share / 2);
  return {box.x - x, box.y - y, box.width + 2 * x, box.height + 2 * y};
}

double OverlapOf(const cv::Rect& a, const cv::Rect& b) {
  const double common = (a & b).area();
  return common / (a.area() + b.area() - common);
}

}  // namespace

void Pixelate(cv::Mat& bgr, const cv::Rect& region) {
  const cv::Rect inside = region & cv::Rect({}, bgr.size());
  if (inside.empty()) return;
  const double block = std::max(1.0, std::min(region.width, region.height) / double{kMaskCells});
  const cv::Size cells(std::max(1, cvFloor(inside.width / block)),
                       std::max(1, cvFloor(inside.height / block)));
  cv::Mat part = bgr(inside);
  cv::Mat coarse;
  cv::resize(part, coarse, cells, 0, 0, cv::INTER_AREA);
  cv::resize(coarse, part, inside.size(), 0, 0, cv::INTER_NEAREST);
}

namespace {

void PixelateAround(cv::Mat& bgr, const cv::Rect& part) {
  const cv::Mat clear = bgr(part).clone();
  Pixelate(bgr, cv::Rect({}, bgr.size()));
  clear.copyTo(bgr(part));
}

}  // namespace

PrivacyMask::PrivacyMask(const Config& config)
    : PrivacyMask(config, MakePrivateRegionFinder(config.regions)) {}

PrivacyMask::PrivacyMask(const Config& config, std::unique_ptr<PrivateRegionFinder> finder)
    : config_(config), finder_(std::move(finder)) {
  if (!finder_) throw Error("pictures cannot be masked without a finder of faces and plates");
}

void PrivacyMask::Apply(cv::Mat& bgr, std::uint64_t frame) {
  Apply(bgr, frame, cv::Rect({}, bgr.size()));
}

void PrivacyMask::Apply(cv::Mat& bgr, std::uint64_t frame, const cv::Rect& part,
                        const std::vector<cv::Rect>& subjects) {
  const cv::Rect image({}, bgr.size());
  if (bgr.empty() || bgr.type() != CV_8UC3) {
    throw Error("only images of 8 bit and 3 channels can be masked");
  }
  if (part.empty() || (part & image) != part) {
    throw Error("the part of a picture that is wanted does not lie in it");
  }
  const std::vector<PrivateRegion> found = finder_->Find(bgr, part);
  if (part != image) PixelateAround(bgr, part);
  Remember(found, frame);
  // More than these are no street.
  if (regions_.size() > kMaxRegions) regions_ = {{image, /*is_sure=*/true, frame}};
  MaskRegions(bgr, subjects);
}

/// Doubtful regions first, so that a sure one stays masked where both lie over a subject.
void PrivacyMask::MaskRegions(cv::Mat& bgr, const std::vector<cv::Rect>& subjects) const {
  std::vector<std::pair<cv::Rect, cv::Mat>> clear;
  for (const cv::Rect& subject : subjects) {
    const cv::Rect inside = subject & cv::Rect({}, bgr.size());
    if (!inside.empty()) clear.emplace_back(inside, bgr(inside).clone());
  }
  for (const Region& region : regions_) {
    if (!region.is_sure) Pixelate(bgr, region.box);
  }
  for (const auto& [subject, pixels] : clear) pixels.copyTo(bgr(subject));
  for (const Region& region : regions_) {
    if (region.is_sure) Pixelate(bgr, region.box);
  }
}

/// Keeps what was found before and is not found again, for a while. What was sure stays so.
void PrivacyMask::Remember(const std::vector<PrivateRegion>& found, std::uint64_t frame) {
  std::vector<Region> now;
  for (const PrivateRegion& each : found) {
    now.push_back({GrownMask(each.box, config_.grow), each.is_sure, frame});
  }
  const auto keep_frames = static_cast<std::uint64_t>(std::max(0, config_.keep_frames));
  std::vector<Region> known = std::move(regions_);
  known.insert(known.end(), later_.begin(), later_.end());
  later_.clear();
  for (const Region& before : known) {
    const bool is_later = before.found_at > frame;
    if ((is_later ? before.found_at - frame : frame - before.found_at) > keep_frames) {
      if (is_later) later_.push_back(before);
      continue;
    }
    bool is_found_again = false;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (OverlapOf(now[i].box, before.box) < kSameRegionOverlap) continue;
      is_found_again = true;
      now[i].is_sure = now[i].is_sure || before.is_sure;
      now[i].found_at = std::max(now[i].found_at, before.found_at);
    }
    if (is_found_again) continue;
    now.push_back({GrownMask(before.box, kGrowthPerFrame), before.is_sure, before.found_at});
  }
  regions_ = std::move(now);
}

std::vector<cv::Rect> PrivacyMask::Masked() const {
  std::vector<cv::Rect> boxes;
  for (const Region& region : regions_) boxes.push_back(region.box);
  return boxes;
}

std::vector<cv::Rect> PrivacyMask::SurelyMasked() const {
  std::vector<cv::Rect> boxes;
  for (const Region& region : regions_) {
    if (region.is_sure) boxes.push_back(region.box);
  }
  return boxes;
}

}  // namespace livemap::perception
