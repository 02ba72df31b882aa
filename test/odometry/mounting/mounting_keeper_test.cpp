#include "odometry/mounting/mounting_keeper.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/error.h"
#include "common/text_file.h"
#include "test/odometry/mounting/synthetic_road.h"

namespace livemap::odometry {
namespace {

namespace fs = std::filesystem;

const Mounting kKeptTruth{Radians(1.5), Radians(3), Radians(-1), 1.41};

MountingRecord Record(double sigma_deg) {
  MountingRecord record;
  record.camera = kRoadEye;
  record.estimate.mounting = kKeptTruth;
  record.estimate.sigma = {Radians(sigma_deg), Radians(sigma_deg), Radians(sigma_deg), 0.01};
  record.estimate.roll_known = record.estimate.height_known = true;
  return record;
}

std::string Refusal(const std::string& text) {
  try {
    ParseMountingFile(text, "m.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(MountingFile, IsReadAsItWasWritten) {
  const MountingRecord read = ParseMountingFile(FormatMountingFile(Record(0.1)), "m.yaml");
  EXPECT_EQ(read.camera.width, kRoadEye.width);
  EXPECT_EQ(read.camera.fx, kRoadEye.fx);
  EXPECT_NEAR(read.estimate.mounting.yaw_rad, kKeptTruth.yaw_rad, 1e-7);
  EXPECT_NEAR(read.estimate.mounting.roll_rad, kKeptTruth.roll_rad, 1e-7);
  EXPECT_EQ(read.estimate.mounting.height_m, kKeptTruth.height_m);
  EXPECT_NEAR(read.estimate.sigma.pitch_rad, Radians(0.1), 1e-7);
}

TEST(MountingFile, LeavesOutWhatIsNotKnown) {
  MountingRecord record = Record(0.1);
  record.estimate.height_known = false;
  const std::string text = FormatMountingFile(record);
  EXPECT_EQ(text.find("height_m"), std::string::npos);
  EXPECT_FALSE(ParseMountingFile(text, "m.yaml").estimate.height_known);
}

TEST(MountingFile, RefusesATornFileAtEveryLength) {
  const std::string text = FormatMountingFile(Record(0.1));
  for (std::size_t length = 0; length + 1 < text.size(); ++length) {
    EXPECT_NE(Refusal(text.substr(0, length)), "") << length;
  }
  EXPECT_EQ(Refusal(text), "");
}

TEST(MountingFile, NamesLineValueAndWhatIsAccepted) {
  const std::string text = FormatMountingFile(Record(0.1));
  EXPECT_EQ(Refusal(Replaced(text, "version: 1", "version: 2")),
            "line 3 of the mounting file 'm.yaml': 'version' is '2', accepted is 1");
  EXPECT_EQ(Refusal(Replaced(text, "yaw_deg: 1.5", "yaw_deg: nan")),
            "line 10 of the mounting file 'm.yaml': 'yaw_deg' is 'nan', accepted is a number from "
            "-60 to 60");
  EXPECT_NE(Refusal(Replaced(text, "yaw_deg", "yaw_rad")).find("accepted is one of the keys"),
            std::string::npos);
  EXPECT_NE(Refusal(Replaced(text, "height_m: 1.41", "height_m: 1410")).find("0.1 to 10"),
            std::string::npos);
  EXPECT_NE(Refusal(Replaced(text, "yaw_sigma_deg: 0.1", "yaw_sigma_deg: 0")), "");
  EXPECT_NE(Refusal(Replaced(text, "cx: ", "fx: ")).find("each key once"), std::string::npos);
  EXPECT_NE(Refusal(Replaced(text, "roll_sigma_deg: 0.1\n", "")).find("no 'roll_sigma_deg'"),
            std::string::npos);
  EXPECT_NE(Refusal(text + "version: 1\n"), "");
}

class MountingKeeperTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::temp_directory_path() /
        ("livemap_mounting_" + std::to_string(testing::UnitTest::GetInstance()->random_seed()) +
         testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  MountingKeeper::Config Config() const {
    MountingKeeper::Config config;
    config.path = (folder_ / "mounting.yaml").string();
    config.calibrator.assumed = {0, 0, 0, 1.6};
    return config;
  }
  /// Drives straight on, an image every quarter metre.
  static void Drive(MountingKeeper& keeper, const Mounting& truth, int frames) {
    const SyntheticRoad road(truth);
    for (int i = 0; i < frames; ++i) {
      CalibrationFrame frame;
      frame.stamp_ns = 1'000'000'000 + i * 50'000'000LL;
      frame.world_from_camera = road.WorldFromCamera(0.5 * i);
      frame.grey = road.See(frame.world_from_camera);
      frame.tracking = true;
      keeper.Add(frame);
    }
  }

  fs::path folder_;
};

TEST_F(MountingKeeperTest, UsesTheParametersUntilItIsSurerThanThey) {
  MountingKeeper keeper(Config(), kRoadEye);
  EXPECT_FALSE(keeper.InUse().found);
  EXPECT_EQ(keeper.InUse().mounting.height_m, 1.6);
  Drive(keeper, kKeptTruth, 140);
  const MountingInUse used = keeper.InUse();
  EXPECT_TRUE(used.found);
  EXPECT_NEAR(used.mounting.yaw_rad, kKeptTruth.yaw_rad, Radians(0.15));
  EXPECT_NEAR(used.mounting.pitch_rad, kKeptTruth.pitch_rad, Radians(0.15));
  EXPECT_NEAR(used.mounting.roll_rad, kKeptTruth.roll_rad, Radians(0.15));
  EXPECT_NEAR(used.mounting.height_m, kKeptTruth.height_m, 0.02);
  EXPECT_EQ(keeper.knocks(), 0);
}

TEST_F(MountingKeeperTest, RemembersFromDriveToDrive) {
  {
    MountingKeeper keeper(Config(), kRoadEye);
    Drive(keeper, kKeptTruth, 140);
    keeper.Save();
    EXPECT_EQ(keeper.problem(), "");
  }
  EXPECT_FALSE(fs::exists(folder_ / "mounting.yaml.tmp"));
  MountingKeeper keeper(Config(), kRoadEye);
  EXPECT_TRUE(keeper.EarlierDrives());
  EXPECT_TRUE(keeper.InUse().found);
  EXPECT_NEAR(keeper.InUse().mounting.height_m, kKeptTruth.height_m, 0.02);
}

TEST_F(MountingKeeperTest, TellsThatTheCameraWasKnockedSinceTheLastDrive) {
  ReplaceTextFile(Config().path, FormatMountingFile(Record(0.1)));
  MountingKeeper keeper(Config(), kRoadEye);
  Mounting after = kKeptTruth;
  after.pitch_rad += Radians(3);
  Drive(keeper, after, 140);
  const auto knock = keeper.TakeKnock();
  ASSERT_TRUE(knock);
  EXPECT_NEAR(knock->before.pitch_rad, kKeptTruth.pitch_rad, 1e-6);
  EXPECT_NEAR(knock->after.pitch_rad, after.pitch_rad, Radians(0.3));
  EXPECT_EQ(keeper.knocks(), 1);
  EXPECT_FALSE(keeper.EarlierDrives());
  EXPECT_NEAR(keeper.InUse().mounting.pitch_rad, after.pitch_rad, Radians(0.3));
}

TEST_F(MountingKeeperTest, SetsADamagedFileAsideAndSaysWhy) {
  std::ofstream(Config().path) << "version: 1\nyaw_deg: 3";
  MountingKeeper keeper(Config(), kRoadEye);
  EXPECT_FALSE(keeper.InUse().found);
  EXPECT_NE(keeper.problem().find("not written to its end"), std::string::npos) << keeper.problem();
  EXPECT_FALSE(fs::exists(Config().path));
  EXPECT_TRUE(fs::exists(Config().path + ".refused"));
}

TEST_F(MountingKeeperTest, DoesNotUseTheFileOfAnotherCamera) {
  MountingRecord record = Record(0.1);
  record.camera.fx = 500;
  ReplaceTextFile(Config().path, FormatMountingFile(record));
  const MountingKeeper keeper(Config(), kRoadEye);
  EXPECT_FALSE(keeper.InUse().found);
  EXPECT_NE(keeper.problem().find("another camera"), std::string::npos);
}

TEST_F(MountingKeeperTest, GoesOnWhereTheFileCannotBeWritten) {
  MountingKeeper::Config config = Config();
  std::ofstream(folder_ / "file") << "no folder";
  config.path = (folder_ / "file" / "mounting.yaml").string();
  MountingKeeper keeper(config, kRoadEye);
  Drive(keeper, kKeptTruth, 140);
  keeper.Save();
  EXPECT_NE(keeper.problem().find("cannot be written"), std::string::npos);
  EXPECT_TRUE(keeper.InUse().found);
}

TEST_F(MountingKeeperTest, RefusesAnImpossibleParameter) {
  MountingKeeper::Config config = Config();
  config.calibrator.assumed.height_m = 0;
  EXPECT_THROW(MountingKeeper(config, kRoadEye), Error);
}

}  // namespace
}  // namespace livemap::odometry
