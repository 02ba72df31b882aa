#include "change/registration/road_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "change/registration/change_region.h"
#include "common/error.h"
#include "common/median.h"

namespace livemap::change {
namespace {

constexpr int kAlignmentWidth = 480;    // Pictures are shrunk to it.
constexpr double kLowestRow = 0.86;     // Share of the height; below stands the vehicle's bonnet.
constexpr double kFineStructurePx = 6;  // Larger structure is light and shade.
constexpr double kNoise = 16;           // Variance of grey values that is no structure.
constexpr int kFlowStepX = 3;           // Between points that the homography is fitted to.
constexpr int kFlowStepY = 2;
constexpr int kLeastFlowPoints = 50;
constexpr int kMaxFlowTries = 600;
/// Of the flow to the homography, pixels, in each round.
constexpr std::array<double, 4> kFlowInlierPx{4.0, 3.0, 2.0, 1.5};
constexpr double kLeastShared = 0.5;  // Of the road.

/// One picture, shrunk.
struct RoadView {
  cv::Mat grey;      ///< CV_8UC1.
  cv::Mat levelled;  ///< The same with the contrast of all parts alike.
};

RoadView ShrunkRoadView(const cv::Mat& bgr, cv::Size size) {
  RoadView view;
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::resize(grey, view.grey, size, 0, 0, cv::INTER_AREA);
  cv::createCLAHE(4.0, {8, 4})->apply(view.grey, view.levelled);
  return view;
}

/// CV_32FC1: grey values against their surroundings, in deviations.
cv::Mat FineRoadStructure(const cv::Mat& grey) {
  cv::Mat values;
  grey.convertTo(values, CV_32F);
  cv::Mat around;
  cv::GaussianBlur(values, around, {}, kFineStructurePx);
  values -= around;
  cv::Mat variance;
  cv::GaussianBlur(values.mul(values), variance, {}, kFineStructurePx);
  variance += kNoise;
  cv::sqrt(variance, variance);
  return values / variance;
}

/// CV_8UC1: 255 where a picture has more structure than half of the road has.
cv::Mat StructuredRoad(const cv::Mat& grey, const cv::Mat& road) {
  cv::Mat across;
  cv::Mat down;
  cv::Sobel(grey, across, CV_32F, 1, 0);
  cv::Sobel(grey, down, CV_32F, 0, 1);
  cv::Mat energy;
  cv::GaussianBlur(across.mul(across) + down.mul(down), energy, {}, 2);
  std::vector<float> values;
  for (int y = 0; y < energy.rows; ++y) {
    for (int x = 0; x < energy.cols; ++x) {
      if (road.at<uchar>(y, x) != 0) values.push_back(energy.at<float>(y, x));
    }
  }
  if (values.empty()) return road.clone();
  return (energy > TakeMedian(values)) & road;
}

/// Two views of a road, of which the earlier is moved round by round.
class RoadAligner {
 public:
  RoadAligner(const RoadView& before, const RoadView& after, const cv::Mat& valid)
      : before_(before),
        after_(after),
        valid_(valid),
        road_(ChangeRegionMask("road", after.grey.size())),
        structure_(FineRoadStructure(after.grey)) {
    road_.rowRange(cvRound(kLowestRow * road_.rows), road_.rows).setTo(0);
    candidates_ = StructuredRoad(after.grey, road_);
    flow_ = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
    flow_->setFinestScale(0);
  }

  RoadAlignment Align() {
    RoadAlignment best{cv::Matx33d::eye(), Agreement(cv::Matx33d::eye())};
    cv::Matx33d warp = cv::Matx33d::eye();
    for (const double inlier_px : kFlowInlierPx) {
      if (!Improve(inlier_px, warp)) break;
      const double agreement = Agreement(warp);
      if (agreement > best.agreement) best = {warp, agreement};
    }
    return best;
  }

 private:
  cv::Mat Warped(const cv::Mat& image, const cv::Matx33d& warp, int interpolation) const {
    cv::Mat warped;
    cv::warpPerspective(image, warped, warp, image.size(), interpolation);
    return warped;
  }

