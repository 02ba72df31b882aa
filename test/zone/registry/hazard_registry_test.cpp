#include "zone/registry/hazard_registry.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "common/error.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

constexpr double kPi = 3.14159265358979323846;

class RegistryTest : public testing::Test {
 protected:
  HazardRegistry::Slot Add(const protocol::Report& report) {
    const auto slot = registry_.Add(report, {}, Uuid::Random(generator_), ++sequence_, kNowNs);
    SetState(slot, HazardState::kActive);
    return slot;
  }
  void SetState(HazardRegistry::Slot slot, HazardState state) {
    PresenceRecord life = registry_.Record(slot).life;
    life.state = state;
    registry_.SetLife(slot, life, 0.5, sequence_, kNowNs);
  }

  std::mt19937_64 generator_{3};
  std::uint64_t sequence_ = 0;
  HazardRegistry registry_{protocol::HazardCatalogue::Parse(R"(
classes:
  barrier: {duplicate_radius_m: 30.0}
)",
                                                            "test"),
                           7};
};

TEST_F(RegistryTest, UsesTheRadiusOfTheClassAndKeepsClassesApart) {
  const geo::GeoPoint here{40.44, -79.94};
  const geo::GeoPoint at_20_m = geo::GeodesicDestination(here, 1.0, 20.0);
  protocol::Report pothole = MakeReport(here);
  protocol::Report barrier = MakeReport(here);
  barrier.class_name = "barrier";
  const auto pothole_slot = Add(pothole);
  const auto barrier_slot = Add(barrier);
  EXPECT_EQ(registry_.FindMatch("pothole", here), pothole_slot);
  EXPECT_EQ(registry_.FindMatch("barrier", here), barrier_slot);
  EXPECT_FALSE(registry_.FindMatch("pothole", at_20_m));
  EXPECT_EQ(registry_.FindMatch("barrier", at_20_m), barrier_slot);
  EXPECT_FALSE(registry_.FindMatch("animal", here));
}

TEST_F(RegistryTest, TheNearestOfSeveralWins) {
  const geo::GeoPoint here{40.44, -79.94};
  Add(MakeReport(geo::GeodesicDestination(here, 0, 4.0)));
  const auto nearer = Add(MakeReport(geo::GeodesicDestination(here, kPi, 3.0)));
  EXPECT_EQ(registry_.FindMatch("pothole", here), nearer);
}

TEST_F(RegistryTest, MergingFusesPositionsByInverseCovariance) {
  const geo::GeoPoint first{40.44, -79.94};
  const geo::LocalFrame frame(first);
  protocol::Report report = MakeReport(first);
  report.covariance_m2 << 2.0, 0.5, 0.5, 1.0;
  const auto slot = Add(report);
  protocol::Report sighting = MakeReport(frame.ToGeo({1.5, -2.0}));
  sighting.covariance_m2 << 1.0, -0.3, -0.3, 3.0;
  registry_.Merge(slot, sighting, {}, ++sequence_, kNowNs);

  // Of what they do not have in common.
  const Eigen::Matrix2d common = FusionRule().common_share * sighting.covariance_m2;
  const Eigen::Matrix2d own_information =
      (report.covariance_m2 - common).inverse() + (sighting.covariance_m2 - common).inverse();
  const Eigen::Matrix2d covariance = common + own_information.inverse();
  const Eigen::Vector2d expected =
      own_information.inverse() *
      ((sighting.covariance_m2 - common).inverse() * Eigen::Vector2d(1.5, -2.0));
  const Hazard hazard = registry_.Get(slot);
  EXPECT_LT((frame.ToEnu(hazard.position) - expected).norm(), 1e-5);
  EXPECT_LT((hazard.covariance_m2 - covariance).norm(), 1e-9);
  EXPECT_EQ(hazard.sightings, 2U);
  EXPECT_FLOAT_EQ(hazard.confidence, 0.75F);
}

