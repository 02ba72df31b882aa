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
/// More than these are no street: then the whole picture is masked.
constexpr std::size_t kMaxRegions = 100;

cv::Rect Grown(const cv::Rect& box, double share) {
  const int x = cvCeil(box.width * share / 2);
  const int y = cvCeil(box.height * share / 2);
  return {box.x - x, box.y - y, box.width + 2 * x, box.height + 2 * y};
}

double Overlap(const cv::Rect& a, const cv::Rect& b) {
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

void PrivacyMask::Apply(cv::Mat& bgr, std::uint64_t frame, const cv::Rect& part) {
  const cv::Rect image({}, bgr.size());
  if (bgr.empty() || bgr.type() != CV_8UC3) {
    throw Error("only images of 8 bit and 3 channels can be masked");
  }
  if (part.empty() || (part & image) != part) {
    throw Error("the part of a picture that is wanted does not lie in it");
  }
  const std::vector<cv::Rect> found = finder_->Find(bgr, part);
  if (part != image) PixelateAround(bgr, part);
  const auto is_over = [&](const Region& region) {
    const bool too_old =
        frame - region.found_at > static_cast<std::uint64_t>(std::max(0, config_.keep_frames));
    return too_old || std::any_of(found.begin(), found.end(), [&](const cv::Rect& box) {
             return Overlap(Grown(box, config_.grow), region.box) >= kSameRegionOverlap;
           });
  };
  regions_.erase(std::remove_if(regions_.begin(), regions_.end(), is_over), regions_.end());
  for (Region& region : regions_) region.box = Grown(region.box, kGrowthPerFrame);
  for (const cv::Rect& box : found) regions_.push_back({Grown(box, config_.grow), frame});
  if (regions_.size() > kMaxRegions) regions_ = {{cv::Rect({}, bgr.size()), frame}};
  for (const Region& region : regions_) Pixelate(bgr, region.box);
}

std::vector<cv::Rect> PrivacyMask::Masked() const {
  std::vector<cv::Rect> boxes;
  for (const Region& region : regions_) boxes.push_back(region.box);
  return boxes;
}

}  // namespace livemap::perception