  double Agreement(const cv::Matx33d& warp) const {
    const cv::Mat shared = Warped(valid_, warp, cv::INTER_NEAREST) & road_;
    if (cv::countNonZero(shared) < kLeastShared * cv::countNonZero(road_)) return 0;
    cv::Mat mask;
    shared.convertTo(mask, CV_32F, 1.0 / 255);
    const cv::Mat one = FineRoadStructure(Warped(before_.grey, warp, cv::INTER_LINEAR)).mul(mask);
    const cv::Mat other = structure_.mul(mask);
    return one.dot(other) / std::sqrt(one.dot(one) * other.dot(other) + 1e-6);
  }

  /// One round; false where the flow has nothing to say.
  bool Improve(double inlier_px, cv::Matx33d& warp) {
    const cv::Mat known = Warped(valid_, warp, cv::INTER_NEAREST);
    cv::Mat moved = Warped(before_.levelled, warp, cv::INTER_LINEAR);
    after_.levelled.copyTo(moved, known == 0);
    cv::Mat flow;
    flow_->calc(after_.levelled, moved, flow);
    const cv::Mat used = candidates_ & known;
    std::vector<cv::Point2f> from;
    std::vector<cv::Point2f> to;
    for (int y = 0; y < flow.rows; y += kFlowStepY) {
      for (int x = 0; x < flow.cols; x += kFlowStepX) {
        if (used.at<uchar>(y, x) == 0) continue;
        to.emplace_back(static_cast<float>(x), static_cast<float>(y));
        from.push_back(to.back() + cv::Point2f(flow.at<cv::Point2f>(y, x)));
      }
    }
    if (from.size() < kLeastFlowPoints) return false;
    const cv::Mat step =
        cv::findHomography(from, to, cv::RANSAC, inlier_px, cv::noArray(), kMaxFlowTries);
    if (step.empty()) return false;
    warp = cv::Matx33d(step) * warp;
    return true;
  }

  RoadView before_;
  RoadView after_;
  cv::Mat valid_;
  cv::Mat road_;
  cv::Mat structure_;   ///< Of the later view.
  cv::Mat candidates_;  ///< Where flow is believed.
  cv::Ptr<cv::DISOpticalFlow> flow_;
};

void CheckRoadPictures(const cv::Mat& before, const cv::Mat& after, const cv::Mat& valid) {
  if (!after.empty() && after.type() == CV_8UC3 && before.type() == CV_8UC3 &&
      valid.type() == CV_8UC1 && before.size() == after.size() && valid.size() == after.size()) {
    return;
  }
  throw Error("roads to align are of pictures of " + std::to_string(before.cols) + "x" +
              std::to_string(before.rows) + " and " + std::to_string(after.cols) + "x" +
              std::to_string(after.rows) +
              ", accepted are two 8-bit colour pictures of one size with their mask");
}

}  // namespace

RoadAlignment AlignRoad(const cv::Mat& before, const cv::Mat& after, const cv::Mat& valid) {
  CheckRoadPictures(before, after, valid);
  const double shrink = std::min(1.0, static_cast<double>(kAlignmentWidth) / after.cols);
  const cv::Size size(cvRound(shrink * after.cols), cvRound(shrink * after.rows));
  // Windows of the flow need room, and the contrast's parts some pixels each.
  if (size.width < 64 || size.height < 64) return {};
  cv::Mat known;
  cv::resize(valid, known, size, 0, 0, cv::INTER_NEAREST);
  RoadAlignment alignment =
      RoadAligner(ShrunkRoadView(before, size), ShrunkRoadView(after, size), known).Align();
  const cv::Matx33d shrunk(shrink, 0, 0, 0, shrink, 0, 0, 0, 1);
  cv::Matx33d& warp = alignment.after_from_before;
  warp = shrunk.inv() * warp * shrunk;
  warp *= 1 / warp(2, 2);
  return alignment;
}

}  // namespace livemap::change
