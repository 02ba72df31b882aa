#include "streets/street_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <osmium/io/pbf_output.hpp>
#include <osmium/io/reader.hpp>
#include <osmium/io/writer.hpp>
#include <osmium/io/xml_input.hpp>

#include "common/error.h"

namespace livemap::streets {
namespace {

/// An extract of a node line at 49.2 degrees north, with `ways`.
std::string Extract(const std::string& ways) {
  std::string text = "<?xml version='1.0' encoding='UTF-8'?>\n<osm version='0.6'>\n";
  for (int i = 1; i <= 9; ++i) {
    text += "<node id='" + std::to_string(i) + "' lat='49.2' lon='7.00" + std::to_string(i) + "'/>";
  }
  return text + ways + "</osm>\n";
}

std::string WayOf(int id, int from, int to, const std::string& tags) {
  return "<way id='" + std::to_string(id) + "'><nd ref='" + std::to_string(from) + "'/><nd ref='" +
         std::to_string(to) + "'/>" + tags + "</way>";
}

std::string Tag(const std::string& key, const std::string& value) {
  return "<tag k='" + key + "' v='" + value + "'/>";
}

StreetMap Parsed(const std::string& ways) { return ParseStreets(Extract(ways), "osm", "town.osm"); }

std::string RefusalOf(const std::string& bytes, const std::string& format) {
  try {
    ParseStreets(bytes, format, "town.osm");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(StreetFileTest, ReadsNameDirectionLevelAndWidth) {
  const StreetMap map = Parsed(
      WayOf(7, 1, 2,
            Tag("highway", "primary") + Tag("name", "Hauptstra&#223;e") + Tag("oneway", "-1") +
                Tag("bridge", "yes") + Tag("lanes", "3") + Tag("width", "9.5 m")) +
      WayOf(8, 2, 3,
            Tag("highway", "motorway_link") + Tag("layer", "-2") + Tag("tunnel", "yes") +
                Tag("ref", "A 7")) +
      WayOf(9, 3, 4, Tag("highway", "residential") + Tag("junction", "roundabout")));
  ASSERT_EQ(map.segments(), 3U);
  const Street& bridge = map.StreetOf(0);
  EXPECT_EQ(bridge.id, 7);
  EXPECT_EQ(map.NameOf(bridge), "Hauptstra\u00dfe");
  EXPECT_EQ(bridge.kind, StreetKind::kPrimary);
  EXPECT_FALSE(bridge.forward);
  EXPECT_TRUE(bridge.backward);
  EXPECT_TRUE(bridge.bridge);
  EXPECT_EQ(bridge.layer, 1);
  EXPECT_EQ(bridge.lanes, 3);
  EXPECT_FLOAT_EQ(bridge.width_m, 9.5F);
  const Street& ramp = map.StreetOf(1);
  EXPECT_EQ(map.NameOf(ramp), "A 7") << "a number stands for a name";
  EXPECT_TRUE(ramp.link);
  EXPECT_FALSE(ramp.backward) << "motorways are one-way where nothing is said";
  EXPECT_EQ(ramp.layer, -2);
  EXPECT_TRUE(map.StreetOf(2).roundabout);
  EXPECT_FALSE(map.StreetOf(2).backward);
}

TEST(StreetFileTest, LeavesOutWhatIsNotDriven) {
  const StreetMap map = Parsed(
      WayOf(1, 1, 2, Tag("highway", "footway")) + WayOf(2, 2, 3, Tag("waterway", "river")) +
      WayOf(3, 3, 4, Tag("highway", "residential") + Tag("access", "no")) +
      WayOf(4, 4, 5,
            Tag("highway", "residential") + Tag("access", "no") + Tag("motor_vehicle", "yes")) +
      WayOf(5, 5, 6, Tag("highway", "service") + Tag("area", "yes")));
  ASSERT_EQ(map.streets(), 1U);
  EXPECT_EQ(map.StreetOf(0).id, 4);
}

std::string RestrictionOfTurn(const std::string& rule, int from, int via, int to) {
  return "<relation id='1'><member type='way' ref='" + std::to_string(from) +
         "' role='from'/><member type='node' ref='" + std::to_string(via) +
         "' role='via'/><member type='way' ref='" + std::to_string(to) + "' role='to'/>" +
         Tag("type", "restriction") + rule + "</relation>";
}

/// Ids of the ways on behind the street 1, which leads to the node 2, where 2, 3 and 4 begin.
std::vector<std::int64_t> OnwardsWith(const std::string& relations) {
  const std::string street = Tag("highway", "primary");
  const StreetMap map = Parsed(WayOf(1, 1, 2, street) + WayOf(2, 2, 3, street) +
                               WayOf(3, 2, 4, street) + WayOf(4, 2, 5, street) + relations);
  std::vector<std::int64_t> ids;
  for (const Travel& way : map.Continuations({0, true}))
    ids.push_back(map.StreetOf(way.segment).id);
  return ids;
}

TEST(StreetFileTest, RestrictionsOfTurnsCount) {
  using Ids = std::vector<std::int64_t>;
  const std::string no = Tag("restriction", "no_left_turn");
  EXPECT_EQ(OnwardsWith(""), (Ids{2, 3, 4}));
  EXPECT_EQ(OnwardsWith(RestrictionOfTurn(no, 1, 2, 3)), (Ids{2, 4}));
  EXPECT_EQ(OnwardsWith(RestrictionOfTurn(Tag("restriction", "only_straight_on"), 1, 2, 2)),
            (Ids{2}));
  EXPECT_EQ(OnwardsWith(RestrictionOfTurn(no + Tag("except", "bus;motorcar"), 1, 2, 3)),
            (Ids{2, 3, 4}));
  EXPECT_EQ(OnwardsWith(RestrictionOfTurn(Tag("restriction:hgv", "no_left_turn"), 1, 2, 3)),
            (Ids{2, 3, 4}));
  // Of a street that comes from elsewhere, at another node, of streets that there are not.
  EXPECT_EQ(OnwardsWith(RestrictionOfTurn(no, 4, 2, 3) + RestrictionOfTurn(no, 1, 3, 3) +
                        RestrictionOfTurn(no, 1, 2, 99) + RestrictionOfTurn(no, 1, 77, 3)),
            (Ids{2, 3, 4}));
}

TEST(StreetFileTest, WordsForNumbersAreNotTold) {
  const StreetMap map = Parsed(WayOf(1, 1, 2,
                                     Tag("highway", "primary") + Tag("lanes", "many") +
                                         Tag("width", "-3") + Tag("layer", "1e99")));
  EXPECT_EQ(map.StreetOf(0).lanes, 0);
  EXPECT_EQ(map.StreetOf(0).width_m, 0);
  EXPECT_EQ(map.StreetOf(0).layer, 0);
}

TEST(StreetFileTest, NodesMayStandBehindTheWaysAndBeMissing) {
  const std::string text =
      "<osm version='0.6'>" + WayOf(1, 1, 2, Tag("highway", "primary")) +
      WayOf(2, 2, 30, Tag("highway", "primary")) +
      "<node id='1' lat='49.2' lon='7.1'/><node id='2' lat='49.2' lon='7.101'/></osm>";
  const StreetMap map = ParseStreets(text, "osm", "town.osm");
  EXPECT_EQ(map.segments(), 1U);
  EXPECT_EQ(map.counters().missing_nodes, 1U);
}

TEST(StreetFileTest, RefusesWhatIsNoExtractAndSaysWhatIsAccepted) {
  for (const std::string& text :
       {std::string(), std::string("<osm"), std::string("{}"), std::string(1000, '\0'),
        std::string("<osm version='0.6'><node id='x' lat='1000' lon='7'/></osm>"), Extract("")}) {
    EXPECT_NE(RefusalOf(text, "osm").find("the street file 'town.osm' is refused"),
              std::string::npos)
        << text;
    EXPECT_NE(RefusalOf(text, "osm").find(".osm.pbf"), std::string::npos) << text;
    EXPECT_NE(RefusalOf(text, "pbf").find("refused"), std::string::npos) << text;
  }
  EXPECT_NE(RefusalOf("", "o5m").find("accepted are pbf and osm"), std::string::npos);
}

TEST(StreetFileTest, EntitiesThatGrowAreRefused) {
  const std::string text =
      "<?xml version='1.0'?><!DOCTYPE osm [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]>"
      "<osm version='0.6'>" +
      WayOf(1, 1, 2, Tag("highway", "primary") + Tag("name", "&b;")) + "</osm>";
  EXPECT_NE(RefusalOf(text, "osm").find("refused"), std::string::npos);
}

TEST(StreetFileTest, ReadsFilesByTheirEnding) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "livemap_street_file_test";
  std::filesystem::create_directories(folder);
  const std::string path = (folder / "town.osm").string();
  std::ofstream(path) << Extract(WayOf(1, 1, 2, Tag("highway", "primary")));
  EXPECT_EQ(ReadStreetFile(path).segments(), 1U);
  EXPECT_THROW(ReadStreetFile((folder / "none.osm").string()), Error);
  EXPECT_THROW(ReadStreetFile((folder / "town.txt").string()), Error);
  EXPECT_THROW(ReadStreetFile(folder.string()), Error);
  EXPECT_THROW(ReadStreetFile("http://127.0.0.1:1/town.osm"), Error);
  std::filesystem::rename(path, folder / "town.osm.pbf");
  EXPECT_THROW(ReadStreetFile((folder / "town.osm.pbf").string()), Error);
  std::filesystem::remove_all(folder);
}

TEST(StreetFileTest, ReadsThePbfThatOsmiumWrites) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("street_file_" + std::to_string(getpid()));
  std::filesystem::create_directory(folder);
  const std::string xml = (folder / "town.osm").string(), pbf = (folder / "town.osm.pbf").string();
  std::ofstream(xml) << Extract(WayOf(7, 1, 4, Tag("highway", "primary") + Tag("name", "Am Tor")) +
                                WayOf(8, 4, 9, Tag("highway", "residential")));
  {
    osmium::io::Reader reader{xml};
    osmium::io::Writer writer{pbf, osmium::io::Header{}};
    while (osmium::memory::Buffer buffer = reader.read()) writer(std::move(buffer));
    writer.close();
  }
  const StreetMap of_xml = ReadStreetFile(xml), of_pbf = ReadStreetFile(pbf);
  std::filesystem::remove_all(folder);
  ASSERT_EQ(of_pbf.segments(), of_xml.segments());
  ASSERT_GT(of_pbf.segments(), 0U);
  EXPECT_EQ(of_pbf.NameOf(of_pbf.StreetOf(0)), "Am Tor");
  EXPECT_EQ(of_pbf.StreetOf(0).id, of_xml.StreetOf(0).id);
}

TEST(StreetFileTest, CountsBeyondTheLimitsAreRefused) {
  StreetLimits limits;
  limits.max_streets = 1;
  const std::string ways =
      WayOf(1, 1, 2, Tag("highway", "primary")) + WayOf(2, 2, 3, Tag("highway", "primary"));
  EXPECT_THROW(ParseStreets(Extract(ways), "osm", "town.osm", limits), Error);
}

}  // namespace
}  // namespace livemap::streets
