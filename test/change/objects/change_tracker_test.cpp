#include "change/objects/change_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "change/methods/change_method.h"
#include "common/error.h"

namespace livemap::change {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 256;

/// A camera 1.4 m above the road that looks ahead.
ChangeFrame FrameAt(double along_m, std::int64_t stamp_s) {
  ChangeFrame frame;
  frame.stamp_ns = stamp_s * 1000000000LL;
  frame.map_from_base.translation() = Eigen::Vector3d(along_m, 0, 0);
  Eigen::Matrix3d optical;
  optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  frame.base_from_optical.linear() = optical;
  frame.base_from_optical.translation() = Eigen::Vector3d(0, 0, 1.4);
  frame.camera = {260, 260, 159.5, 127.5, kWidth, kHeight};
  frame.valid = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(255));
  return frame;
}

/// What the camera sees of a thing half a metre wide and a metre high on the road.
ChangeRegion SeenAt(const ChangeFrame& frame, double along_m, double left_m,
                    protocol::ChangeClass change_class = protocol::ChangeClass::kSign) {
  const double z = along_m - frame.map_from_base.translation().x();
  const double f = frame.camera.fx;
  const int column = static_cast<int>(std::lround(frame.camera.cx - f * left_m / z));
  const int foot = static_cast<int>(std::lround(frame.camera.cy + f * 1.4 / z));
  const int width = static_cast<int>(f * 0.5 / z);
  const int height = static_cast<int>(f / z);
  ChangeRegion region;
  region.change_class = change_class;
  region.box = {column - width / 2, foot - height + 1, width, height};
  region.pixels = region.box.area();
  region.confidence = 0.8;
  region.direction = ChangeDirection::kVanished;
  return region;
}

TEST(ChangeTracker, ConfirmsWhatSeveralPicturesShowWhereItStands) {
  ChangeTracker tracker{ChangeTracker::Config()};
  std::vector<ChangedObject> confirmed;
  for (int i = 0; i < 6; ++i) {
    const ChangeFrame frame = FrameAt(2.0 * i, i + 1);
    const auto events = tracker.Add(frame, {SeenAt(frame, 22, -2)});
    EXPECT_EQ(events.size(), i == 2 ? 1U : 0U) << i;
    confirmed.insert(confirmed.end(), events.begin(), events.end());
  }
  ASSERT_EQ(confirmed.size(), 1U);
  EXPECT_EQ(confirmed[0].change_class, protocol::ChangeClass::kSign);
  EXPECT_EQ(confirmed[0].direction, ChangeDirection::kVanished);
  const auto now = tracker.Confirmed();
  ASSERT_EQ(now.size(), 1U);
  EXPECT_EQ(now[0].seen, 6);
  EXPECT_EQ(now[0].missed, 0);
  EXPECT_NEAR(now[0].confidence, 0.8, 1e-9);
  EXPECT_NEAR(now[0].position_m.x(), 22, 0.7);
  EXPECT_NEAR(now[0].position_m.y(), -2, 0.3);
  EXPECT_LT(now[0].covariance_m2.trace(), confirmed[0].covariance_m2.trace());
}

TEST(ChangeTracker, SaysNothingFromOnePictureNorFromOnePlace) {
  ChangeTracker tracker{ChangeTracker::Config()};
  for (int i = 0; i < 20; ++i) {
    // Standing: twenty pictures are as good as one.
    const ChangeFrame frame = FrameAt(0, i + 1);
    EXPECT_TRUE(tracker.Add(frame, {SeenAt(frame, 15, 1)}).empty());
  }
  EXPECT_EQ(tracker.tracks(), 1U);
  ChangeTracker::Config hasty;
  hasty.min_seen = 1;
  EXPECT_THROW(ChangeTracker{hasty}, Error);
}

TEST(ChangeTracker, WhatMostPicturesDoNotShowIsNotConfirmed) {
  ChangeTracker tracker{ChangeTracker::Config()};
  for (int i = 0; i < 12; ++i) {
    const ChangeFrame frame = FrameAt(i, i + 1);
    std::vector<ChangeRegion> regions;
    if (i % 4 == 0) regions.push_back(SeenAt(frame, 25, 1));
    EXPECT_TRUE(tracker.Add(frame, regions).empty()) << i;
  }
}