TEST_F(RegistryTest, AHazardIsFoundWhereFusionMovedIt) {
  const geo::GeoPoint here{40.44, -79.94};
  const auto slot = Add(MakeReport(here));
  geo::GeoPoint place = here;
  for (int i = 0; i < 40; ++i) {
    // Each sighting lies 4 m east of the hazard, which creeps after it, across cells.
    place = geo::GeodesicDestination(registry_.Get(slot).position, kPi / 2, 4.0);
    ASSERT_EQ(registry_.FindMatch("pothole", place), slot);
    registry_.Merge(slot, MakeReport(place), {}, ++sequence_, kNowNs);
  }
  EXPECT_GT(geo::GeodesicDistanceM(here, registry_.Get(slot).position), 5.0);
  EXPECT_FALSE(registry_.FindMatch("pothole", here));
}

TEST_F(RegistryTest, ManySightingsNeitherFreezeThePositionNorReachCertainty) {
  const auto slot = Add(MakeReport());
  protocol::Report boastful = MakeReport();
  boastful.covariance_m2 = Eigen::Matrix2d::Identity() * 1e-9;
  boastful.confidence = 1.0F;
  for (int i = 0; i < 1000; ++i) {
    registry_.Merge(slot, boastful, {}, ++sequence_, kNowNs);
  }
  const FusionRule rule;
  const Hazard hazard = registry_.Get(slot);
  const double least = rule.min_fused_sigma_m * rule.min_fused_sigma_m;
  EXPECT_GE(hazard.covariance_m2(0, 0), least * (1 - 1e-9));
  EXPECT_GE(hazard.covariance_m2(1, 1), least * (1 - 1e-9));
  EXPECT_FLOAT_EQ(hazard.confidence, rule.max_confidence);
}

TEST_F(RegistryTest, TheNewestImageGivesThePictureAndStampsSpanAllSightings) {
  const std::string a(64, 'a');
  const std::string b(64, 'b');
  const std::string c(64, 'c');
  const protocol::Report report = MakeReport();
  const auto slot = registry_.Add(report, {a, "jpeg"}, Uuid::Random(generator_), ++sequence_, 1);
  protocol::Report older = MakeReport();
  older.stamp_ns = report.stamp_ns - 5;
  registry_.Merge(slot, older, {b, "png"}, ++sequence_, 2);
  EXPECT_EQ(registry_.Get(slot).image_sha256, a);
  protocol::Report newer = MakeReport();
  newer.stamp_ns = report.stamp_ns + 5;
  registry_.Merge(slot, newer, {}, ++sequence_, 3);
  EXPECT_EQ(registry_.Get(slot).image_sha256, a);
  registry_.Merge(slot, newer, {c, "png"}, ++sequence_, 4);
  EXPECT_EQ(registry_.Get(slot).image_sha256, c);
  EXPECT_EQ(registry_.Get(slot).first_seen_ns, older.stamp_ns);
  EXPECT_EQ(registry_.Get(slot).last_seen_ns, newer.stamp_ns);
  EXPECT_EQ(registry_.Get(slot).updated_ns, 4);
}

TEST_F(RegistryTest, AHazardThatIsGoneIsNoMatchAndShowsOnlyToThoseWhoCatchUp) {
  const auto slot = Add(MakeReport());
  ++sequence_;
  SetState(slot, HazardState::kGone);
  EXPECT_FALSE(registry_.FindMatch("pothole", MakeReport().position));
  EXPECT_TRUE(registry_.Query(std::nullopt, 0, 10).empty());
  ASSERT_EQ(registry_.Query(std::nullopt, 1, 10).size(), 1U);
  EXPECT_EQ(registry_.Query(std::nullopt, 1, 10).front().state, HazardState::kGone);
  EXPECT_EQ(registry_.on_map_count(), 0U);
}

TEST_F(RegistryTest, QueryAnswersInOrderOfTheLastChangeWithinBoxAndLimit) {
  const auto west = Add(MakeReport({0, 179.9}));
  const auto east = Add(MakeReport({0, -179.9}));
  const auto elsewhere = Add(MakeReport({0, 0}));
  registry_.Merge(west, MakeReport({0, 179.9}), {}, ++sequence_, kNowNs);
  const geo::GeoBox across{{-1, 179}, {1, -179}};
  const auto found = registry_.Query(across, 0, 10);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].uuid, registry_.Get(east).uuid);
  EXPECT_EQ(found[1].uuid, registry_.Get(west).uuid);
  EXPECT_EQ(registry_.Query(std::nullopt, 0, 2).size(), 2U);
  EXPECT_EQ(registry_.Query(std::nullopt, 2, 10).front().uuid, registry_.Get(elsewhere).uuid);
  EXPECT_TRUE(registry_.Query(std::nullopt, sequence_, 10).empty());
}

