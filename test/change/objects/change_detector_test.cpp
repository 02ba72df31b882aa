#include "change/objects/change_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "change/objects/change_overlay.h"
#include "common/error.h"
#include "simulation/motion/pass_drive.h"
#include "simulation/render/lighting.h"
#include "simulation/render/street_renderer.h"

namespace livemap::change {
namespace {

using ::testing::HasSubstr;

constexpr std::uint64_t kSeed = 5;
constexpr std::int64_t kDayNs = 86'400'000'000'000;
constexpr std::int64_t kFirstNs = 1'767'268'800'000'000'000;
const geo::GeoPoint kStart{48.8566, 9.0};

simulation::PlacedHazard Hazard(simulation::ObjectClass object_class, double at_m, double left_m) {
  simulation::PlacedHazard hazard;
  hazard.object_class = object_class;
  hazard.at_m = at_m;
  hazard.left_m = left_m;
  return hazard;
}

/// A drive down a straight street that has these hazards and nothing else that changes.
class Drive {
 public:
  Drive(const std::vector<simulation::PlacedHazard>& hazards, double start_m, std::int64_t first_ns)
      : street_(Describe(hazards), kSeed, 400, true),
        drive_(street_, Manner(start_m), Mounting(), 0),
        renderer_(street_, Camera(), simulation::MakeLighting(simulation::Condition::kDay, kSeed),
                  Options()),
        first_ns_(first_ns) {}

  ChangeDetectorFrame Picture(std::size_t frame) {
    const simulation::SimulatedFrame seen =
        renderer_.Render(drive_.Camera(frame), static_cast<std::uint32_t>(frame));
    ChangeDetectorFrame picture;
    picture.stamp_ns = first_ns_ + static_cast<std::int64_t>(frame) * 100'000'000;
    picture.bgr = seen.bgr;
    depth_ = seen.depth;
    picture.camera = Camera().intrinsics;
    picture.base_from_optical = Mounting().BaseFromOptical();
    const Eigen::Isometry3d base = seen.world_from_optical * picture.base_from_optical.inverse();
    picture.position = geo::LocalFrame(kStart).ToGeo(base.translation().head<2>());
    const Eigen::Vector3d forward = base.linear().col(0);
    picture.heading_rad = std::atan2(forward.x(), forward.y());
    picture.covariance_m2 = 0.01 * Eigen::Matrix2d::Identity();
    return picture;
  }

  /// The same with its depth.
  ChangeDetectorFrame PictureWithDepth(std::size_t frame) {
    ChangeDetectorFrame picture = Picture(frame);
    picture.depth = depth_;
    return picture;
  }

  /// Of the road's coordinates.
  geo::GeoPoint Place(double along_m, double left_m) const {
    return geo::LocalFrame(kStart).ToGeo(street_.line().At(along_m, left_m, 0).head<2>());
  }

 private:
  static simulation::WorldDescription Describe(
      const std::vector<simulation::PlacedHazard>& hazards) {
    simulation::WorldDescription description;
    description.pieces = {{400, 0, 0}};
    description.trees = false;
    description.parked_cars = false;
    description.crossings_m = std::vector<double>();
    description.hazards = hazards;
    return description;
  }
  static datasets::CameraMounting Mounting() {
    datasets::CameraMounting mounting;
    mounting.height_m = 1.45;
    return mounting;
  }
  static simulation::PassManner Manner(double start_m) {
    simulation::PassManner manner;
    manner.speed_mps = 8;
    manner.rate_hz = 10;
    manner.start_m = start_m;
    return manner;
  }
  static simulation::SimulatedCamera Camera() {
    simulation::SimulatedCamera camera;
    camera.intrinsics = {260, 260, 159.5, 127.5, 320, 256};
    return camera;
  }
  static simulation::RenderConfig Options() {
    simulation::RenderConfig options;
    options.smooth_edges = false;
    return options;
  }

  simulation::Street street_;
  simulation::PassDrive drive_;
  simulation::StreetRenderer renderer_;
  std::int64_t first_ns_;
  cv::Mat depth_;
};

const std::vector<simulation::PlacedHazard>& Before() {
  static const std::vector<simulation::PlacedHazard> hazards = {
      Hazard(simulation::ObjectClass::kBarrier, 32, -3.4),
      Hazard(simulation::ObjectClass::kRoadWorkSign, 50, -3.6)};
  return hazards;
}

/// The sign is gone, another barrier has come.
const std::vector<simulation::PlacedHazard>& After() {
  static const std::vector<simulation::PlacedHazard> hazards = {
      Hazard(simulation::ObjectClass::kBarrier, 32, -3.4),
      Hazard(simulation::ObjectClass::kBarrier, 62, -3.4)};
  return hazards;
}

constexpr std::size_t kFrames = 70;  // Of 0.8 m.

class ChangeDetectorTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(directory_); }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<ChangeDetector> Watch(const std::string& drive) const {
    ChangeDetector::Config config;
    config.drive_id = drive;
    config.memory.directory = directory_;
    config.regions.min_confidence = 0.3;
    return std::make_unique<ChangeDetector>(config, MakeChangeMethod("daisy"), kFirstNs);
  }