TEST(ChangeTracker, AMissDoesNotCountWhereNothingCouldBeSeen) {
  ChangeTracker tracker{ChangeTracker::Config()};
  std::size_t confirmed = 0;
  for (int i = 0; i < 12; ++i) {
    ChangeFrame frame = FrameAt(i, i + 1);
    std::vector<ChangeRegion> regions;
    if (i % 4 == 0) {
      regions.push_back(SeenAt(frame, 25, 1));
    } else {
      frame.valid.setTo(0);
    }
    confirmed += tracker.Add(frame, regions).size();
  }
  EXPECT_EQ(confirmed, 1U);
}

TEST(ChangeTracker, KeepsNeighboursApartAndGivesTheClassThatMostSay) {
  ChangeTracker tracker{ChangeTracker::Config()};
  for (int i = 0; i < 5; ++i) {
    const ChangeFrame frame = FrameAt(i, i + 1);
    tracker.Add(frame,
                {SeenAt(frame, 15, 2.5), SeenAt(frame, 15, -2.5,
                                                i == 1 ? protocol::ChangeClass::kBin
                                                       : protocol::ChangeClass::kTrafficCone)});
  }
  const auto events = tracker.Confirmed();
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].change_class, protocol::ChangeClass::kSign);
  EXPECT_EQ(events[1].change_class, protocol::ChangeClass::kTrafficCone);
  EXPECT_GT(events[0].position_m.y(), 2);
  EXPECT_LT(events[1].position_m.y(), -2);
}

TEST(ChangeTracker, IgnoresOldPicturesAndWhatHasNoFootOnTheRoad) {
  ChangeTracker tracker{ChangeTracker::Config()};
  const ChangeFrame frame = FrameAt(0, 10);
  ChangeRegion cut = SeenAt(frame, 15, 0);
  cut.box.height = kHeight - cut.box.y;
  ChangeRegion sky = SeenAt(frame, 15, 0);
  sky.box = {100, 10, 20, 30};
  tracker.Add(frame, {cut, sky});
  EXPECT_EQ(tracker.tracks(), 0U);
  const ChangeFrame older = FrameAt(0, 9);
  tracker.Add(older, {SeenAt(older, 15, 0)});
  EXPECT_EQ(tracker.tracks(), 0U);
}

TEST(ChangeTracker, ForgetsWhatLiesFarBehindAndStaysSmall) {
  ChangeTracker::Config config;
  config.max_tracks = 3;
  ChangeTracker tracker(config);
  const ChangeFrame frame = FrameAt(0, 1);
  tracker.Add(frame, {SeenAt(frame, 12, 3), SeenAt(frame, 12, -3), SeenAt(frame, 20, 3),
                      SeenAt(frame, 20, -3), SeenAt(frame, 28, 3)});
  EXPECT_EQ(tracker.tracks(), 3U);
  tracker.LeaveBehind(FrameAt(200, 2).map_from_base);
  EXPECT_EQ(tracker.tracks(), 0U);
}

/// Ten classes: no change but for `change_class` with probability 0.9 in a rectangle.
ChangeProbabilities OneRegion(const cv::Rect& box, protocol::ChangeClass change_class) {
  ChangeProbabilities probabilities;
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    probabilities.of_class.emplace_back(kHeight, kWidth, CV_32FC1, cv::Scalar(i == 0 ? 1 : 0));
  }
  probabilities.of_class[0](box).setTo(0.1);
  probabilities.of_class[static_cast<std::size_t>(change_class)](box).setTo(0.9);
  return probabilities;
}

cv::Mat Background() {
  cv::Mat image(kHeight, kWidth, CV_8UC3);
  cv::RNG random(3);
  random.fill(image, cv::RNG::NORMAL, cv::Scalar::all(120), cv::Scalar::all(6));
  return image;
}

TEST(FindChangeRegions, SayWhereWhatAndWhichPictureHasIt) {
  const cv::Rect box(100, 80, 30, 50);
  const cv::Mat without = Background();
  cv::Mat with = Background();
  with(box).setTo(cv::Scalar(30, 60, 220));
  const auto probabilities = OneRegion(box, protocol::ChangeClass::kBarrier);
  const auto appeared = FindChangeRegions(probabilities, without, with);
  ASSERT_EQ(appeared.size(), 1U);
  EXPECT_EQ(appeared[0].box, box);
  EXPECT_EQ(appeared[0].pixels, box.area());
  EXPECT_EQ(appeared[0].change_class, protocol::ChangeClass::kBarrier);
  EXPECT_NEAR(appeared[0].confidence, 0.9, 1e-5);
  EXPECT_EQ(appeared[0].direction, ChangeDirection::kAppeared);
  EXPECT_EQ(FindChangeRegions(probabilities, with, without)[0].direction,
            ChangeDirection::kVanished);
  EXPECT_EQ(FindChangeRegions(probabilities, without, without)[0].direction,
            ChangeDirection::kUnknown);
}