TEST_F(RegistryTest, QueryStaysCompleteOverManyChangesOfFewHazards) {
  const auto a = Add(MakeReport({1, 1}));
  const auto b = Add(MakeReport({2, 2}));
  for (int i = 0; i < 5000; ++i) {
    registry_.Merge(i % 3 == 0 ? b : a, MakeReport(registry_.Get(i % 3 == 0 ? b : a).position), {},
                    ++sequence_, kNowNs);
  }
  EXPECT_EQ(registry_.Query(std::nullopt, 0, 10).size(), 2U);
  EXPECT_EQ(registry_.Query(std::nullopt, sequence_ - 1, 10).size(), 1U);
}

TEST_F(RegistryTest, QueryNearAnswersNearestFirstAcrossTheAntimeridian) {
  const geo::GeoPoint here{10, 179.9999};
  for (const double distance_m : {4000.0, 1000.0, 6000.0, 2000.0}) {
    Add(MakeReport(geo::GeodesicDestination(here, kPi / 2, distance_m)));
  }
  const auto found = registry_.QueryNear(here, 5000.0, 2);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(geo::GeodesicDistanceM(here, found[0].position), 1000.0, 0.01);
  EXPECT_NEAR(geo::GeodesicDistanceM(here, found[1].position), 2000.0, 0.01);
  EXPECT_EQ(registry_.QueryNear(here, 5000.0, 10).size(), 3U);
}

TEST_F(RegistryTest, HazardsOfOneWitnessAreCountedAlsoAfterARollback) {
  constexpr std::uint64_t kWitness = 11;
  constexpr std::uint64_t kOther = 12;
  const auto hear = [this](HazardRegistry::Slot slot, std::vector<std::uint64_t> vehicles) {
    PresenceRecord life = registry_.Record(slot).life;
    life.voices = {};
    for (std::size_t i = 0; i < vehicles.size(); ++i) life.voices.at(i).vehicle = vehicles[i];
    registry_.SetLife(slot, life, 0.5, sequence_, kNowNs);
  };
  const auto first = Add(MakeReport({1, 1}));
  hear(first, {kWitness});
  EXPECT_EQ(registry_.CountRestingOn(kWitness), 1U);
  registry_.Begin();
  hear(Add(MakeReport({2, 2})), {kWitness});
  hear(first, {kOther, kWitness});
  EXPECT_EQ(registry_.CountRestingOn(kWitness), 1U);
  SetState(first, HazardState::kGone);
  hear(Add(MakeReport({3, 3})), {kOther});
  EXPECT_EQ(registry_.CountRestingOn(kOther), 1U);
  registry_.Rollback();
  EXPECT_EQ(registry_.CountRestingOn(kWitness), 1U);
  EXPECT_EQ(registry_.CountRestingOn(kOther), 0U);
  SetState(first, HazardState::kRejected);
  EXPECT_EQ(registry_.CountRestingOn(kWitness), 0U) << "off the map";
}

