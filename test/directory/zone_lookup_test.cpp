#include "directory/zone_lookup.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "test/directory/test_authority.h"
#include "test/support/temporary_directory.h"

namespace livemap::directory {
namespace {

constexpr geo::GeoPoint kOakland{40.44, -79.95};

class ZoneLookupTest : public testing::Test {
 protected:
  ZoneLookupTest() : path_(folder_.path() + "/zones.cms") {
    std::ofstream(folder_.path() + "/ca.pem") << authority_.Pem();
  }

  /// As another part of the vehicle writes it, `later_s` after the file before.
  void Write(const std::string& bytes, int later_s) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
    std::filesystem::last_write_time(
        path_, std::filesystem::last_write_time(path_) + std::chrono::seconds(later_s));
  }
  ZoneLookup Lookup() {
    return {
        {path_}, TrustedAuthority::Read(folder_.path() + "/ca.pem"), [this] { return now_ns_; }};
  }

  const TestAuthority authority_;
  const test::TemporaryDirectory folder_;
  const std::string path_;
  std::int64_t now_ns_ = kMarchNs;
};

TEST_F(ZoneLookupTest, KnowsNoZoneUntilThereIsADirectory) {
  ZoneLookup zones = Lookup();
  EXPECT_EQ(zones.IdAt(kOakland), "");
  Write(authority_.Sign(DirectoryText(1)), 0);
  EXPECT_EQ(zones.IdAt(kOakland), "oakland");
  EXPECT_EQ(zones.IdAt({50, 8}), "") << "far from all zones";
}

TEST_F(ZoneLookupTest, AZoneIsGoneOnlyByTheWordOfAValidDirectory) {
  ZoneLookup zones = Lookup();
  EXPECT_FALSE(zones.IsGone("oakland")) << "there is no directory yet";
  Write(authority_.Sign(DirectoryText(1)), 0);
  EXPECT_FALSE(zones.IsGone("oakland"));
  EXPECT_TRUE(zones.IsGone("atlantis"));
  now_ns_ += 100'000'000'000'000'000;  // Over three years.
  EXPECT_FALSE(zones.IsGone("atlantis")) << "it has expired";
}

TEST_F(ZoneLookupTest, APlaceDeepInAnotherZonesAreaIsNoneOfAZonesBusiness) {
  ZoneLookup zones = Lookup();
  const geo::GeoPoint border{40.44, -79.94};
  const auto east_m = [&border](double way_m) {
    return geo::GeodesicDestination(border, M_PI / 2, way_m);
  };
  EXPECT_FALSE(zones.IsBeyond("oakland", east_m(600))) << "there is no directory yet";
  std::string text = DirectoryText(1);
  const std::string shadyside =
      R"({"type": "Feature", "id": "shadyside", "geometry": {"type": "Polygon", "coordinates":)"
      R"([[[-79.94, 40.43], [-79.92, 40.43], [-79.92, 40.45], [-79.94, 40.45],)"
      R"([-79.94, 40.43]]]}, "properties": {"brokers": [{"host": "shadyside.example.org"}]}}, )";
  text.insert(text.find("{\"type\": \"Feature\","), shadyside);
  Write(authority_.Sign(text), 0);
  EXPECT_FALSE(zones.IsBeyond("oakland", east_m(-600))) << "its own area";
  EXPECT_FALSE(zones.IsBeyond("oakland", east_m(490))) << "near the border";
  EXPECT_TRUE(zones.IsBeyond("oakland", east_m(510)));
  EXPECT_FALSE(zones.IsBeyond("shadyside", east_m(510)));
  EXPECT_TRUE(zones.IsBeyond("shadyside", east_m(-510)));
  EXPECT_FALSE(zones.IsBeyond("oakland", {50, 8})) << "no zone's area";
  EXPECT_FALSE(zones.IsBeyond("atlantis", east_m(510))) << "whose area nobody knows";
}

TEST_F(ZoneLookupTest, ReadsTheFileAgainWhenItHasChanged) {
  Write(authority_.Sign(DirectoryText(1)), 0);
  ZoneLookup zones = Lookup();
  EXPECT_EQ(zones.IdAt(kOakland), "oakland");
  std::string text = DirectoryText(2);
  text.replace(text.find("oakland"), 7, "shadyside");
  Write(authority_.Sign(text), 1);
  EXPECT_EQ(zones.IdAt(kOakland), "shadyside");
  std::filesystem::remove(path_);
  EXPECT_EQ(zones.IdAt(kOakland), "shadyside") << "which is still in time";
}

TEST_F(ZoneLookupTest, AHalfWrittenOrOlderFileTakesNothingAway) {
  Write(authority_.Sign(DirectoryText(2)), 0);
  ZoneLookup zones = Lookup();
  EXPECT_EQ(zones.IdAt(kOakland), "oakland");
  const std::string whole = authority_.Sign(DirectoryText(3));
  Write(whole.substr(0, whole.size() / 2), 1);
  EXPECT_EQ(zones.IdAt(kOakland), "oakland") << "half of it";
  std::string older = DirectoryText(1);
  older.replace(older.find("oakland"), 7, "shadyside");
  Write(authority_.Sign(older), 2);
  EXPECT_EQ(zones.IdAt(kOakland), "oakland") << "an older one";
  std::string newer = DirectoryText(3);
  newer.replace(newer.find("oakland"), 7, "shadyside");
  Write(authority_.Sign(newer), 3);
  EXPECT_EQ(zones.IdAt(kOakland), "shadyside");
}

TEST_F(ZoneLookupTest, ADirectoryThatIsForgedOrExpiredCountsForNothing) {
  Write(TestAuthority().Sign(DirectoryText(1)), 0);
  ZoneLookup zones = Lookup();
  EXPECT_EQ(zones.IdAt(kOakland), "");
  Write(authority_.Sign(DirectoryText(1)), 1);
  EXPECT_EQ(zones.IdAt(kOakland), "oakland");
  now_ns_ += 100'000'000'000'000'000;  // Over three years.
  EXPECT_EQ(zones.IdAt(kOakland), "");
}

}  // namespace
}  // namespace livemap::directory
