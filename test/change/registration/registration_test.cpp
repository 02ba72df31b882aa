#include "change/registration/registration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <random>

#include "change/registration/robust_fit.h"
#include "common/error.h"
#include "test/change/simulated_pairs.h"

namespace livemap::change {
namespace {

FeaturedView View(const cv::Mat& bgr) { return {bgr.size(), ExtractFeatures(bgr)}; }

Registration Register(const simulation::SimulatedFrame& before,
                      const simulation::SimulatedFrame& after, std::uint64_t seed = 1) {
  return RegisterByHomography(View(before.bgr), View(after.bgr), RegistrationConfig(), seed);
}

const geo::CameraIntrinsics& Camera() {
  static const geo::CameraIntrinsics camera = PairCamera().intrinsics;
  return camera;
}

Registration RegisterWithDepth(const SimulatedPair& pair, const cv::Mat& depth) {
  return RegisterByDepth(View(pair.before.bgr), Camera(), View(pair.after.bgr), Camera(), depth,
                         RegistrationConfig(), 1);
}

const std::vector<SimulatedPair>& DayPairs() {
  static const std::vector<SimulatedPair> pairs = MakePairs({});
  return pairs;
}

/// Distances in pixels of the earlier picture between where a homography and where the truth takes
/// a pixel from; only of pixels whose place the earlier picture holds. Sorted.
std::vector<double> HomographyErrorsPx(const SimulatedPair& pair, const cv::Matx33d& h) {
  const cv::Matx33d before_from_after = h.inv();
  std::vector<double> errors;
  for (int row = 0; row < Camera().height; row += 4) {
    for (int column = 0; column < Camera().width; column += 4) {
      const cv::Point2d truth = TruePlace(pair, Camera(), column, row);
      if (!(truth.x >= 0 && truth.y >= 0 && truth.x < Camera().width &&
            truth.y < Camera().height)) {
        continue;
      }
      const cv::Vec3d place = before_from_after * cv::Vec3d(column, row, 1);
      errors.push_back(std::hypot(place[0] / place[2] - truth.x, place[1] / place[2] - truth.y));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

/// The same of a pose.
std::vector<double> PoseErrorsPx(const SimulatedPair& pair, const Eigen::Isometry3d& pose) {
  SimulatedPair estimated = pair;
  estimated.before.world_from_optical = pair.after.world_from_optical * pose.inverse();
  std::vector<double> errors;
  for (int row = 0; row < Camera().height; row += 4) {
    for (int column = 0; column < Camera().width; column += 4) {
      const cv::Point2d truth = TruePlace(pair, Camera(), column, row);
      if (!(truth.x >= 0 && truth.y >= 0 && truth.x < Camera().width &&
            truth.y < Camera().height)) {
        continue;
      }
      const cv::Point2d place = TruePlace(estimated, Camera(), column, row);
      errors.push_back(std::hypot(place.x - truth.x, place.y - truth.y));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double QuantileOf(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

TEST(RegistrationByHomography, FitsPicturesOfOnePlaceAsAPlaneCan) {
  int accepted = 0;
  for (const SimulatedPair& pair : DayPairs()) {
    const Registration registration = Register(pair.before, pair.after);
    if (!registration.accepted()) continue;
    ++accepted;
    EXPECT_GT(registration.overlap, 0.5);
    const std::vector<double> errors = HomographyErrorsPx(pair, registration.after_from_before);
    std::printf("homography: quantiles 0.1 %.1f px, 0.5 %.1f px, 0.9 %.1f px, %zu of %zu matches\n",
                QuantileOf(errors, 0.1), QuantileOf(errors, 0.5), QuantileOf(errors, 0.9),
                registration.inliers, registration.matches);
    // One plane cannot fit a street. The one it is has to lie in the picture, and nothing is torn.
    EXPECT_LT(QuantileOf(errors, 0.1), 5);
    EXPECT_LT(QuantileOf(errors, 0.5), 40);
  }
  EXPECT_GE(accepted, 2);
}

TEST(RegistrationByHomography, IsTheSameForTheSameSeed) {
  const SimulatedPair& pair = DayPairs()[0];
  const FeaturedView before = View(pair.before.bgr);
  const FeaturedView after = View(pair.after.bgr);
  const auto once = RegisterByHomography(before, after, RegistrationConfig(), 5);
  const auto again = RegisterByHomography(before, after, RegistrationConfig(), 5);
  EXPECT_EQ(once.after_from_before, again.after_from_before);
  EXPECT_EQ(once.inliers, again.inliers);
}

TEST(RegistrationByHomography, FindsAKnownHomographyToATenthOfAPixel) {
  const cv::Mat& image = DayPairs()[1].after.bgr;
  const cv::Matx33d truth{1.03, 0.02, -6, -0.01, 0.99, 4, 2e-5, -1e-5, 1};
  cv::Mat warped;
  cv::warpPerspective(image, warped, truth, image.size());
  const Registration registration =
      RegisterByHomography(View(image), View(warped), RegistrationConfig(), 1);
  ASSERT_TRUE(registration.accepted()) << registration.why;
  for (const cv::Vec3d& corner :
       {cv::Vec3d(60, 60, 1), {450, 60, 1}, {60, 320, 1}, {450, 320, 1}}) {
    const cv::Vec3d expected = truth * corner;
    const cv::Vec3d found = registration.after_from_before * corner;
    EXPECT_NEAR(found[0] / found[2], expected[0] / expected[2], 0.1);
    EXPECT_NEAR(found[1] / found[2], expected[1] / expected[2], 0.1);
  }
}

TEST(RegistrationByHomography, RefusesOtherPlaces) {
  SimulatedPairOptions other;
  other.seed = 29;
  const std::vector<SimulatedPair> elsewhere = MakePairs(other);
  int tried = 0;
  for (const SimulatedPair& here : DayPairs()) {
    for (const SimulatedPair& there : elsewhere) {
      const Registration registration = Register(there.before, here.after);
      EXPECT_FALSE(registration.accepted()) << registration.inliers << " inliers";
      EXPECT_FALSE(registration.why.empty());
      ++tried;
    }
  }
  EXPECT_EQ(tried, 16);
}

TEST(RegistrationByHomography, RefusesPicturesWithoutTexture) {
  const cv::Mat grey(384, 512, CV_8UC3, cv::Scalar::all(128));
  const Registration registration =
      RegisterByHomography(View(grey), View(DayPairs()[0].after.bgr), RegistrationConfig(), 1);
  EXPECT_EQ(registration.refusal, RegistrationRefusal::kTexture);
  EXPECT_THAT(registration.why, testing::HasSubstr("0 features"));
}

TEST(RegistrationByHomography, RefusesAPictureOfAnotherSize) {
  const cv::Mat& image = DayPairs()[0].after.bgr;
  cv::Mat smaller;
  cv::resize(image, smaller, cv::Size(480, 360));
  const Registration registration =
      RegisterByHomography(View(smaller), View(image), RegistrationConfig(), 1);
  EXPECT_EQ(registration.refusal, RegistrationRefusal::kSize);
  EXPECT_THAT(registration.why,
              testing::AllOf(testing::HasSubstr("480x360"), testing::HasSubstr("512x384")));
}

TEST(RegistrationByHomography, RefusesMirroredTurnedAndMagnifiedPictures) {
  const cv::Mat& image = DayPairs()[1].after.bgr;
  cv::Mat mirrored;
  cv::flip(image, mirrored, 1);
  EXPECT_FALSE(
      RegisterByHomography(View(image), View(mirrored), RegistrationConfig(), 1).accepted());
  const auto after = [&](const cv::Matx33d& h) {
    cv::Mat warped;
    cv::warpPerspective(image, warped, h, image.size());
    return RegisterByHomography(View(image), View(warped), RegistrationConfig(), 1);
  };
  const Registration turned = after({0.85, -0.52, 120, 0.52, 0.85, -90, 0, 0, 1});
  EXPECT_EQ(turned.refusal, RegistrationRefusal::kDegenerate) << turned.why;
  EXPECT_THAT(turned.why, testing::HasSubstr("turns"));
  const Registration larger = after({2, 0, -250, 0, 2, -190, 0, 0, 1});
  EXPECT_EQ(larger.refusal, RegistrationRefusal::kDegenerate) << larger.why;
  EXPECT_THAT(larger.why, testing::HasSubstr("scales"));
  const Registration shifted = after({1, 0, 300, 0, 1, 0, 0, 0, 1});
  EXPECT_EQ(shifted.refusal, RegistrationRefusal::kOverlap) << shifted.why;
  const Registration corner = RegisterByHomography(View(image), View([&] {
                                                     // Only a corner of the picture is the same.
                                                     cv::Mat mixed =
                                                         DayPairs()[3].after.bgr.clone();
                                                     const cv::Rect part(0, 0, 110, 110);
                                                     image(part).copyTo(mixed(part));
                                                     return mixed;
                                                   }()),
                                                   RegistrationConfig(), 1);
  EXPECT_FALSE(corner.accepted());
}

TEST(RobustFit, AgreesWithNothingWhenThereIsNothingToAgreeOn) {
  std::mt19937_64 random(3);
  std::vector<cv::Point2d> a;
  std::vector<cv::Point2d> b;
  for (int i = 0; i < 60; ++i) {
    a.emplace_back(static_cast<double>(random() % 640), static_cast<double>(random() % 480));
    b.emplace_back(static_cast<double>(random() % 640), static_cast<double>(random() % 480));
  }
  EXPECT_LT(FitHomography(a, b, 3, 500, 1).fit.inliers.size(), 10U);
  EXPECT_TRUE(FitHomography({}, {}, 3, 500, 1).fit.inliers.empty());
  EXPECT_TRUE(FitPose({}, {}, Camera(), 3, 500, 1).fit.inliers.empty());
}

TEST(RegistrationByDepth, FindsThePoseAndBeatsTheHomographyWhereThereIsParallax) {
  SimulatedPairOptions options;
  options.left_m = 1.0;
  options.behind_m = 0.5;
  int accepted = 0;
  for (const SimulatedPair& pair : MakePairs(options)) {
    const Registration by_depth = RegisterWithDepth(pair, pair.after.depth);
    if (!by_depth.accepted()) continue;
    ++accepted;
    const Eigen::Isometry3d error = by_depth.before_from_after.inverse() * pair.BeforeFromAfter();
    const double depth_px = QuantileOf(PoseErrorsPx(pair, by_depth.before_from_after), 0.5);
    std::printf("depth: median %.1f px, camera off by %.2f m\n", depth_px,
                error.translation().norm());
    EXPECT_LT(depth_px, 4);
    const Registration by_homography = Register(pair.before, pair.after);
    if (!by_homography.accepted()) continue;
    const double homography_px =
        QuantileOf(HomographyErrorsPx(pair, by_homography.after_from_before), 0.5);
    std::printf("the same by homography: median %.1f px\n", homography_px);
    EXPECT_LT(depth_px, homography_px);
  }
  EXPECT_GE(accepted, 2);
}

TEST(RegistrationByDepth, AnotherPlaceIsRefused) {
  SimulatedPairOptions other;
  other.seed = 29;
  other.pairs = 2;
  const std::vector<SimulatedPair> elsewhere = MakePairs(other);
  for (const SimulatedPair& there : elsewhere) {
    const SimulatedPair wrong{there.before, DayPairs()[0].after};
    EXPECT_FALSE(RegisterWithDepth(wrong, wrong.after.depth).accepted());
  }
}

TEST(RegistrationByDepth, WithoutDepthItIsRefusedAndAnotherSizeIsAMistake) {
  const SimulatedPair& pair = DayPairs()[0];
  const Registration none = RegisterWithDepth(pair, cv::Mat::zeros(384, 512, CV_32FC1));
  EXPECT_EQ(none.refusal, RegistrationRefusal::kMatches);
  cv::Mat unknown(384, 512, CV_32FC1, cv::Scalar(std::nan("")));
  EXPECT_EQ(RegisterWithDepth(pair, unknown).refusal, RegistrationRefusal::kMatches);
  EXPECT_THROW(RegisterWithDepth(pair, cv::Mat::zeros(10, 10, CV_32FC1)), Error);
}

TEST(WarpByDepth, ShowsTheEarlierPictureWhereTheTruthHasIt) {
  SimulatedPairOptions options;
  options.left_m = 1.0;
  options.pairs = 2;
  for (const SimulatedPair& pair : MakePairs(options)) {
    const WarpedPicture warped =
        WarpByDepth(pair.before.bgr, Camera(), pair.after.depth, Camera(), pair.BeforeFromAfter());
    EXPECT_GT(warped.ValidShare(), 0.4);
    // The same object shows at the same pixel: that is what the instances say.
    std::size_t same = 0;
    std::size_t valid = 0;
    for (int row = 0; row < Camera().height; ++row) {
      for (int column = 0; column < Camera().width; ++column) {
        if (warped.valid.at<std::uint8_t>(row, column) == 0) continue;
        const cv::Point2d place = TruePlace(pair, Camera(), column, row);
        ++valid;
        same += pair.before.instances.at<int>(static_cast<int>(std::lround(place.y)),
                                              static_cast<int>(std::lround(place.x))) ==
                        pair.after.instances.at<int>(row, column)
                    ? 1
                    : 0;
      }
    }
    EXPECT_GT(static_cast<double>(same) / static_cast<double>(valid), 0.97);
  }
}

TEST(WarpByDepth, KnowsWhatWasHidden) {
  // A wall at 20 m and a post at 5 m before it; the earlier camera stands a metre to the left.
  const geo::CameraIntrinsics camera{100, 100, 49.5, 39.5, 100, 80};
  cv::Mat depth(80, 100, CV_32FC1, cv::Scalar(20));
  depth.colRange(45, 55).setTo(5);
  Eigen::Isometry3d before_from_after = Eigen::Isometry3d::Identity();
  before_from_after.translation().x() = 1;
  const cv::Mat before(80, 100, CV_8UC3, cv::Scalar::all(77));
  const WarpedPicture warped = WarpByDepth(before, camera, depth, camera, before_from_after);
  // The post lies at 65 to 74 there, and hides the wall's pixels 60 to 69 of this view.
  for (int column : {60, 64, 68}) EXPECT_EQ(warped.valid.at<std::uint8_t>(40, column), 0) << column;
  for (int column : {2, 30, 50, 75, 90}) {
    EXPECT_EQ(warped.valid.at<std::uint8_t>(40, column), 255) << column;
    EXPECT_EQ(warped.picture.at<cv::Vec3b>(40, column)[0], 77);
  }
  // Five pixels of the wall on the right lie beyond the earlier picture.
  EXPECT_EQ(warped.valid.at<std::uint8_t>(40, 97), 0);
  depth.rowRange(0, 10).setTo(std::nan(""));
  EXPECT_EQ(
      cv::countNonZero(
          WarpByDepth(before, camera, depth, camera, before_from_after).valid.rowRange(0, 10)),
      0);
}

}  // namespace
}  // namespace livemap::change
