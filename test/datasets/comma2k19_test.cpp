#include "datasets/comma2k19.h"

#include <gmock/gmock.h>

#include <string>

#include "common/error.h"

namespace livemap::datasets {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Comma2k19, ReadsTheColumnsThatAreUsed) {
  const auto fixes = ParseRecordedFixes(
      "t_s,lat_deg,lon_deg,speed_mps\r\n1.5,48,11.5,7\r\n1.6,48.1,11,7\r\n", "f");
  ASSERT_EQ(fixes.size(), 2U);
  EXPECT_EQ(fixes[1].stamp_ns, 1'600'000'000);
  EXPECT_DOUBLE_EQ(fixes[1].position.latitude_deg, 48.1);
  const auto poses = ParseRecordedPoses(
      "t_s,ecef_x_m,ecef_y_m,ecef_z_m,q_w,q_x,q_y,q_z\n1,6378137,0,0,0.6,0,0,0.8\n", "p");
  EXPECT_DOUBLE_EQ(poses[0].earth_from_vehicle.z(), 0.8);
  const auto speeds = ParseRecordedSpeeds("t_s,speed_mps\n1,7.5\n", "s");
  EXPECT_DOUBLE_EQ(speeds[0].speed_mps, 7.5);
}

TEST(Comma2k19, ADriveMayBeginAtItsOwnZero) {
  const auto speeds = ParseRecordedSpeeds("t_s,speed_mps\n0,7.5\n0.02,7.5\n", "s");
  ASSERT_EQ(speeds.size(), 2U);
  EXPECT_EQ(speeds[0].stamp_ns, 0);
}

TEST(Comma2k19, NamesTheLineThatIsWrong) {
  const auto refused = [](auto parse, const std::string& text, const std::string& words) {
    EXPECT_THAT([&] { parse(text, "x.csv"); }, ThrowsMessage<Error>(HasSubstr(words))) << text;
  };
  const std::string fix = "t_s,lat_deg,lon_deg\n";
  refused(ParseRecordedFixes, "", "line 1 of 'x.csv'");
  refused(ParseRecordedFixes, "t_s,lat_deg\n1,2\n", "line 1 of 'x.csv'");
  refused(ParseRecordedFixes, fix, "no row");
  refused(ParseRecordedSpeeds, "t_s,speed_mps2\n1,2\n", "line 1 of 'x.csv'");
  refused(ParseRecordedFixes, fix + "1,2\n", "line 2 of 'x.csv'");
  refused(ParseRecordedFixes, fix + "1,nan,3\n", "line 2 of 'x.csv'");
  refused(ParseRecordedFixes, fix + "1,91,3\n", "latitudes");
  refused(ParseRecordedFixes, fix + "1,9,3\n1,9,3\n", "line 3 of 'x.csv'");
  refused(ParseRecordedFixes, fix + "1e300,9,3\n", "a time");
  refused(ParseRecordedFixes, fix + "-0.1,9,3\n", "a time");
  const std::string pose = "t_s,ecef_x_m,ecef_y_m,ecef_z_m,q_w,q_x,q_y,q_z\n";
  refused(ParseRecordedPoses, pose + "1,0,0,0,1,0,0,0\n", "centre of the earth");
  refused(ParseRecordedPoses, pose + "1,6378137,0,0,1,1,0,0\n", "quaternions");
  refused(ParseRecordedSpeeds, "t_s,speed_mps\n1,1000\n", "speeds");
  refused([](const std::string& text, const char*) { ReadComma2k19(text); }, "/nowhere",
          "/nowhere");
}

}  // namespace
}  // namespace livemap::datasets
