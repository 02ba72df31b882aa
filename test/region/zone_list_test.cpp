#include "region/zone_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>

#include "common/error.h"
#include "test/support/temporary_directory.h"

namespace livemap::region {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

directory::ZoneDirectory Directory(const std::string& map) {
  return directory::ZoneDirectory::Parse(
      R"({"type":"FeatureCollection","livemap_zone_directory":1,"authority":"pgh","version":1,
"issued":"2026-01-01T00:00:00Z","expires":"2026-05-01T00:00:00Z","features":[{"type":"Feature","id":
"north","geometry":{"type":"Polygon","coordinates":[[[-80,40],[-79.9,40],[-79.9,40.5],[-80,40]]]},
"properties":{"name":"North","brokers":[{"host":"a.example"}])" +
          map + "}}]}",
      "zones");
}

std::string WhyRefused(const ZoneList& list, const directory::ZoneDirectory* directory = nullptr) {
  try {
    ZonesOf(list, directory);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ZoneList, HasZonesByHand) {
  const auto zones =
      ZonesOf({{{"a", "http://127.0.0.1:8080/"}, {"b", "https://b.example/map"}}, {}}, nullptr);
  ASSERT_THAT(zones, SizeIs(2));
  EXPECT_EQ(zones[0].id, "a");
  EXPECT_EQ(zones[0].url, "http://127.0.0.1:8080");
  EXPECT_EQ(zones[1].url, "https://b.example/map");
  EXPECT_FALSE(zones[1].area);
}

TEST(ZoneList, HasZonesOfTheDirectoryWithAreaAndName) {
  const auto directory = Directory(R"(,"map":"https://north.example/")");
  const auto zones = ZonesOf({}, &directory);
  ASSERT_THAT(zones, SizeIs(1));
  EXPECT_EQ(zones[0].name, "North");
  EXPECT_EQ(zones[0].url, "https://north.example");
  EXPECT_TRUE(zones[0].area);
  const auto by_hand =
      ZonesOf({{{"north", "http://localhost:1"}, {"x", "http://x"}}, {}}, &directory);
  ASSERT_THAT(by_hand, SizeIs(2));
  EXPECT_EQ(by_hand[0].url, "http://localhost:1");
  EXPECT_TRUE(by_hand[0].area);
}

TEST(ZoneList, RefusesAZoneWithoutAnAddressAndAnAddressThatIsNone) {
  const auto directory = Directory("");
  EXPECT_THAT(WhyRefused({}, &directory), HasSubstr("zone 'north' has no address"));
  for (const char* url : {"", "north.example", "ftp://a", "http://", "http://a b", "http://a?b=1",
                          "http://u:p@a/", "http://a/\r\nX: 1", "file:///etc/passwd"}) {
    EXPECT_THAT(WhyRefused({{{"a", url}}, {}}), HasSubstr("the address of zone 'a'")) << url;
  }
}

TEST(ZoneList, ReadsATokenAndNeverLetsItTravelUnprotected) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/token";
  std::ofstream(path) << "secret-of-miller\n";
  chmod(path.c_str(), 0600);
  const auto zones = ZonesOf({{{"a", "https://a.example"}}, {{"a", path}}}, nullptr);
  EXPECT_EQ(zones[0].token, "secret-of-miller");
  EXPECT_EQ(WhyRefused({{{"a", "http://127.0.0.1:8080"}}, {{"a", path}}}), "");
  EXPECT_EQ(WhyRefused({{{"a", "http://[::1]:8080"}}, {{"a", path}}}), "");
  EXPECT_THAT(WhyRefused({{{"a", "http://a.example"}}, {{"a", path}}}), HasSubstr("https://"));
  EXPECT_THAT(WhyRefused({{{"a", "http://127.0.0.1.example"}}, {{"a", path}}}),
              HasSubstr("https://"));
  EXPECT_THAT(WhyRefused({{{"a", "https://a.example"}}, {{"b", path}}}), HasSubstr("zone 'b'"));
  chmod(path.c_str(), 0644);
  EXPECT_THAT(WhyRefused({{{"a", "https://a.example"}}, {{"a", path}}}), HasSubstr("0600"));
}

TEST(SplitNamed, WantsANameAndAValue) {
  EXPECT_EQ(SplitNamed("--zone", "a=http://b=c").second, "http://b=c");
  for (const char* text : {"", "a", "=b", "a="}) {
    EXPECT_THROW(SplitNamed("--zone", text), Error) << text;
  }
}

}  // namespace
}  // namespace livemap::region
