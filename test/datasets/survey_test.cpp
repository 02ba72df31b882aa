#include "datasets/survey.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/error.h"
#include "datasets/camera_file.h"
#include "datasets/image_file.h"
#include "datasets/sequences.h"
#include "test/support/temporary_directory.h"

namespace livemap::datasets {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::string DataDirectory() {
  const char* set = std::getenv("LIVEMAP_DATA_DIR");
  return set != nullptr ? set : std::string(LIVEMAP_SOURCE_DIR) + "/../shared/data";
}

TEST(SurveyTable, ReadsFramesInDrivingOrder) {
  const auto rows =
      ParseSurveyTable("frame,chainage_m,potholes\r\na_1,625,1\r\nb_2,630.5,0\r\n", "frames.csv");
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].frame, "a_1");
  EXPECT_EQ(rows[0].potholes, 1);
  EXPECT_DOUBLE_EQ(rows[1].chainage_m, 630.5);
}

TEST(SurveyTable, NamesTheLineThatIsWrong) {
  const std::string head = "frame,chainage_m,potholes\n";
  const auto refused = [&](const std::string& text, const std::string& words) {
    EXPECT_THAT([&] { ParseSurveyTable(text, "f.csv"); }, ThrowsMessage<Error>(HasSubstr(words)))
        << text;
  };
  refused("", "line 1 of 'f.csv'");
  refused("frame,potholes\n", "line 1 of 'f.csv'");
  refused(head, "lists no frame");
  refused(head + "a,1,0\nb,nan,0\n", "line 3 of 'f.csv'");
  refused(head + "a,1\n", "line 2 of 'f.csv'");
  refused(head + "../../etc/passwd,1,0\n", "plain file name");
  refused(head + "a,10,0\nb,5,0\n", "driving order");
  refused(head + "a,1,0\nb,2,0\na,3,0\n", "line 4 of 'f.csv' repeats the frame 'a'");
}

TEST(SurveyFrames, AreTimedByChainageOverSpeed) {
  SurveyDrive drive;
  for (const double chainage_m : {100.0, 105.0, 1105.0}) {
    drive.frames.push_back({"f", chainage_m, "", {}});
  }
  const auto places = PlaceFrames(drive, 20, 0);
  EXPECT_DOUBLE_EQ(places[1].time_s, 0.25);
  EXPECT_DOUBLE_EQ(places[2].time_s, 50.25);
  EXPECT_DOUBLE_EQ(places[2].distance_m, 1005);
}

TEST(SurveyFrames, CutGapsKeepTheSpeed) {
  SurveyDrive drive;
  for (const double chainage_m : {100.0, 105.0, 1105.0, 1110.0}) {
    drive.frames.push_back({"f", chainage_m, "", {}});
  }
  const auto places = PlaceFrames(drive, 20, 2);
  EXPECT_DOUBLE_EQ(places[2].time_s, 2.25);
  EXPECT_DOUBLE_EQ(places[2].distance_m, 45);
  EXPECT_DOUBLE_EQ(places[3].distance_m - places[2].distance_m, 5);
}

TEST(YoloLabels, ReadsBoxesAndNamesTheLineThatIsWrong) {
  const auto boxes = ParseYoloLabels("0 0.5 0.25 0.125 1\n\n", "l.txt");
  ASSERT_EQ(boxes.size(), 1U);
  EXPECT_DOUBLE_EQ(boxes[0].width, 0.125);
  for (const char* bad : {"0 0.5 0.5 0.1\n", "0 0.5 0.5 0.1 0\n", "0 1.5 0.5 0.1 0.1\n",
                          "-1 0.5 0.5 0.1 0.1\n", "0.5 0.5 0.5 0.1 0.1\n", "0 nan 0.5 0.1 0.1\n"}) {
    EXPECT_THAT([&] { ParseYoloLabels(bad, "l.txt"); },
                ThrowsMessage<Error>(HasSubstr("line 1 of 'l.txt'")))
        << bad;
  }
}

TEST(SurveyFrames, FindTheirLabelsHoweverTheTablePadsTheirNumbers) {
  const test::TemporaryDirectory folder;
  const auto write = [&folder](const std::string& name, const std::string& text) {
    const std::filesystem::path path = std::filesystem::path(folder.path()) / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  };
  write("images/0007.jpg", "");
  write("labels/0007.txt", "0 0.5 0.5 0.2 0.4\n");
  for (const char* counted : {"0", "1"}) {
    write("frames.csv", std::string("frame,chainage_m,potholes\n7,10,") + counted + "\n");
    const SurveyDrive drive = ReadSurveyDrive(folder.path());
    ASSERT_EQ(drive.frames.size(), 1U);
    EXPECT_EQ(drive.frames[0].boxes.size(), 1U) << "counted " << counted;
  }
  write("frames.csv", "frame,chainage_m,potholes\n7,10,0\n007,11,0\n");
  EXPECT_THAT([&] { ReadSurveyDrive(folder.path()); },
              ThrowsMessage<Error>(HasSubstr("0007.jpg' twice")));
  write("frames.csv", "frame,chainage_m,potholes\n7,10,0\n");
  write("labels/7.jpg.txt", "");
  EXPECT_THAT([&] { ReadSurveyDrive(folder.path()); },
              ThrowsMessage<Error>(HasSubstr("belongs to no picture")));
}

