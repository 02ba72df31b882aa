// Walks over the map page by page, while it changes.
#include <gtest/gtest.h>

#include <map>
#include <memory>

#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

class ZoneWalkTest : public ZoneTest {
 protected:
  void TearDown() override { zone_.reset(); }
  Uuid Add(int place, const std::string& class_name = "pothole") {
    protocol::Report report = MakeReport({40 + 0.001 * place, -79.94});
    report.class_name = class_name;
    return zone_->Handle(report).hazard_uuid;
  }
  /// How often each hazard comes; `between` is called after each page.
  template <typename Between>
  std::map<std::string, int> WalkOver(Walk<HazardState> walk, std::size_t limit,
                                      const Between& between) {
    std::map<std::string, int> told;
    while (true) {
      const Page<Hazard> page = zone_->ReadHazards(walk, limit);
      EXPECT_LE(page.items.size(), limit);
      for (const Hazard& hazard : page.items) ++told[hazard.uuid.ToString()];
      if (page.is_last) return told;
      EXPECT_GT(page.sequence, walk.after);
      walk.after = page.sequence;
      between();
    }
  }

  std::unique_ptr<ZoneService> zone_ = std::make_unique<ZoneService>(Config(), Clock(), 42);
};

TEST_F(ZoneWalkTest, PagesHoldEveryHazardOnce) {
  for (int i = 0; i < 25; ++i) Add(i);
  Walk<HazardState> walk;
  walk.states = StatesOnMap();
  walk.until = zone_->Sequence();
  const auto told = WalkOver(walk, 4, [] {});
  EXPECT_EQ(told.size(), 25U);
  for (const auto& [id, times] : told) EXPECT_EQ(times, 1) << id;
}

TEST_F(ZoneWalkTest, WhatChangesMeanwhileIsToldOnceOrHasANewerSequence) {
  for (int i = 0; i < 25; ++i) Add(i);
  Walk<HazardState> walk;
  walk.states = StatesOnMap();
  walk.until = zone_->Sequence();
  int place = 0;
  auto told = WalkOver(walk, 4, [&] {
    Add(place);       // Seen again: told already.
    Add(24 - place);  // And one that is still to come.
    Add(100 + place++);
  });
  for (const auto& [id, times] : told) EXPECT_EQ(times, 1) << id;
  Walk<HazardState> since;
  since.after = walk.until;
  for (const auto& [id, times] : WalkOver(since, 4, [] {})) ++told[id];
  for (const Hazard& hazard : zone_->Query(std::nullopt, 0, 1000)) {
    EXPECT_GE(told[hazard.uuid.ToString()], 1);
  }
}

TEST_F(ZoneWalkTest, APageSelectsByStateAndBox) {
  const Uuid first = Add(0);
  for (int i = 1; i < 10; ++i) Add(i);
  zone_->Reject(first, "miller", "not there");
  Walk<HazardState> walk;
  walk.states = {HazardState::kRejected};
  EXPECT_EQ(WalkOver(walk, 100, [] {}).size(), 1U);
  walk.states = StatesOnMap();
  walk.box = geo::GeoBox{{40.0005, -80}, {40.0035, -79}};
  EXPECT_EQ(WalkOver(walk, 2, [] {}).size(), 3U);
  EXPECT_EQ(zone_->HazardCounts()[static_cast<std::size_t>(HazardState::kRejected)], 1U);
}

TEST_F(ZoneWalkTest, VehiclesComeByTheirIds) {
  for (int i = 0; i < 7; ++i) {
    VehicleState vehicle;
    vehicle.vehicle_id = "car-" + std::to_string(i);
    vehicle.position = {40.44, -79.94};
    vehicle.stamp_ns = kNowNs;
    ASSERT_TRUE(zone_->UpdateVehicle(vehicle));
  }
  EXPECT_EQ(zone_->VehiclesAfter("", 3).size(), 3U);
  EXPECT_EQ(zone_->VehiclesAfter("car-2", 100).front().vehicle_id, "car-3");
  EXPECT_TRUE(zone_->VehiclesAfter("car-6", 100).empty());
}

}  // namespace
}  // namespace livemap::zone