TEST(FindChangeRegions, FindThePictureThatHasAThingWhoseOutlineShowsInNeither) {
  // Stripes end at a board as they end at each other: its outline is no stronger an edge.
  cv::Mat stripes(kHeight, kWidth, CV_8UC3);
  for (int column = 0; column < stripes.cols; ++column) {
    stripes.col(column).setTo(column / 4 % 2 == 0 ? cv::Scalar::all(60) : cv::Scalar::all(160));
  }
  const cv::Rect box(100, 80, 40, 60);
  cv::Mat board = stripes.clone();
  board(box).setTo(cv::Scalar(40, 120, 200));
  const auto probabilities = OneRegion(box, protocol::ChangeClass::kSign);
  EXPECT_EQ(FindChangeRegions(probabilities, stripes, board)[0].direction,
            ChangeDirection::kAppeared);
  EXPECT_EQ(FindChangeRegions(probabilities, board, stripes)[0].direction,
            ChangeDirection::kVanished);
}

TEST(FindChangeRegions, LeaveOutSmallAndUncertainOnes) {
  const cv::Mat image = Background();
  EXPECT_TRUE(
      FindChangeRegions(OneRegion({10, 10, 7, 8}, protocol::ChangeClass::kBin), image, image)
          .empty());
  ChangeRegionConfig strict;
  strict.min_confidence = 0.95;
  EXPECT_TRUE(FindChangeRegions(OneRegion({10, 10, 50, 50}, protocol::ChangeClass::kBin), image,
                                image, strict)
                  .empty());
  EXPECT_THROW(FindChangeRegions(OneRegion({10, 10, 50, 50}, protocol::ChangeClass::kBin), image,
                                 cv::Mat(10, 10, CV_8UC3)),
               Error);
}

TEST(FindChangeRegions, TakeInTheUnsureRimAroundThemDownToTheFoot) {
  const cv::Mat image = Background();
  const cv::Rect box(100, 80, 30, 40);
  auto probabilities = OneRegion(box, protocol::ChangeClass::kSign);
  // Below it the network is unsure: six rows nearly, and a tail that leads far away.
  const cv::Rect foot(110, 120, 10, 6);
  const cv::Rect tail(114, 126, 2, 60);
  for (const cv::Rect& part : {foot, tail}) {
    probabilities.of_class[0](part).setTo(0.7);
    probabilities.of_class[static_cast<std::size_t>(protocol::ChangeClass::kSign)](part).setTo(0.3);
  }
  const auto regions = FindChangeRegions(probabilities, image, image);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_EQ(regions[0].box, cv::Rect(100, 80, 30, 48)) << "rows 120 to 127: the rim is 8 px";
  EXPECT_EQ(regions[0].pixels, box.area());
  EXPECT_NEAR(regions[0].confidence, 0.9, 1e-5);
  ChangeRegionConfig without_rim;
  without_rim.rim_px = 0;
  EXPECT_EQ(FindChangeRegions(probabilities, image, image, without_rim)[0].box, box);
}

TEST(FindChangeRegions, StayApartWhereTheirRimsMeet) {
  const cv::Mat image = Background();
  auto probabilities = OneRegion({60, 80, 20, 30}, protocol::ChangeClass::kSign);
  const auto second = OneRegion({92, 80, 20, 30}, protocol::ChangeClass::kSign);
  for (std::size_t i = 0; i < probabilities.of_class.size(); ++i) {
    second.of_class[i].colRange(86, 160).copyTo(probabilities.of_class[i].colRange(86, 160));
  }
  probabilities.of_class[0](cv::Rect(80, 80, 12, 30)).setTo(0.6);
  const auto regions = FindChangeRegions(probabilities, image, image);
  ASSERT_EQ(regions.size(), 2U);
  EXPECT_EQ(regions[0].box.width + regions[1].box.width, 20 + 12 + 20);
}

TEST(FindChangeRegions, OfProbabilitiesWithoutClassesAreOtherObjects) {
  const cv::Mat image = Background();
  const cv::Rect box(10, 10, 50, 50);
  ChangeProbabilities probabilities = NothingChanged(image.size(), false);
  probabilities.of_class[0](box).setTo(0.6);
  probabilities.of_class[1](box).setTo(0.4);
  EXPECT_TRUE(FindChangeRegions(probabilities, image, image).empty());
  ChangeRegionConfig sensitive;
  sensitive.min_confidence = 0.35;
  const auto regions = FindChangeRegions(probabilities, image, image, sensitive);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_EQ(regions[0].change_class, protocol::ChangeClass::kOtherObjects);
  EXPECT_EQ(regions[0].box, box);
}

