#include "web/tiles/tile_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "common/error.h"
#include "common/sqlite.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

class TileFileTest : public testing::Test {
 protected:
  /// A file with the tables of MBTiles and what `rows` inserts.
  std::string Write(const std::string& rows) {
    const std::string path = folder_.path() + "/tiles.mbtiles";
    SqliteDatabase(path, false)
        .Execute(
            "CREATE TABLE IF NOT EXISTS metadata (name TEXT, value TEXT);"
            "CREATE TABLE IF NOT EXISTS tiles (zoom_level INTEGER, tile_column INTEGER, tile_row "
            "INTEGER, "
            "tile_data BLOB);" +
            rows);
    return path;
  }
  std::string WhyRefused(const std::string& path) {
    try {
      const TileFile tiles(path);
      return "";
    } catch (const Error& error) {
      return error.what();
    }
  }

  TemporaryFolder folder_;
};

constexpr char kPictures[] =
    "INSERT INTO tiles VALUES (1, 0, 1, x'89504e470d0a1a0a00'), (1, 1, 1, x'ffd8ffe000'), "
    "(1, 0, 0, x'52494646000000005745425000'), (1, 1, 0, x'3c7376673e'), (2, 0, 0, 'text'), "
    "(2, 1, 0, zeroblob(3000000));";

TEST_F(TileFileTest, FindsTilesFromTheNorthWithTheirTypesByContent) {
  const TileFile tiles(Write(kPictures));
  const auto png = tiles.Find(1, 0, 0);
  ASSERT_TRUE(png);
  EXPECT_STREQ(png->media_type, "image/png");
  EXPECT_EQ(png->content->size(), 9U);
  EXPECT_STREQ(tiles.Find(1, 1, 0)->media_type, "image/jpeg");
  EXPECT_STREQ(tiles.Find(1, 0, 1)->media_type, "image/webp");
}

TEST_F(TileFileTest, HasNoTileThatIsNoPictureOrTooLargeOrNotThere) {
  const TileFile tiles(Write(kPictures));
  EXPECT_FALSE(tiles.Find(1, 1, 1));  // An SVG may hold scripts.
  EXPECT_FALSE(tiles.Find(2, 0, 3));
  EXPECT_FALSE(tiles.Find(2, 1, 3));
  EXPECT_FALSE(tiles.Find(3, 0, 0));
  EXPECT_FALSE(tiles.Find(1, 2, 0));
  EXPECT_FALSE(tiles.Find(23, 0, 0));
}

TEST_F(TileFileTest, ReadsWhatTheFileSaysOfItself) {
  const TileFile tiles(
      Write("INSERT INTO metadata VALUES ('minzoom', '3'), ('maxzoom', '14'), ('format', 'png'), "
            "('attribution', '&copy; <a href=\"x\">A &amp; B</a>');"));
  EXPECT_EQ(tiles.min_zoom(), 3);
  EXPECT_EQ(tiles.max_zoom(), 14);
  EXPECT_EQ(tiles.attribution(), "\u00a9 A & B");
  const TileFile silent(
      Write("DELETE FROM metadata; INSERT INTO metadata VALUES ('maxzoom', 'many');"));
  EXPECT_EQ(silent.max_zoom(), 22);
  EXPECT_EQ(silent.attribution(), "");
}

TEST_F(TileFileTest, RefusesWhatHasNoRasterTiles) {
  EXPECT_THAT(WhyRefused(folder_.path() + "/none"), HasSubstr("/none' is refused"));
  const std::string path = folder_.path() + "/text";
  std::ofstream(path) << "no database, but of some length, so that it is looked at as one";
  EXPECT_THAT(WhyRefused(path), HasSubstr("not a database; accepted are MBTiles"));
  SqliteDatabase(folder_.path() + "/empty", false).Execute("CREATE TABLE other (a)");
  EXPECT_THAT(WhyRefused(folder_.path() + "/empty"), HasSubstr("no such table: tiles"));
  EXPECT_THAT(WhyRefused(Write("INSERT INTO metadata VALUES ('format', 'pbf');")),
              HasSubstr("vectors"));
}

TEST_F(TileFileTest, AQueryWithoutEndIsEnded) {
  const std::string path = folder_.path() + "/endless";
  SqliteDatabase(path, false)
      .Execute(
          "CREATE VIEW tiles AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM "
          "n) SELECT i AS zoom_level, -1 AS tile_column, -1 AS tile_row, x'ffd8ff' AS "
          "tile_data FROM n");
  const TileFile tiles(path);
  EXPECT_FALSE(tiles.Find(1, 0, 0));
  EXPECT_FALSE(tiles.Find(1, 0, 0));
}

TEST(TilePathTest, OnlyPlacesOfTilesAreAccepted) {
  const auto place = ParseTilePath("/tiles/14/4551/6169");
  ASSERT_TRUE(place);
  EXPECT_EQ(place->zoom, 14);
  EXPECT_EQ(place->x, 4551U);
  EXPECT_EQ(place->y, 6169U);
  EXPECT_TRUE(ParseTilePath("/tiles/0/0/0"));
  for (const char* path :
       {"/tiles/", "/tiles/1/0", "/tiles/1/0/", "/tiles/1/0/0/", "/tiles/1/2/0", "/tiles/1/0/2",
        "/tiles/-1/0/0", "/tiles/23/0/0", "/tiles/1/0/0.png", "/tiles/a/0/0", "/tiles/1//0",
        "/tiles/99999999999/0/0", "/tile/1/0/0", "/tiles/ 1/0/0"}) {
    EXPECT_FALSE(ParseTilePath(path)) << path;
  }
}

}  // namespace
}  // namespace livemap::web