  /// Drives the first pass.
  void Remember() const {
    const auto watch = Watch("monday");
    Drive drive(Before(), 8, kFirstNs);
    for (std::size_t frame = 0; frame < kFrames; ++frame) {
      const auto answer = watch->Look(drive.Picture(frame));
      ASSERT_EQ(answer.outcome, ChangeDetector::Outcome::kNothingEarlier);
      ASSERT_EQ(answer.store_error, "");
    }
    // Of 56 m a picture each 2 m or a little more.
    EXPECT_GE(watch->memory().size(), 20U);
    EXPECT_LE(watch->memory().size(), 28U);
  }

  std::string directory_ = ::testing::TempDir() + "change_watch_test";
};

TEST_F(ChangeDetectorTest, SecondPassTellsWhatWentAndWhatCameAndThirdNothing) {
  Remember();
  {
    const auto watch = Watch("tuesday");
    Drive drive(After(), 8.4, kFirstNs + kDayNs);
    std::vector<PlacedChange> objects;
    std::vector<PlacedChange> passed;
    for (std::size_t frame = 0; frame < kFrames; frame += 3) {
      const auto answer = watch->Look(drive.Picture(frame));
      ASSERT_EQ(answer.outcome, ChangeDetector::Outcome::kCompared) << answer.why;
      EXPECT_EQ(answer.earlier.drive_id, "monday");
      EXPECT_EQ(answer.classes.size(), answer.pair.after.size());
      EXPECT_TRUE(frame >= 6 || answer.objects.empty()) << "said from " << frame / 3 + 1;
      objects = answer.objects;
      passed.insert(passed.end(), answer.passed.begin(), answer.passed.end());
    }
    const auto at_the_end = watch->EndDrive();
    passed.insert(passed.end(), at_the_end.begin(), at_the_end.end());
    EXPECT_EQ(passed.size(), objects.size()) << "each is told once, at the latest at the end";
    // DAISY takes some parallax for change, too.
    EXPECT_LE(objects.size(), 3U);
    const auto told = [&](double along_m, double left_m) {
      return std::find_if(objects.begin(), objects.end(), [&](const PlacedChange& object) {
        return geo::GeodesicDistanceM(object.position, drive.Place(along_m, left_m)) < 5;
      });
    };
    const auto sign = told(50, -3.6);
    ASSERT_NE(sign, objects.end());
    // DAISY's regions reach 15 pixels beyond a thing, so that its surroundings are no ring around
    // them: the direction may stay unknown, but must not be wrong.
    EXPECT_NE(sign->event.direction, ChangeDirection::kAppeared);
    EXPECT_NE(told(62, -3.4), objects.end());
    for (const PlacedChange& object : objects) {
      EXPECT_EQ(object.event.change_class, protocol::ChangeClass::kOtherObjects);
      EXPECT_GE(object.event.seen, 3);
      // The vehicle's own uncertainty is in it.
      EXPECT_GT(object.covariance_m2(0, 0), 0.01);
    }
  }
  std::filesystem::remove_all(directory_);
  Remember();
  const auto watch = Watch("tuesday");
  Drive drive(Before(), 8.4, kFirstNs + kDayNs);
  for (std::size_t frame = 0; frame < kFrames; frame += 4) {
    EXPECT_TRUE(watch->Look(drive.Picture(frame)).objects.empty()) << frame;
  }
}

