#include "simulation/world/route_road.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "common/error.h"
#include "simulation/world/road_line.h"

namespace livemap::simulation {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr geo::GeoPoint kStart{48.1, 11.5};

/// Points of a line in the plane of its start, metres east and north.
std::vector<geo::GeoPoint> Line(const std::vector<Eigen::Vector2d>& places) {
  const geo::LocalFrame frame(kStart);
  std::vector<geo::GeoPoint> points;
  for (const Eigen::Vector2d& place : places) points.push_back(frame.ToGeo(place));
  return points;
}

double DistanceToLine(const Eigen::Vector2d& place, const std::vector<Eigen::Vector2d>& line) {
  double nearest = 1e9;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d way = line[i + 1] - line[i];
    const double t = std::min(1.0, std::max(0.0, (place - line[i]).dot(way) / way.squaredNorm()));
    nearest = std::min(nearest, (place - line[i] - t * way).norm());
  }
  return nearest;
}

double FarthestFromLine(const RoadLine& road, const std::vector<Eigen::Vector2d>& line) {
  double farthest = 0;
  for (double along = 0; along <= road.length_m(); along += 0.5) {
    farthest = std::max(farthest, DistanceToLine(road.At(along, 0, 0).head<2>(), line));
  }
  return farthest;
}

TEST(RouteRoad, GentleRouteIsFollowedWithinThirtyCentimetresFromEndToEnd) {
  std::vector<Eigen::Vector2d> line = {{0, 0}};
  double heading = 0.3;
  for (int i = 0; i < 60; ++i) {
    line.emplace_back(line.back() + 80 * Eigen::Vector2d(std::cos(heading), std::sin(heading)));
    heading += (i % 7 < 4 ? 1 : -1) * 10 * M_PI / 180;
  }
  const RouteRoad laid = LayRoad(Line(line), "gentle");
  const RoadLine road(laid.bearing_deg, laid.pieces);
  EXPECT_LT(FarthestFromLine(road, line), 0.3);
  EXPECT_GT(FarthestFromLine(road, line), 0.15) << "a road that turns cannot keep to the corners";
  EXPECT_LT((road.At(road.length_m(), 0, 0).head<2>() - line.back()).norm(), 0.2);
  EXPECT_NEAR(road.length_m(), laid.length_m, 1e-9);
}

TEST(RouteRoad, DenselyDrawnBendIsFollowedClosely) {
  std::vector<Eigen::Vector2d> line;
  for (double along = 0; along < 250; along += 5) {
    line.emplace_back(80 * std::sin(along / 80), 80 * (1 - std::cos(along / 80)));
  }
  const RouteRoad laid = LayRoad(Line(line), "bend");
  const RoadLine road(laid.bearing_deg, laid.pieces);
  EXPECT_LT(FarthestFromLine(road, line), 0.1);
}

TEST(RouteRoad, DepartsAtACornerByWhatItsCurveStates) {
  for (const auto& [degrees, max_m] :
       {std::pair{5.0, 0.1}, {10.0, 0.25}, {30.0, 2.0}, {60.0, 8.5}, {90.0, 23.0}}) {
    const double turn = degrees * M_PI / 180;
    const std::vector<Eigen::Vector2d> line = {
        {0, 0},
        {300, 0},
        Eigen::Vector2d(300, 0) + 300 * Eigen::Vector2d(std::cos(turn), -std::sin(turn))};
    const RouteRoad laid = LayRoad(Line(line), "corner");
    const RoadLine road(laid.bearing_deg, laid.pieces);
    const double departure_m = TightestCurve(turn).departure_m;
    EXPECT_LT(departure_m, max_m) << degrees;
    double nearest = 1e9;
    double sharpest = 0;
    for (double along = 0; along < road.length_m(); along += 0.5) {
      nearest = std::min(nearest, (road.At(along, 0, 0).head<2>() - line[1]).norm());
      sharpest =
          std::max(sharpest, std::abs(road.HeadingRad(along + 0.5) - road.HeadingRad(along)) / 0.5);
    }
    if (degrees > 9) {
      // Gentler corners get a curve that is longer than it must be.
      EXPECT_NEAR(nearest, departure_m, 0.05) << degrees;
      EXPECT_NEAR(1 / sharpest, kTightestRadiusM, 1.5) << degrees;
    }
    EXPECT_GT(1 / sharpest, kTightestRadiusM - 0.5) << degrees;
    EXPECT_LT((road.At(road.length_m(), 0, 0).head<2>() - line[2]).norm(), 0.2) << degrees;
  }
}

TEST(RouteRoad, BearingIsThatOfTheFirstSegment) {
  EXPECT_NEAR(LayRoad(Line({{0, 0}, {-100, 0}}), "west").bearing_deg, 270, 1e-3);
  EXPECT_NEAR(LayRoad(Line({{0, 0}, {100, 100}}), "north-east").bearing_deg, 45, 1e-3);
}

TEST(RouteRoad, RepeatedPointsDoNotCount) {
  const RouteRoad once = LayRoad(Line({{0, 0}, {100, 0}, {200, 10}}), "a");
  const RouteRoad twice = LayRoad(Line({{0, 0}, {0, 0}, {100, 0}, {100, 0}, {200, 10}}), "a");
  EXPECT_NEAR(once.length_m, twice.length_m, 1e-6);
}

TEST(RouteRoad, CornerWithoutRoomIsRefusedByItsVertex) {
  const std::vector<geo::GeoPoint> points = Line({{0, 0}, {200, 0}, {250, 0.001}, {250, 50}});
  EXPECT_THAT([&] { LayRoad(points, "sharp.geojson"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("'sharp.geojson', vertex 3 (48.1"),
                                         HasSubstr("90.0 degrees"), HasSubstr("48.0 m radius"),
                                         HasSubstr("accepted is a segment of at least"))));
}

TEST(RouteRoad, AcceptsTheSegmentThatItsRefusalAsksFor) {
  const double needs_m = TightestCurve(M_PI / 2).tangent_m;
  EXPECT_NO_THROW(LayRoad(Line({{0, 0}, {200, 0}, {200, needs_m + 0.05}}), "fits"));
  EXPECT_THROW(LayRoad(Line({{0, 0}, {200, 0}, {200, needs_m - 0.05}}), "short"), Error);
}

TEST(RouteRoad, RefusesTurningBackFarPointsAndASinglePlace) {
  EXPECT_THAT(
      [] {
        LayRoad(Line({{0, 0}, {900, 0}, {0, 50}}), "back");
      },
      ThrowsMessage<Error>(AllOf(HasSubstr("vertex 2"), HasSubstr("at most 120"))));
  EXPECT_THAT(
      [] {
        LayRoad({kStart, {50.1, 11.5}}, "far");
      },
      ThrowsMessage<Error>(AllOf(HasSubstr("vertex 2"), HasSubstr("100 km"))));
  EXPECT_THAT(
      [] {
        LayRoad({kStart, kStart}, "one");
      },
      ThrowsMessage<Error>(HasSubstr("two different points")));
}

}  // namespace
}  // namespace livemap::simulation