TEST_F(RegistryTest, RollbackRestoresEverythingSinceBegin) {
  const auto kept = Add(MakeReport({1, 1}));
  const auto removed = Add(MakeReport({2, 2}));
  const Hazard kept_before = registry_.Get(kept);
  const Hazard removed_before = registry_.Get(removed);
  registry_.Begin();
  const auto added = registry_.Add(MakeReport({3, 3}), {}, Uuid::Random(generator_), 10, kNowNs);
  const Uuid added_uuid = registry_.Get(added).uuid;
  registry_.Merge(kept, MakeReport({1, 1.00001}), {}, 11, kNowNs);
  registry_.Merge(added, MakeReport({3, 3}), {}, 12, kNowNs);
  registry_.Merge(kept, MakeReport({1, 1.00002}), {}, 13, kNowNs);
  sequence_ = 14;
  SetState(removed, HazardState::kGone);
  registry_.Rollback();

  EXPECT_EQ(registry_.size(), 2U);
  EXPECT_EQ(registry_.on_map_count(), 2U);
  EXPECT_FALSE(registry_.Find(added_uuid));
  EXPECT_TRUE(SameHazard(registry_.Get(kept), kept_before));
  EXPECT_TRUE(SameHazard(registry_.Get(removed), removed_before));
  EXPECT_EQ(registry_.FindMatch("pothole", {1, 1}), kept);
  EXPECT_EQ(registry_.FindMatch("pothole", {2, 2}), removed);
  EXPECT_FALSE(registry_.FindMatch("pothole", {3, 3}));
  EXPECT_EQ(registry_.Query(std::nullopt, 0, 10).size(), 2U);
}

TEST_F(RegistryTest, AChangedHazardIsToldAroundItInTheOrderOfAnnouncements) {
  const geo::GeoPoint here{40.44, -79.94};
  const auto first = Add(MakeReport(here));
  registry_.MarkAnnounced(first);
  const auto never = Add(MakeReport(geo::GeodesicDestination(here, 0, 50.0)));
  const auto far = Add(MakeReport(geo::GeodesicDestination(here, 0, 9000.0)));
  registry_.MarkAnnounced(far);
  const auto second = Add(MakeReport(geo::GeodesicDestination(here, 0, 100.0)));
  registry_.MarkAnnounced(second);
  // What happens without an announcement does not change the order.
  registry_.Merge(first, MakeReport(here), {}, ++sequence_, kNowNs);
  const auto all = registry_.ChangedAround(here, 1000.0, 0, 10);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].uuid, registry_.Get(first).uuid);
  EXPECT_EQ(all[1].uuid, registry_.Get(second).uuid);
  ASSERT_EQ(registry_.ChangedAround(here, 1000.0, all[0].announced_sequence, 10).size(), 1U);
  EXPECT_EQ(registry_.ChangedAround(here, 1000.0, 0, 1).size(), 1U);

  // Taken away from drivers: only those who knew of it hear so.
  ++sequence_;
  SetState(first, HazardState::kRejected);
  registry_.MarkAnnounced(first);
  EXPECT_EQ(registry_.ChangedAround(here, 1000.0, 0, 10).size(), 1U);
  const auto since = registry_.ChangedAround(here, 1000.0, all[1].announced_sequence, 10);
  ASSERT_EQ(since.size(), 1U);
  EXPECT_EQ(since[0].state, HazardState::kRejected);
  EXPECT_EQ(registry_.FindMatch("pothole", here), first);
  EXPECT_EQ(registry_.Get(never).announced_sequence, 0U);
}

TEST_F(RegistryTest, ManyHazardsAreFoundByTheirIdsAndForgottenWithThem) {
  std::vector<Uuid> kept;
  for (int i = 0; i < 3000; ++i)
    kept.push_back(registry_.Get(Add(MakeReport({0.001 * i, 1}))).uuid);
  registry_.Begin();
  std::vector<Uuid> lost;
  for (int i = 0; i < 3000; ++i)
    lost.push_back(registry_.Get(Add(MakeReport({0.001 * i, 2}))).uuid);
  registry_.Rollback();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(registry_.Find(kept[i]), static_cast<HazardRegistry::Slot>(i));
    EXPECT_FALSE(registry_.Find(lost[i]));
  }
  EXPECT_EQ(registry_.Record(Add(MakeReport({1, 3}))).id, 3001U);
}

TEST_F(RegistryTest, RefusesToRestoreTheSameHazardTwice) {
  Hazard hazard;
  hazard.sequence = 1;
  registry_.Restore(hazard, {}, 1);
  hazard.sequence = 2;
  EXPECT_THROW(registry_.Restore(hazard, {}, 1), Error);
  hazard.uuid.bytes[0] = 1;
  hazard.sequence = 1;
  EXPECT_THROW(registry_.Restore(hazard, {}, 1), Error);
}

}  // namespace
}  // namespace livemap::zone