TEST_F(ChangeDetectorTest, DepthLaysTheEarlierPictureOnWhereItIsKnownAndEdgesDoWhereItIsNot) {
  Remember();
  const auto with_depth = Watch("tuesday");
  Drive drive(Before(), 8.9, kFirstNs + kDayNs);
  int by_depth = 0;
  double depth_error = 0;
  double edges_error = 0;
  const auto error = [](const AlignedPair& pair) {
    cv::Mat difference;
    cv::absdiff(pair.before, pair.after, difference);
    const cv::Scalar mean = cv::mean(difference, pair.valid);
    return mean[0] + mean[1] + mean[2];
  };
  for (std::size_t frame = 10; frame < 50; frame += 10) {
    ChangeDetectorFrame picture = drive.PictureWithDepth(frame);
    const auto answer = with_depth->Look(picture);
    ASSERT_EQ(answer.outcome, ChangeDetector::Outcome::kCompared) << answer.why;
    by_depth += answer.registered_by == ChangeDetector::RegisteredBy::kDepth ? 1 : 0;
    depth_error += error(answer.pair);
    picture.depth.setTo(0);
    ++picture.stamp_ns;
    const auto without = with_depth->Look(picture);
    ASSERT_EQ(without.outcome, ChangeDetector::Outcome::kCompared) << without.why;
    EXPECT_NE(without.registered_by, ChangeDetector::RegisteredBy::kDepth);
    edges_error += error(without.pair);
  }
  EXPECT_GE(by_depth, 3);
  EXPECT_LT(depth_error, edges_error);
  ChangeDetectorFrame wrong = drive.PictureWithDepth(60);
  wrong.depth = cv::Mat(10, 10, CV_32FC1, cv::Scalar(5));
  EXPECT_THROW(with_depth->Look(wrong), Error);
}

TEST_F(ChangeDetectorTest, NeverComparesWithItsOwnDriveNorWithAnotherPlace) {
  const auto watch = Watch("monday");
  Drive drive(Before(), 8, kFirstNs);
  const ChangeDetectorFrame first = drive.Picture(0);
  EXPECT_TRUE(watch->Look(first).remembered);
  ChangeDetectorFrame again = first;
  again.stamp_ns += 1;
  const auto same_drive = watch->Look(again);
  EXPECT_EQ(same_drive.outcome, ChangeDetector::Outcome::kNothingEarlier);
  EXPECT_FALSE(same_drive.remembered) << "the vehicle stands";
}

TEST_F(ChangeDetectorTest, AWrongPlaceIsRefusedWithAReasonAndTellsNoChange) {
  { Watch("monday")->Look(Drive(Before(), 8, kFirstNs).Picture(0)); }
  const auto watch = Watch("tuesday");
  ChangeDetectorFrame elsewhere = Drive({}, 200, kFirstNs + kDayNs).Picture(0);
  const ChangeDetectorFrame there = Drive(Before(), 8, kFirstNs).Picture(0);
  elsewhere.position = there.position;
  elsewhere.heading_rad = there.heading_rad;
  const auto answer = watch->Look(elsewhere);
  EXPECT_EQ(answer.outcome, ChangeDetector::Outcome::kRefused);
  EXPECT_THAT(answer.why, HasSubstr("accepted"));
  EXPECT_TRUE(answer.regions.empty());
}

TEST_F(ChangeDetectorTest, AnUncertainPlaceIsNeitherComparedNorRemembered) {
  const auto watch = Watch("monday");
  ChangeDetectorFrame picture = Drive(Before(), 8, kFirstNs).Picture(0);
  picture.covariance_m2 = 100 * Eigen::Matrix2d::Identity();
  const auto answer = watch->Look(picture);
  EXPECT_EQ(answer.outcome, ChangeDetector::Outcome::kUncertain);
  EXPECT_FALSE(answer.remembered);
  EXPECT_EQ(watch->memory().size(), 0U);
}

TEST_F(ChangeDetectorTest, PicturesThatAreNoneAndDrivesWithoutNameAreRefused) {
  EXPECT_THROW(Watch(""), Error);
  const auto watch = Watch("monday");
  ChangeDetectorFrame picture = Drive(Before(), 8, kFirstNs).Picture(0);
  picture.camera.width = 640;
  EXPECT_THROW(watch->Look(picture), Error);
  picture.camera.width = 320;
  picture.position.latitude_deg = std::nan("");
  EXPECT_THROW(watch->Look(picture), Error);
}

TEST(DrawChanges, ColoursWhatChangedAndDarkensWhatIsNotKnown) {
  const cv::Mat picture(40, 60, CV_8UC3, cv::Scalar(100, 100, 100));
  cv::Mat classes(picture.size(), CV_8UC1, cv::Scalar(0));
  classes(cv::Rect(0, 0, 10, 40)).setTo(kLeftOutPixel);
  classes(cv::Rect(20, 20, 10, 10)).setTo(static_cast<int>(protocol::ChangeClass::kBarrier));
  const cv::Mat drawn = DrawChanges(picture, classes, {});
  EXPECT_EQ(drawn.at<cv::Vec3b>(5, 50), cv::Vec3b(100, 100, 100));
  EXPECT_LT(drawn.at<cv::Vec3b>(5, 5)[0], 60);
  EXPECT_GT(drawn.at<cv::Vec3b>(25, 25)[2], drawn.at<cv::Vec3b>(25, 25)[0]) << "dark red";
  EXPECT_THROW(DrawChanges(picture, cv::Mat(), {}), Error);
}

}  // namespace
}  // namespace livemap::change