TEST(SurveyFrames, AFileInPlaceOfTheFolderIsNamedAsOne) {
  const test::TemporaryDirectory folder;
  const std::string file = folder.path() + "/drive.bag";
  std::ofstream(file) << "x";
  EXPECT_THAT([&] { ReadSurveyDrive(file); },
              ThrowsMessage<Error>(HasSubstr("drive.bag' is no folder")));
  EXPECT_THAT([&] { ReadSurveyDrive(file + "x"); },
              ThrowsMessage<Error>(HasSubstr("drive.bagx' does not exist")));
}

TEST(TumStamps, KeepAllDigits) {
  EXPECT_EQ(ParseStampNs("1305031102.175304"), 1305031102175304000);
  EXPECT_EQ(ParseStampNs("7"), 7000000000);
  for (const char* bad : {"", ".", "-1", "1e9", "1.2.3", "99999999999", "nan"}) {
    EXPECT_FALSE(ParseStampNs(bad)) << bad;
  }
}

TEST(TumAssociations, StayInsideTheFolder) {
  EXPECT_EQ(ParseTumAssociations("# c\n1.5 rgb/a.png 1.6 depth/a.png\n", "a.txt").size(), 1U);
  EXPECT_EQ(ParseTumAssociations("1 a.png\r\r\n\r\r\n", "a.txt").size(), 1U);
  EXPECT_TRUE(ParseTumTrajectory("\r\r\n", "t.txt").empty());
  for (const char* bad : {"1 ../a.png 1 d.png", "1 /etc/passwd", "1 a.png 1", "2 a.png\n1 b.png"}) {
    EXPECT_THROW(ParseTumAssociations(bad, "a.txt"), Error) << bad;
  }
}

TEST(KittiPoses, RefusesWhatIsNoRotation) {
  EXPECT_EQ(ParseKittiPoses("1 0 0 1 0 1 0 2 0 0 1 3\n", "p.txt").size(), 1U);
  for (const char* bad : {"1 0 0 1 0 1 0 2 0 0 1\n", "2 0 0 1 0 1 0 2 0 0 1 3\n",
                          "1 0 0 1 0 1 0 2 0 0 -1 3\n", "1 0 0 inf 0 1 0 2 0 0 1 3\n"}) {
    EXPECT_THAT([&] { ParseKittiPoses(bad, "p.txt"); },
                ThrowsMessage<Error>(HasSubstr("line 1 of 'p.txt'")))
        << bad;
  }
}

TEST(CameraFiles, ThatOfTheRoadSurveyIsValid) {
  const CameraFile camera =
      ReadCameraFile(std::string(LIVEMAP_SOURCE_DIR) + "/config/cameras/road_survey.yaml");
  EXPECT_EQ(camera.name, "road_survey");
  EXPECT_EQ(camera.intrinsics.width, 640);
}

TEST(CameraFiles, NameTheKeyThatIsWrong) {
  EXPECT_THAT([] { ParseCameraFile("{", "c.yaml"); }, ThrowsMessage<Error>(HasSubstr("no YAML")));
  EXPECT_THAT([] { ParseCameraFile("mounting: {}\nwidth: 640\nheight: .nan", "c.yaml"); },
              ThrowsMessage<Error>(HasSubstr("'height' of the camera file 'c.yaml' is .nan")));
  EXPECT_THAT([] { ParseCameraFile("mounting: {}\nfocal: 3", "c.yaml"); },
              ThrowsMessage<Error>(HasSubstr("no key 'focal'")));
}

TEST(CameraMounting, LooksDownAndLeftForPositiveAngles) {
  CameraMounting mounting;
  mounting.pitch_deg = 10;
  mounting.yaw_deg = 20;
  const Eigen::Vector3d view = mounting.BaseFromOptical().linear() * Eigen::Vector3d::UnitZ();
  EXPECT_GT(view.x(), 0.9);
  EXPECT_GT(view.y(), 0.3);
  EXPECT_LT(view.z(), -0.17);
}

TEST(RealData, SurveySectionsAndSequencesAreRead) {
  const std::string data = DataDirectory();
  if (!std::filesystem::is_directory(data)) GTEST_SKIP() << "skipped, no data";
  const SurveyDrive drive = ReadSurveyDrive(data + "/road_survey/386RS191729");
  EXPECT_EQ(drive.frames.size(), 104U);
  EXPECT_EQ(ReadImageFile(drive.frames[0].image_path, 640, 400).header.width, 640);
  const Sequence tum = ReadTumSequence(data + "/rgbd/tum_fr1_xyz_10");
  EXPECT_EQ(tum.frames.size(), 10U);
  EXPECT_EQ(tum.poses.size(), 10U);
  const Sequence kitti = ReadKittiSequence(data + "/mono/kitti_a", 10);
  EXPECT_EQ(kitti.frames.size(), 51U);
  EXPECT_EQ(kitti.poses.size(), 51U);
}

}  // namespace
}  // namespace livemap::datasets
