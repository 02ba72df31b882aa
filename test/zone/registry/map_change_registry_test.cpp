#include "zone/registry/map_change_registry.h"

#include <gtest/gtest.h>

#include "common/error.h"
#include "test/zone/map_change_fixture.h"
#include "zone/belief/map_change_witnesses.h"

namespace livemap::zone {
namespace {

using Outcome = MapChangeRegistry::Outcome;

class MapChangeRegistryTest : public testing::Test {
 protected:
  MapChangeRegistry::Stamp Next() {
    return {Uuid::Random(generator_), ++sequence_, kChangeNowNs + static_cast<int>(sequence_)};
  }
  MapChangeRegistry::Effect Tell(const protocol::MapChangeReport& report, bool counts = true) {
    return registry_.Tell(report, counts, Next()).value();
  }
  const MapChangeFeature& Only() const {
    EXPECT_EQ(registry_.size(), 1U);
    only_ = registry_.Query(std::nullopt, 1, 10).at(0);
    return only_;
  }
  /// Told a minute after MakeMapChange's stamp.
  static protocol::MapChangeReport Vanished(const std::string& vehicle, int later_s = 60) {
    protocol::MapChangeReport report = MakeMapChange(vehicle, "drive-later");
    report.vanished = true;
    report.stamp_ns += later_s * kSecondNs;
    return report;
  }
  void Confirm() {
    Tell(MakeMapChange("car-1"));
    Tell(MakeMapChange("car-2"));
    ASSERT_EQ(Only().state, MapChangeState::kConfirmed);
  }

