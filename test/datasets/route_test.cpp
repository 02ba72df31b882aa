#include "datasets/route.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "common/error.h"

namespace livemap::datasets {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kPi = 3.14159265358979323846;

TEST(Route, StraightRouteLeavesAtItsBearingWithoutEnd) {
  const Route route = Route::Straight({-23.5, -46.6}, kPi / 2);
  EXPECT_TRUE(std::isinf(route.length_m()));
  const RoutePose pose = route.At(500);
  EXPECT_NEAR(geo::GeodesicDistanceM({-23.5, -46.6}, pose.position), 500, 1e-6);
  EXPECT_GT(pose.position.longitude_deg, -46.6);
  EXPECT_NEAR(pose.bearing_rad, kPi / 2, 1e-4);
  EXPECT_LT(route.At(-5).position.longitude_deg, -46.6);
}

TEST(Route, FollowsItsPiecesByDrivenDistance) {
  const std::string text = R"({"type":"FeatureCollection","features":[{"type":"Feature",
      "properties":null,"geometry":{"type":"LineString",
      "coordinates":[[8,50],[8,50.001],[8,50.001],[8.002,50.001,120]]}}]})";
  const Route route = ParseRoute(text, "r.geojson");
  const double first_m = geo::GeodesicDistanceM({50, 8}, {50.001, 8});
  const double second_m = geo::GeodesicDistanceM({50.001, 8}, {50.001, 8.002});
  EXPECT_NEAR(route.length_m(), first_m + second_m, 1e-6);
  EXPECT_NEAR(route.At(first_m / 2).bearing_rad, 0, 1e-6);
  EXPECT_NEAR(route.At(first_m / 2).position.latitude_deg, 50.0005, 1e-7);
  EXPECT_NEAR(route.At(first_m + second_m / 2).position.longitude_deg, 8.001, 1e-6);
  // Past the end it goes on straight.
  EXPECT_GT(route.At(first_m + second_m + 10).position.longitude_deg, 8.002);
}

TEST(Route, NamesWhatIsWrongWithAFile) {
  const auto refused = [](const std::string& text, const std::string& words) {
    EXPECT_THAT([&] { ParseRoute(text, "r.geojson"); }, ThrowsMessage<Error>(HasSubstr(words)))
        << text;
  };
  refused("{", "'r.geojson' is no GeoJSON");
  refused("[]", "accepted is a GeoJSON LineString");
  refused(R"({"type":"Point","coordinates":[1,2]})", "holds Point");
  refused(R"({"type":"FeatureCollection","features":[]})", "without a feature");
  refused(R"({"type":"LineString"})", "needs 2 to");
  refused(R"({"type":"LineString","coordinates":[[1,2]]})", "needs 2 to");
  refused(R"({"type":"LineString","coordinates":[[1,2],[1,2]]})", "two different points");
  refused(R"({"type":"LineString","coordinates":[[1,2],[1,95]]})", "position 2");
  refused(R"({"type":"LineString","coordinates":[[1,2],[1,null]]})", "position 2");
  refused(R"({"type":"LineString","coordinates":[[1,2],[1e400,3]]})", "r.geojson");
  refused(std::string(100000, '['), "no GeoJSON");
}

TEST(Route, RefusesAFileThatDoesNotExist) {
  EXPECT_THAT([] { ReadRoute("/nowhere/r.geojson"); },
              ThrowsMessage<Error>(HasSubstr("/nowhere/r.geojson")));
}

TEST(Route, RefusesAStartOffTheEarth) {
  EXPECT_THAT([] { Route::Straight({91, 0}, 0); }, ThrowsMessage<Error>(HasSubstr("LAT,LON")));
  EXPECT_THROW(Route::Straight({0, 0}, std::nan("")), Error);
}

}  // namespace
}  // namespace livemap::datasets
