#include "ros/conversions/cell_conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "common/error.h"

namespace livemap::ros_io {
namespace {

const geo::MapCell kHere = geo::MapCell::At({48.1, 11.5});
const geo::MapCell kThere = geo::MapCell::At({48.3, 11.5});

protocol::CellNews::Hazard PotholeOfCell(std::uint8_t number) {
  protocol::CellNews::Hazard hazard;
  hazard.hazard_uuid.bytes[0] = number;
  hazard.sequence = 100 + number;
  hazard.class_name = "pothole";
  hazard.confidence = 0.5F;
  hazard.position = {48.1, 11.5};
  hazard.stamp_ns = 1'700'000'000'123'456'789;
  return hazard;
}

TEST(CellConversionsTest, ARequestCrossesUnchanged) {
  protocol::CellRequest request;
  request.vehicle_id = "car-1";
  request.cells = {{kHere, 0}, {kThere, UINT64_MAX}};
  request.zone = "west";
  const protocol::CellRequest back = FromMessage(ToMessage(request));
  EXPECT_EQ(back.vehicle_id, "car-1");
  EXPECT_EQ(back.zone, "west");
  ASSERT_EQ(back.cells.size(), 2U);
  EXPECT_EQ(back.cells[0].cell, kHere);
  EXPECT_EQ(back.cells[1].cell, kThere);
  EXPECT_EQ(back.cells[1].sequence, UINT64_MAX);
}

TEST(CellConversionsTest, ImpossibleRequestsAreRefused) {
  const CellRequest valid = ToMessage(protocol::CellRequest{"car-1", {{kHere, 7}}, ""});
  CellRequest message = valid;
  message.cells[0] = 1U << 30;
  EXPECT_THROW(FromMessage(message), Error);
  message = valid;
  message.sequences.clear();
  EXPECT_THROW(FromMessage(message), Error);
  message = valid;
  message.cells.resize(65);
  message.sequences.resize(65);
  EXPECT_THROW(FromMessage(message), Error);
  message = valid;
  message.schema_version = 2;
  EXPECT_THROW(FromMessage(message), Error);
}

TEST(CellConversionsTest, HazardsStayWithTheirCells) {
  protocol::CellNews news;
  news.vehicle_id = "car-1";
  protocol::CellNews::Hazard gone;
  gone.hazard_uuid.bytes[0] = 9;
  gone.sequence = 12;
  gone.removed = true;
  news.cells.push_back({kHere, 7, 20, {PotholeOfCell(1), gone}});
  news.cells.push_back({kThere, 20, 20, {}});
  news.cells.push_back({kThere, 0, 20, {PotholeOfCell(2)}});
  const protocol::CellNews back = FromMessage(ToMessage(news));
  ASSERT_EQ(back.cells.size(), 3U);
  EXPECT_EQ(back.cells[0].since, 7U);
  EXPECT_EQ(back.cells[0].sequence, 20U);
  ASSERT_EQ(back.cells[0].hazards.size(), 2U);
  EXPECT_EQ(back.cells[0].hazards[0].class_name, "pothole");
  EXPECT_EQ(back.cells[0].hazards[0].stamp_ns, PotholeOfCell(1).stamp_ns);
  EXPECT_TRUE(back.cells[0].hazards[1].removed);
  EXPECT_TRUE(back.cells[1].hazards.empty());
  ASSERT_EQ(back.cells[2].hazards.size(), 1U);
  EXPECT_EQ(back.cells[2].hazards[0].sequence, 102U);
}

TEST(CellConversionsTest, CoursesStayWithTheirHazards) {
  protocol::CellNews news;
  news.cells.push_back({kHere, 0, 20, {PotholeOfCell(1), PotholeOfCell(2)}});
  news.cells.push_back({kThere, 0, 20, {PotholeOfCell(3)}});
  news.cells[0].hazards[1].course_rad = 1.5;
  news.cells[1].hazards[0].course_rad = -0.5;
  CellHazards message = ToMessage(news);
  const protocol::CellNews back = FromMessage(message);
  EXPECT_TRUE(std::isnan(back.cells[0].hazards[0].course_rad));
  EXPECT_DOUBLE_EQ(back.cells[0].hazards[1].course_rad, 1.5);
  EXPECT_DOUBLE_EQ(back.cells[1].hazards[0].course_rad, -0.5);
  message.courses.pop_back();
  EXPECT_THROW(FromMessage(message), Error);
  message.courses.resize(4);
  EXPECT_THROW(FromMessage(message), Error);
}

TEST(CellConversionsTest, TrailsStayWithTheirHazards) {
  protocol::CellNews news;
  news.cells.push_back({kHere, 0, 20, {PotholeOfCell(1), PotholeOfCell(2)}});
  news.cells.push_back({kThere, 0, 20, {PotholeOfCell(3)}});
  protocol::CellNews::Hazard& one = news.cells[0].hazards[1];
  const geo::LocalFrame frame(one.position);
  one.trails = {{frame.ToGeo({-80, 2}), frame.ToGeo({90, 2})},
                {frame.ToGeo({0, -50}), frame.ToGeo({0, 0}), frame.ToGeo({60, 0})}};
  CellHazards message = ToMessage(news);
  const protocol::CellNews back = FromMessage(message);
  EXPECT_TRUE(back.cells[0].hazards[0].trails.empty());
  EXPECT_TRUE(back.cells[1].hazards[0].trails.empty());
  const std::vector<protocol::Trail>& trails = back.cells[0].hazards[1].trails;
  ASSERT_EQ(trails.size(), 2U);
  ASSERT_EQ(trails[1].size(), 3U);
  EXPECT_LT(geo::GeodesicDistanceM(trails[0][0], one.trails[0][0]), 0.1);
  EXPECT_LT(geo::GeodesicDistanceM(trails[1][2], one.trails[1][2]), 0.1);
  message.trails[0].hazard = 3;
  EXPECT_THROW(FromMessage(message), Error) << "of a hazard that is not there";
  message.trails[0].hazard = 1;
  message.trails[0].offsets.pop_back();
  EXPECT_THROW(FromMessage(message), Error) << "half a place";
  message = ToMessage(news);
  message.trails.push_back(message.trails[0]);
  EXPECT_THROW(FromMessage(message), Error) << "three of one hazard";
}

TEST(CellConversionsTest, ACellFullOfHazardsStaysWithinWhatABridgeTakes) {
  protocol::CellNews news;
  news.cells.push_back({kHere, 0, 2000, {}});
  protocol::CellNews::Hazard hazard = PotholeOfCell(1);
  const geo::LocalFrame frame(hazard.position);
  hazard.trails.assign(2, {frame.ToGeo({-80, 2}), frame.ToGeo({90, 2})});
  news.cells[0].hazards.assign(protocol::kMaxHazardsOfCell, hazard);
  EXPECT_LE(ToMessage(news).trails.size(), 1024U);
}

TEST(CellConversionsTest, AZoneOfVersion1TellsNoCourses) {
  protocol::CellNews news;
  news.cells.push_back({kHere, 0, 20, {PotholeOfCell(1)}});
  CellHazards message = ToMessage(news);
  message.schema_version = 1;
  message.courses.clear();
  EXPECT_TRUE(std::isnan(FromMessage(message).cells[0].hazards[0].course_rad));
}

TEST(CellConversionsTest, HazardsThatBelongToNoCellOrAreMissingAreRefused) {
  protocol::CellNews news;
  news.cells.push_back({kHere, 0, 20, {PotholeOfCell(1)}});
  CellHazards message = ToMessage(news);
  message.cells[0].hazards = 2;
  EXPECT_THROW(FromMessage(message), Error);
  message.cells[0].hazards = UINT32_MAX;
  EXPECT_THROW(FromMessage(message), Error);
  message.cells[0].hazards = 0;
  EXPECT_THROW(FromMessage(message), Error);
  message.cells[0].hazards = 1;
  EXPECT_NO_THROW(FromMessage(message));
  message.cells[0].cell = UINT32_MAX;
  EXPECT_THROW(FromMessage(message), Error);
}

TEST(CellConversionsTest, AListOfCellsCrossesUnchangedAndIsBounded) {
  const VehicleCells message = ToMessage({kHere, kThere}, "west");
  EXPECT_EQ(message.zone, "west");
  EXPECT_EQ(FromMessage(message), (std::vector<geo::MapCell>{kHere, kThere}));
  VehicleCells many;
  many.cells.resize(65);
  EXPECT_THROW(FromMessage(many), Error);
}

}  // namespace
}  // namespace livemap::ros_io