  std::mt19937_64 generator_{1};
  std::uint64_t sequence_ = 1;
  MapChangeRegistry registry_{MapChangeRegistry::Rule(), 1};
  mutable MapChangeFeature only_;
};

TEST_F(MapChangeRegistryTest, OneVehicleProposesAndASecondConfirms) {
  const auto first = Tell(MakeMapChange("car-1"));
  EXPECT_EQ(first.outcome, Outcome::kAdded);
  EXPECT_FALSE(first.event.from);
  EXPECT_EQ(first.event.Action(), HazardAction::kAdded);
  EXPECT_EQ(Only().state, MapChangeState::kProposed);
  const auto second = Tell(MakeMapChange("car-2"));
  EXPECT_EQ(second.outcome, Outcome::kMerged);
  EXPECT_EQ(second.event.from, MapChangeState::kProposed);
  EXPECT_EQ(second.event.reason, "told by 2 vehicles");
  EXPECT_EQ(second.event.previous_sequence, first.event.feature.sequence);
  EXPECT_EQ(Only().state, MapChangeState::kConfirmed);
  EXPECT_EQ(Only().Vehicles(), 2U);
  EXPECT_EQ(Only().drives, 2U);
}

TEST_F(MapChangeRegistryTest, OneVehicleNeverConfirmsHoweverOftenItTells) {
  for (int drive = 0; drive < 50; ++drive) {
    Tell(MakeMapChange("car-1", "drive-" + std::to_string(drive)));
  }
  EXPECT_EQ(Only().state, MapChangeState::kProposed);
  EXPECT_EQ(Only().Vehicles(), 1U);
  EXPECT_EQ(Only().drives, 50U);
}

TEST_F(MapChangeRegistryTest, OneVehicleCannotPullAFeatureAwayDriveByDrive) {
  Confirm();
  const MapChangeFeature before = Only();
  for (int drive = 0; drive < 20; ++drive) {
    protocol::MapChangeReport report = MakeMapChange("car-1", "drive-" + std::to_string(drive));
    report.position = EastOf(2);
    Tell(report);
  }
  EXPECT_EQ(geo::GeodesicDistanceM(Only().position, before.position), 0);
  EXPECT_EQ(Only().confidence, before.confidence);
  EXPECT_GE(Only().drives, 20U);
}

TEST_F(MapChangeRegistryTest, TheSameDriveTellingTwiceCountsOnce) {
  Tell(MakeMapChange());
  const MapChangeFeature before = Only();
  protocol::MapChangeReport again = MakeMapChange();
  again.position = EastOf(1);
  again.stamp_ns += kSecondNs;
  EXPECT_EQ(Tell(again).outcome, Outcome::kMerged);
  EXPECT_EQ(Only().drives, 1U);
  EXPECT_EQ(Only().reports, 2U);
  EXPECT_EQ(Only().confidence, before.confidence);
  EXPECT_EQ(Only().covariance_m2, before.covariance_m2);
  EXPECT_EQ(Only().position.longitude_deg, before.position.longitude_deg);
  EXPECT_EQ(Only().last_seen_ns, again.stamp_ns);
}

TEST_F(MapChangeRegistryTest, PositionsAreFusedByWhatVehiclesDoNotShare) {
  Tell(MakeMapChange("car-1"));
  protocol::MapChangeReport other = MakeMapChange("car-2");
  other.position = EastOf(2);
  other.covariance_m2 = 4 * Eigen::Matrix2d::Identity();
  Tell(other);
  const Eigen::Vector2d place_m = geo::LocalFrame(kChangePlace).ToEnu(Only().position);
  // A tenth of the report's 4 m^2 is common: 0.6 against 3.6 m^2 are each one's own.
  EXPECT_NEAR(place_m.x(), 2 * 0.6 / 4.2, 1e-6);
  EXPECT_NEAR(Only().covariance_m2(0, 0), 0.4 + 0.6 * 3.6 / 4.2, 1e-6);
  EXPECT_NEAR(Only().confidence, 0.75, 1e-6);
}

TEST_F(MapChangeRegistryTest, WordsJoinWithinThreeSigmasAndSixMetresOnly) {
  Tell(MakeMapChange("car-1"));
  protocol::MapChangeReport far = MakeMapChange("car-2");
  far.position = EastOf(4.3);  // sqrt(2) m of sigma together: 3.04 sigmas.
  EXPECT_EQ(Tell(far).outcome, Outcome::kAdded);
  protocol::MapChangeReport vague = MakeMapChange("car-3");
  vague.covariance_m2 = 100 * Eigen::Matrix2d::Identity();
  vague.position = EastOf(-6.1);
  EXPECT_EQ(Tell(vague).outcome, Outcome::kAdded);
  vague.position = EastOf(-5.9);
  vague.vehicle_id = "car-4";
  EXPECT_EQ(Tell(vague).outcome, Outcome::kMerged);
}

TEST_F(MapChangeRegistryTest, ClassesDoNotMix) {
  for (const char* name : {"barrier", "other_objects", "sign"}) {
    protocol::MapChangeReport report = MakeMapChange();
    report.class_name = name;
    EXPECT_EQ(Tell(report).outcome, Outcome::kAdded) << name;
  }
  protocol::MapChangeReport other = MakeMapChange("car-2");
  other.class_name = "other_objects";
  EXPECT_EQ(Tell(other).event.feature.class_name, "other_objects");
  EXPECT_EQ(registry_.size(), 3U);
}

TEST_F(MapChangeRegistryTest, OneVehicleUndoesWhatIsProposedAndMakesNoNewFeature) {
  Tell(MakeMapChange("car-1"));
  const auto effect = Tell(Vanished("car-2"));
  EXPECT_EQ(effect.outcome, Outcome::kDenied);
  EXPECT_EQ(effect.event.Action(), HazardAction::kRemoved);
  EXPECT_EQ(effect.event.reason, "a vehicle tells the opposite");
  EXPECT_EQ(Only().state, MapChangeState::kUndone);
  EXPECT_TRUE(registry_.Query(std::nullopt, 0, 10).empty());
}

TEST_F(MapChangeRegistryTest, TwoVehiclesUndoWhatIsConfirmed) {
  Confirm();
  EXPECT_EQ(Tell(Vanished("car-1")).event.from, MapChangeState::kConfirmed);
  EXPECT_EQ(Only().state, MapChangeState::kConfirmed);
  Tell(Vanished("car-1", 70));
  EXPECT_EQ(Only().state, MapChangeState::kConfirmed) << "the same vehicle once more";
  EXPECT_EQ(Tell(Vanished("car-3")).event.reason, "2 vehicles tell the opposite");
  EXPECT_EQ(Only().state, MapChangeState::kUndone);
}

TEST_F(MapChangeRegistryTest, AnOlderWordUndoesNothing) {
  Tell(MakeMapChange("car-1"));
  EXPECT_EQ(Tell(Vanished("car-2", 0)).outcome, Outcome::kKnown);
  EXPECT_EQ(Only().state, MapChangeState::kProposed);
}

TEST_F(MapChangeRegistryTest, ALaterWordForItTakesDenialsBack) {
  Confirm();
  Tell(Vanished("car-3"));
  protocol::MapChangeReport later = MakeMapChange("car-1", "drive-2");
  later.stamp_ns += 90 * kSecondNs;
  Tell(later);
  EXPECT_EQ(Only().Vehicles(true), 0U);
  Tell(Vanished("car-4", 95));
  EXPECT_EQ(Only().state, MapChangeState::kConfirmed);
}

TEST_F(MapChangeRegistryTest, WhatWasUndoneAnswersOlderWordsAndTheSameDenialAgain) {
  Tell(MakeMapChange("car-1"));
  Tell(Vanished("car-2"));
  EXPECT_EQ(Tell(Vanished("car-3", 80)).outcome, Outcome::kKnown);
  EXPECT_EQ(Tell(MakeMapChange("car-4")).outcome, Outcome::kKnown);
  protocol::MapChangeReport anew = MakeMapChange("car-4");
  anew.stamp_ns += 90 * kSecondNs;
  EXPECT_EQ(Tell(anew).outcome, Outcome::kAdded);
  EXPECT_EQ(registry_.size(), 2U);
}

TEST_F(MapChangeRegistryTest, AnOfficialsDismissalHoldsAndCanBeTakenBack) {
  Confirm();
  const Uuid uuid = Only().uuid;
  const auto event = registry_.Decide(uuid, MapChangeState::kDismissed, "a shadow", Next());
  ASSERT_TRUE(event);
  EXPECT_EQ(event->reason, "a shadow");
  EXPECT_EQ(event->Action(), HazardAction::kRemoved);
  EXPECT_EQ(Tell(MakeMapChange("car-3")).outcome, Outcome::kKnown);
  EXPECT_FALSE(registry_.Decide(uuid, MapChangeState::kDismissed, "again", Next()));
  ASSERT_TRUE(registry_.Decide(uuid, MapChangeState::kConfirmed, "it stands", Next()));
  EXPECT_EQ(Only().state, MapChangeState::kConfirmed);
}

TEST_F(MapChangeRegistryTest, NobodyDecidesAboutWhatIsUndoneOrUnknown) {
  Tell(MakeMapChange("car-1"));
  Tell(Vanished("car-2"));
  EXPECT_FALSE(registry_.Decide(Only().uuid, MapChangeState::kConfirmed, "", Next()));
  EXPECT_FALSE(registry_.Decide(Uuid::Random(generator_), MapChangeState::kConfirmed, "", Next()));
}

TEST_F(MapChangeRegistryTest, AVehicleThatDoesNotCountOnlyProposes) {
  EXPECT_EQ(Tell(MakeMapChange("liar"), false).outcome, Outcome::kAdded);
  EXPECT_EQ(Only().Vehicles(), 0U);
  Tell(MakeMapChange("car-1"));
  EXPECT_EQ(Only().state, MapChangeState::kProposed);
  EXPECT_EQ(Tell(Vanished("liar"), false).outcome, Outcome::kKnown);
  EXPECT_EQ(Only().state, MapChangeState::kProposed);
}

TEST_F(MapChangeRegistryTest, BeyondTheMaximumTheOldestClosedOneGoes) {
  MapChangeRegistry::Rule rule;
  rule.max_features = 2;
  registry_ = MapChangeRegistry(rule, 1);
  Tell(MakeMapChange("car-1"));
  const Uuid undone = Tell(Vanished("car-2")).event.feature.uuid;
  for (const double east_m : {100.0, 200.0}) {
    protocol::MapChangeReport report = MakeMapChange("car-1");
    report.position = EastOf(east_m);
    Tell(report);
  }
  EXPECT_EQ(registry_.size(), 2U);
  EXPECT_FALSE(registry_.Find(undone));
  protocol::MapChangeReport more = MakeMapChange("car-1");
  more.position = EastOf(300);
  EXPECT_FALSE(registry_.Tell(more, true, Next())) << "open ones stay";
}

TEST_F(MapChangeRegistryTest, ARollbackLeavesNoTrace) {
  MapChangeRegistry::Rule rule;
  rule.max_features = 2;
  registry_ = MapChangeRegistry(rule, 1);
  Tell(MakeMapChange("car-1"));
  protocol::MapChangeReport elsewhere = MakeMapChange("car-1");
  elsewhere.position = EastOf(100);
  const Uuid dismissed = Tell(elsewhere).event.feature.uuid;
  registry_.Decide(dismissed, MapChangeState::kDismissed, "", Next());
  const auto before = registry_.Query(std::nullopt, 1, 10);
  const auto counts = registry_.counts();
  registry_.Begin();
  Tell(MakeMapChange("car-2"));
  Tell(MakeMapChange("car-3"));
  elsewhere.position = EastOf(200);
  Tell(elsewhere);
  const auto touched = registry_.TouchedSinceBegin();
  EXPECT_EQ(touched.written, (std::vector<MapChangeRegistry::Id>{1, 3}));
  EXPECT_EQ(touched.dropped, std::vector<MapChangeRegistry::Id>{2});
  registry_.Rollback();
  const auto after = registry_.Query(std::nullopt, 1, 10);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_EQ(after[i].uuid, before[i].uuid);
    EXPECT_EQ(after[i].sequence, before[i].sequence);
    EXPECT_EQ(after[i].state, before[i].state);
    EXPECT_EQ(after[i].Vehicles(), before[i].Vehicles());
  }
  EXPECT_EQ(registry_.counts(), counts);
  EXPECT_EQ(Tell(MakeMapChange("car-2")).event.feature.state, MapChangeState::kConfirmed);
}

TEST_F(MapChangeRegistryTest, QueriesFilterByBoxSequenceAndState) {
  Tell(MakeMapChange("car-1"));
  protocol::MapChangeReport north = MakeMapChange("car-1");
  north.position = {50, 8};
  const auto added = Tell(north);
  EXPECT_EQ(registry_.Query(geo::GeoBox{{49, 7}, {51, 9}}, 0, 10).size(), 1U);
  EXPECT_EQ(registry_.Query(std::nullopt, added.event.feature.sequence - 1, 10).size(), 1U);
  EXPECT_EQ(registry_.Query(std::nullopt, 0, 1).size(), 1U);
  EXPECT_TRUE(registry_.Query(std::nullopt, 0, 10, {MapChangeState::kUndone}).empty());
}

TEST(MapChangeWitnesses, SurviveTheWayToTheStoreAndBack) {
  std::vector<MapChangeWitness> witnesses;
  for (std::uint64_t vehicle = 1; vehicle <= 40; ++vehicle) {
    for (std::uint64_t drive = 1; drive <= 6; ++drive) {
      RecordWitness(witnesses, ~vehicle, ~(100 * vehicle + drive), vehicle % 2 == 0);
    }
  }
  EXPECT_EQ(witnesses.size(), 2 * kMaxWitnesses);
  const std::string line = PackWitnesses(witnesses);
  EXPECT_LE(line.size(), kMaxPackedWitnessBytes);
  const auto back = UnpackWitnesses(line);
  ASSERT_TRUE(back);
  EXPECT_EQ(PackWitnesses(*back), line);
  EXPECT_EQ(back->front().drives, 6U);
  ASSERT_TRUE(UnpackWitnesses(""));
}

TEST(MapChangeWitnesses, NonsenseIsNoLineOfThem) {
  for (const char* line :
       {"x", "0 0 1 1 5", "7 2 1 1 5", "7 0 1 0", "7 0 1 2 5 6", "7 0 9 5 1 2 3 4", "7 0 1 1",
        "7 0 1 1 0", "7 0 1 1 5 7 0 1 1 5", "7 0 1 1 5 "}) {
    EXPECT_FALSE(UnpackWitnesses(line)) << line;
  }
}

TEST(MapChangeRegistryRule, ImpossibleOnesAreRefused) {
  MapChangeRegistry::Rule rule;
  rule.max_features = 0;
  EXPECT_THROW(MapChangeRegistry(rule, 1), Error);
}

}  // namespace
}  // namespace livemap::zone
