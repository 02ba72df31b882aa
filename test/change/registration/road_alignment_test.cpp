#include "change/registration/road_alignment.h"

#include <gtest/gtest.h>

#include "../road_pictures.h"
#include "change/registration/warp.h"
#include "common/error.h"

namespace livemap::change {
namespace {

double FarthestOnRoad(const cv::Matx33d& found, const cv::Matx33d& truth) {
  double farthest = 0;
  for (const cv::Vec3d& at :
       {cv::Vec3d(400, 230, 1), {560, 230, 1}, {300, 380, 1}, {700, 380, 1}}) {
    const cv::Vec3d one = found * at;
    const cv::Vec3d other = truth * at;
    farthest = std::max(farthest, std::hypot(one[0] / one[2] - other[0] / other[2],
                                             one[1] / one[2] - other[1] / other[2]));
  }
  return farthest;
}

TEST(RoadAlignment, BringsARoadIntoPlaceThatLiesTensOfPixelsOff) {
  const cv::Mat after = RoadPicture(1);
  const WarpedPicture before = WarpByHomography(after, RoadWarp().inv());
  const RoadAlignment found = AlignRoad(before.picture, after, before.valid);
  EXPECT_GT(FarthestOnRoad(cv::Matx33d::eye(), RoadWarp()), 20);
  EXPECT_LT(FarthestOnRoad(found.after_from_before, RoadWarp()), 2);
  EXPECT_GT(found.agreement, 0.7);
}

TEST(RoadAlignment, AnotherRoadAgreesWithNothing) {
  const cv::Mat after = RoadPicture(1);
  const cv::Mat everywhere(after.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_LT(AlignRoad(RoadPicture(2), after, everywhere).agreement, 0.3);
}

TEST(RoadAlignment, WhereTheEarlierPictureIsNotKnownNothingAgrees) {
  const cv::Mat after = RoadPicture(1);
  const cv::Mat nowhere(after.size(), CV_8UC1, cv::Scalar(0));
  EXPECT_EQ(AlignRoad(after, after, nowhere).agreement, 0);
}

TEST(RoadAlignment, FlatAndTinyPicturesAgreeWithNothingAndOtherSizesAreAMistake) {
  const cv::Mat flat(240, 320, CV_8UC3, cv::Scalar::all(90));
  const cv::Mat everywhere(flat.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_LT(AlignRoad(flat, flat, everywhere).agreement, 0.3);
  const cv::Mat tiny(20, 20, CV_8UC3, cv::Scalar::all(90));
  EXPECT_EQ(AlignRoad(tiny, tiny, cv::Mat(tiny.size(), CV_8UC1, cv::Scalar(255))).agreement, 0);
  EXPECT_THROW(AlignRoad(flat, tiny, everywhere), Error);
}

}  // namespace
}  // namespace livemap::change