TEST(ChangedClasses, ArePickedByTheSumOfChangeNotByTheLikeliestClass) {
  ChangeProbabilities probabilities = NothingChanged({4, 4}, true);
  probabilities.of_class[0].setTo(0.4);
  probabilities.of_class[3].setTo(0.25);
  probabilities.of_class[7].setTo(0.35);
  EXPECT_EQ(ChangedClasses(probabilities, 0.55).at<std::uint8_t>(1, 1), 7);
  EXPECT_EQ(ChangedClasses(probabilities, 0.65).at<std::uint8_t>(1, 1), 0);
}

TEST(ChangeTracker, BeganAnewForgetsObjectsButNotTheirIds) {
  ChangeTracker tracker{ChangeTracker::Config()};
  const auto drive = [&tracker] {
    std::uint64_t id = 0;
    for (int i = 0; i < 4; ++i) {
      const ChangeFrame frame = FrameAt(2.0 * i, i + 1);
      for (const ChangedObject& event : tracker.Add(frame, {SeenAt(frame, 22, -2)})) id = event.id;
    }
    return id;
  };
  const std::uint64_t first = drive();
  EXPECT_EQ(drive(), 0U) << "stamps must rise";
  tracker.Restart();
  EXPECT_TRUE(tracker.Confirmed().empty());
  EXPECT_GT(drive(), first);
}

TEST(ChangeTracker, TellsOfAConfirmedObjectOnceWhenTheVehicleHasPassedIt) {
  ChangeTracker tracker{ChangeTracker::Config()};
  std::vector<double> told_at_m;
  for (int i = 0; i < 50; ++i) {
    const double along_m = 2.0 * i;
    const ChangeFrame frame = FrameAt(along_m, i + 1);
    std::vector<ChangeRegion> regions;
    if (along_m < 18) regions.push_back(SeenAt(frame, 22, -2));
    if (along_m == 4) regions.push_back(SeenAt(frame, 34, 3));  // Once: never confirmed.
    tracker.Add(frame, regions);
    for (const ChangedObject& event : tracker.LeaveBehind(frame.map_from_base)) {
      told_at_m.push_back(along_m);
      EXPECT_EQ(event.seen, 9);
      EXPECT_NEAR(event.position_m.x(), 22, 0.5);
    }
  }
  EXPECT_THAT(told_at_m, ::testing::ElementsAre(28)) << "the first place 5 m beyond 22 m";
  EXPECT_EQ(tracker.tracks(), 0U) << "60 m behind it is forgotten";
}

TEST(ChangeTracker, AnObjectThatThePictureCutsOffIsNotMissed) {
  ChangeTracker tracker{ChangeTracker::Config()};
  for (int k = 0; k < 4; ++k) {
    const ChangeFrame frame = FrameAt(2.0 * k, k + 1);
    tracker.Add(frame, {SeenAt(frame, 22, -2)});
  }
  ChangeFrame near = FrameAt(11, 9);
  ChangeRegion cut = SeenAt(near, 22, -2);
  cut.box.height = kHeight - cut.box.y;  // What hides its foot reaches the lower edge.
  tracker.Add(near, {cut});
  ASSERT_EQ(tracker.Confirmed().size(), 1U);
  EXPECT_EQ(tracker.Confirmed()[0].missed, 0);
  near.stamp_ns += 1;
  tracker.Add(near, {});
  EXPECT_EQ(tracker.Confirmed()[0].missed, 1) << "nothing at all is there";
}

TEST(ChangeTracker, BeganAnewTellsOfWhatWasConfirmedAndNotYetPassed) {
  ChangeTracker tracker{ChangeTracker::Config()};
  for (int i = 0; i < 4; ++i) {
    const ChangeFrame frame = FrameAt(2.0 * i, i + 1);
    tracker.Add(frame, {SeenAt(frame, 22, -2)});
    EXPECT_TRUE(tracker.LeaveBehind(frame.map_from_base).empty());
  }
  EXPECT_EQ(tracker.Restart().size(), 1U);
  EXPECT_TRUE(tracker.Restart().empty());
}

}  // namespace
}  // namespace livemap::change
