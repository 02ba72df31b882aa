// A sound store of the vehicle into which something else wrote impossible values.
#include <gtest/gtest.h>

#include <filesystem>

#include "test/vehicle/reporting/known_reports.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

class BrokenRowsTest : public testing::Test {
 protected:
  BrokenRowsTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "livemap_rows_XXXXXX").string();
    directory_ = mkdtemp(pattern.data());
    config_.path = directory_ + "/map.sqlite3";
    LocalHazardMap map = Open();
    for (std::uint8_t i = 1; i < 4; ++i) map.Add(MakeReport(i));
    map.Apply({MakeNotice(11), MakeNotice(12)});
  }
  ~BrokenRowsTest() override { std::filesystem::remove_all(directory_); }

  LocalHazardMap Open() const {
    return LocalHazardMap(config_, protocol::HazardCatalogue(), kNowNs);
  }
  void Write(const std::string& sql) const {
    SqliteDatabase(config_.path, true).Execute("PRAGMA foreign_keys=OFF;" + sql);
  }
  static Uuid MakeUuid(std::uint8_t number) {
    Uuid uuid;
    uuid.bytes[0] = number;
    return uuid;
  }
  static std::string Where(std::uint8_t number) {
    char text[60];
    std::snprintf(text, sizeof text, "X'%02X000000000000000000000000000000'", number);
    return text;
  }
  static protocol::Report MakeReport(std::uint8_t number) {
    protocol::Report report;
    report.uuid = MakeUuid(number);
    report.stamp_ns = kNowNs;
    report.class_name = "cone";
    report.confidence = 0.5F;
    report.box = {1, 1, 2, 2};
    report.position = {40.0 + number, 8};
    report.covariance_m2 = Eigen::Matrix2d::Identity();
    report.image_width = report.image_height = 10;
    return report;
  }
  static protocol::Notice MakeNotice(std::uint8_t number) {
    protocol::Notice notice;
    notice.sequence = number;
    notice.previous_sequence = number == 11 ? 0 : number - 1U;
    notice.hazard_uuid = MakeUuid(number);
    notice.class_name = "deer";
    notice.confidence = 0.5F;
    notice.position = {40.0 + number, 8};
    return notice;
  }

  std::string directory_;
  LocalHazardMap::Config config_;
};

TEST_F(BrokenRowsTest, ASoundStoreHasNone) {
  const LocalHazardMap map = Open();
  EXPECT_EQ(map.broken_rows().count(), 0U);
  EXPECT_EQ(map.known_count(), 5U);
  EXPECT_EQ(map.pending_count(), 3U);
  EXPECT_EQ(map.map_sequence(), 12U);
}

TEST_F(BrokenRowsTest, AKnownHazardOfImpossibleValuesIsTakenOutAndTheOthersStay) {
  for (const char* broken :
       {"latitude = 91", "longitude = -9e999", "latitude = 'x'", "confidence = 2",
        "class_name = ''", "class_name = printf('%100s', 'x')", "sequence = -1",
        "sequence = 9223372036854775807", "news_ns = -1", "of_zone = 7", "id = x'00'",
        "zone = 'a/b'", "zone = x'00'", "course_rad = 7", "course_rad = -9e999", "course_rad = 'x'",
        "trails = x'00'", "trails = printf('%2000s', 'x')"}) {
    Write(std::string("UPDATE known SET ") + broken + " WHERE id = " + Where(12));
    LocalHazardMap map = Open();
    EXPECT_EQ(map.broken_rows().known, 1U) << broken;
    EXPECT_EQ(map.known_count(), 4U) << broken;
    EXPECT_EQ(map.Known(100).size(), 4U) << broken;
    Write("UPDATE zones SET map_sequence = 11");
    map.Apply({MakeNotice(12)});
    EXPECT_EQ(map.known_count(), 5U) << broken << ": told again it is known again";
  }
}

TEST_F(BrokenRowsTest, AReportOfImpossibleValuesIsLeftThereAndNotSentAndTheOthersAre) {
  for (const char* broken :
       {"latitude = 91", "variance_east = 9e999", "variance_north = -1", "confidence = 'x'",
        "stamp_ns = -1", "stamp_ns = 9223372036854775807", "x_min = 9e999", "class_name = ''",
        "drive_id = printf('%100s', 'x')", "image = zeroblob(20000000)", "zone = '#'"}) {
    SCOPED_TRACE(broken);
    std::filesystem::remove(config_.path + ".before");
    std::filesystem::copy_file(config_.path, config_.path + ".before");
    Write(std::string("UPDATE pending SET ") + broken + " WHERE uuid = " + Where(2));
    {
      LocalHazardMap map = Open();
      EXPECT_EQ(map.broken_rows().reports, 1U);
      EXPECT_EQ(map.pending_count(), 2U);
      EXPECT_EQ(map.Pending().size(), 2U);
      EXPECT_FALSE(map.LoadPending(MakeUuid(2)));
      EXPECT_TRUE(map.LoadPending(MakeUuid(1)));
      EXPECT_TRUE(map.LoadPending(MakeUuid(3)));
    }
    SqliteDatabase database(config_.path, true);
    SqliteStatement rows = database.Prepare("SELECT count(*) FROM pending");
    rows.Step();
    EXPECT_EQ(rows.Int(0), 3);
    rows.Reset();
    database.Execute(
        "UPDATE pending SET latitude=42, variance_east=1, variance_north=1, "
        "confidence=0.5, stamp_ns=1700000000000000000, x_min=1, class_name='cone', "
        "drive_id='', image=x'', zone=''");
  }
}

TEST_F(BrokenRowsTest, AReportWithoutAUuidKeepsNothingFromBeingForgotten) {
  Write("UPDATE pending SET uuid = NULL WHERE uuid = " + Where(2));
  config_.max_known = 3;
  LocalHazardMap map = Open();
  EXPECT_EQ(map.broken_rows().reports, 1U);
  protocol::Notice notice = MakeNotice(13);
  notice.stamp_ns = kNowNs;
  map.Apply({notice});
  EXPECT_EQ(map.known_count(), 3U);
}

TEST_F(BrokenRowsTest, AnImpossibleSequenceMeansThatNothingIsKnown) {
  for (const char* sql :
       {"UPDATE zones SET map_sequence = -5", "REPLACE INTO zones VALUES ('', 9223372036854775807)",
        "REPLACE INTO zones VALUES ('', 'x')", "REPLACE INTO zones VALUES ('a/b', 5)",
        "REPLACE INTO zones VALUES (printf('%65s', 'a'), 5)"}) {
    Write(sql);
    LocalHazardMap map = Open();
    EXPECT_EQ(map.broken_rows().known, 1U) << sql;
    EXPECT_EQ(map.map_sequence(), 0U) << sql;
  }
}

}  // namespace
}  // namespace livemap::vehicle
