// What officials do with hazards beside judging them, and how they take it back.
#include "zone/service/hazard_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

const geo::GeoPoint kDeskPlace{40.44, -79.94};

geo::GeoPoint NorthOf(double metres) {
  return {kDeskPlace.latitude_deg + metres / 111'050.0, kDeskPlace.longitude_deg};
}

class HazardDeskTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.catalogue = protocol::HazardCatalogue::Parse(
          "defaults: {confirmations: 1}\nclasses: {pothole: {label: Pothole, duplicate_radius_m: "
          "5}, debris: "
          "{label: Debris, duplicate_radius_m: 5}}\n",
          "test");
      config.allowance.evidence_per_hour = 1e6;
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  void Restart() { zone_.reset(); }
  Uuid ReportAt(const geo::GeoPoint& place, const std::string& class_name = "pothole") {
    protocol::Report report = MakeReport(place);
    report.class_name = class_name;
    report.vehicle_id = "car-" + std::to_string(++vehicles_);
    report.stamp_ns = now_ns_ - kOneSecond;
    return Zone().Handle(report).hazard_uuid;
  }
  Hazard Get(const Uuid& hazard) { return *Zone().Find(hazard); }
  std::uint64_t Act(const Uuid& hazard, const DeskAction& action) {
    return Zone().Act(hazard, "Anna", action).value_or(0);
  }
  std::string WhyNot(const Uuid& hazard, const DeskAction& action) {
    try {
      Act(hazard, action);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  static DeskAction CommentOf(const std::string& text) {
    DeskAction action;
    action.text = text;
    return action;
  }
  static DeskAction AssignTo(const std::string& team, std::int64_t due_ns = 0) {
    DeskAction action;
    action.kind = DecisionKind::kAssign;
    action.team = team;
    action.due_ns = due_ns;
    return action;
  }
  static DeskAction ClassOf(const std::string& class_name) {
    DeskAction action;
    action.kind = DecisionKind::kReclassHazard;
    action.class_name = class_name;
    return action;
  }
  static DeskAction MoveTo(const geo::GeoPoint& position) {
    DeskAction action;
    action.kind = DecisionKind::kMoveHazard;
    action.position = position;
    return action;
  }
  static DeskAction MergeWith(const Uuid& other) {
    DeskAction action;
    action.kind = DecisionKind::kMergeHazard;
    action.other = other;
    return action;
  }
  double DistanceM(const Uuid& hazard, const geo::GeoPoint& place) {
    return geo::GeodesicDistanceM(Get(hazard).position, place);
  }

  std::int64_t now_ns_ = kNowNs;
  int vehicles_ = 0;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(HazardDeskTest, WhatIsDoneWithAWorkOrderIsKeptAndCannotBeTakenBack) {
  const Uuid hazard = ReportAt(kDeskPlace);
  Zone().Confirm(hazard, "Anna");
  DeskAction retry;
  retry.kind = DecisionKind::kRetryOrder;
  EXPECT_THAT(WhyNot(hazard, retry), HasSubstr("work order"));
  retry.order = "to roads, LM-1";
  const std::uint64_t id = Act(hazard, retry);
  Restart();
  const DecisionRecord kept = Zone().DecisionsAbout(hazard, 10).at(0);
  EXPECT_EQ(kept.id, id);
  EXPECT_STREQ(DecisionName(kept.kind), "retry_order");
  EXPECT_EQ(kept.official, "Anna");
  EXPECT_EQ(kept.detail, "to roads, LM-1");
  EXPECT_THROW(Zone().Undo(hazard, "Anna", "", id), DecisionConflict);
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), ZoneService::Undone::kDone)
      << "the newest decision that can be undone is the confirmation";
  EXPECT_EQ(Zone().DecisionsAbout(hazard, 10).at(2).undone_by, id + 1);
}

TEST_F(HazardDeskTest, WhatIsDoneWithAWorkOrderOfAForgottenHazardIsKept) {
  DeskAction close;
  close.kind = DecisionKind::kCloseOrder;
  close.order = "to roads, LM-1";
  const Uuid unknown = *Uuid::Parse("11111111-2222-4333-8444-555555555555");
  EXPECT_NE(Act(unknown, close), 0U);
  EXPECT_EQ(Zone().DecisionsAbout(unknown, 1).size(), 1U);
}

TEST_F(HazardDeskTest, ACommentIsKeptWithWhoAndWhenAndCanBeTakenBack) {
  const Uuid hazard = ReportAt(kDeskPlace);
  const std::uint64_t sequence = Zone().Sequence();
  const std::uint64_t id = Act(hazard, CommentOf("<b>asked the water works</b>"));
  EXPECT_EQ(Zone().Sequence(), sequence);  // Drivers and maps have nothing to do with it.
  Restart();
  DecisionRecord comment = Zone().DecisionsAbout(hazard, 10).at(0);
  EXPECT_EQ(comment.id, id);
  EXPECT_STREQ(DecisionName(comment.kind), "comment");
  EXPECT_EQ(comment.reason, "<b>asked the water works</b>");
  EXPECT_EQ(comment.official, "Anna");
  EXPECT_EQ(comment.at_ns, kNowNs);
  EXPECT_EQ(Zone().Undo(hazard, "Ben", "", id), ZoneService::Undone::kDone);
  EXPECT_NE(Zone().DecisionsAbout(hazard, 10).at(1).undone_by, 0U);
}

TEST_F(HazardDeskTest, ACommentIsBoundedPrintableText) {
  const Uuid hazard = ReportAt(kDeskPlace);
  EXPECT_NE(Act(hazard, CommentOf(std::string(500, 'a'))), 0U);
  EXPECT_THAT(WhyNot(hazard, CommentOf(std::string(501, 'a'))), HasSubstr("501 bytes"));
  EXPECT_THAT(WhyNot(hazard, CommentOf("a\nb")), HasSubstr("not accepted"));
  EXPECT_THAT(WhyNot(hazard, CommentOf("")), HasSubstr("not accepted"));
  EXPECT_THAT(WhyNot(hazard, CommentOf("\xE2\x80\xAE")), HasSubstr("not accepted"));
  EXPECT_EQ(Act(Uuid{}, CommentOf("nowhere")), 0U);
}

TEST_F(HazardDeskTest, AnAssignmentHoldsUntilAnotherOneAndComesBackWithItsUndo) {
  const Uuid hazard = ReportAt(kDeskPlace);
  const std::int64_t day_ns = kNowNs - kNowNs % kOneDay;
  Act(hazard, AssignTo("Roads north", day_ns));
  const std::uint64_t second = Act(hazard, AssignTo("Roads south"));
  Restart();
  ASSERT_EQ(Zone().Assignments().size(), 1U);
  EXPECT_EQ(Zone().Assignments()[0].team, "Roads south");
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", second), ZoneService::Undone::kDone);
  const Assignment first = Zone().Assignments().at(0);
  EXPECT_EQ(first.team, "Roads north");
  EXPECT_FALSE(first.IsOverdue(day_ns + kOneDay - 1));
  EXPECT_TRUE(first.IsOverdue(day_ns + kOneDay));
  EXPECT_THAT(Zone().DecisionsAbout(hazard, 10).back().detail, "to Roads north, due 2023-11-14");
  Act(hazard, AssignTo(""));
  EXPECT_TRUE(Zone().Assignments().empty());
}

TEST_F(HazardDeskTest, ARepairedHazardLeavesTheMapAndNobodyIsBlamed) {
  const Uuid hazard = ReportAt(kDeskPlace);
  Act(hazard, AssignTo("Roads"));
  const auto id = Zone().Close(hazard, "Anna", "filled");
  ASSERT_TRUE(id);
  EXPECT_FALSE(IsOnMap(Get(hazard).state));
  EXPECT_TRUE(Zone().Assignments().empty());
  EXPECT_THAT(Zone().Events(hazard, 1).at(0).reason, "repaired by Anna: filled");
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 0U);
  EXPECT_EQ(Zone().DecisionsAbout(hazard, 1).at(0).effects, "0 0");
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", id), ZoneService::Undone::kDone);
  EXPECT_TRUE(IsOnMap(Get(hazard).state));
  EXPECT_EQ(Zone().Assignments().size(), 1U);
}

TEST_F(HazardDeskTest, LaterReportsOfTheOldClassDoNotUndoTheNewOne) {
  const Uuid hazard = ReportAt(kDeskPlace);
  const std::uint64_t id = Act(hazard, ClassOf("debris"));
  EXPECT_EQ(Get(hazard).class_name, "debris");
  EXPECT_EQ(ReportAt(kDeskPlace), hazard);
  EXPECT_EQ(ReportAt(kDeskPlace, "debris"), hazard);
  Restart();
  EXPECT_EQ(Get(hazard).class_name, "debris");
  EXPECT_EQ(ReportAt(kDeskPlace), hazard);
  EXPECT_EQ(Get(hazard).class_name, "debris");
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", id), ZoneService::Undone::kDone);
  EXPECT_EQ(Get(hazard).class_name, "pothole");
  EXPECT_NE(ReportAt(kDeskPlace, "debris"), hazard);
  EXPECT_EQ(ReportAt(kDeskPlace), hazard);
}

TEST_F(HazardDeskTest, AClassMustBeAnotherOneOfTheCatalogue) {
  const Uuid hazard = ReportAt(kDeskPlace);
  EXPECT_THAT(WhyNot(hazard, ClassOf("unicorn")), HasSubstr("has no class 'unicorn'"));
  EXPECT_THAT(WhyNot(hazard, ClassOf("pothole")), HasSubstr("of this class already"));
}

TEST_F(HazardDeskTest, LaterReportsDoNotMoveWhatAnOfficialHasMoved) {
  const Uuid hazard = ReportAt(kDeskPlace);
  const std::uint64_t id = Act(hazard, MoveTo(NorthOf(30)));
  EXPECT_EQ(ReportAt(kDeskPlace), hazard);
  EXPECT_EQ(ReportAt(NorthOf(28)), hazard);
  EXPECT_LT(DistanceM(hazard, NorthOf(30)), 0.01);
  Restart();
  EXPECT_EQ(ReportAt(kDeskPlace), hazard);
  EXPECT_LT(DistanceM(hazard, NorthOf(30)), 0.01);
  EXPECT_EQ(Zone().Undo(hazard, "Anna", ""), ZoneService::Undone::kDone);
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", id), ZoneService::Undone::kBefore);
  EXPECT_LT(DistanceM(hazard, kDeskPlace), 0.01);
  EXPECT_NE(ReportAt(NorthOf(30)), hazard);
}

TEST_F(HazardDeskTest, AMoveIsBounded) {
  const Uuid hazard = ReportAt(kDeskPlace);
  EXPECT_THAT(WhyNot(hazard, MoveTo(NorthOf(201))), HasSubstr("at most 200 m"));
  EXPECT_NE(Act(hazard, MoveTo(NorthOf(199))), 0U);
}

TEST_F(HazardDeskTest, TwoHazardsBecomeOneAndCanBeSplitAgain) {
  const Uuid kept = ReportAt(kDeskPlace);
  const Uuid other = ReportAt(NorthOf(20), "debris");
  const std::uint64_t id = Act(kept, MergeWith(other));
  EXPECT_EQ(Get(other).state, HazardState::kGone);
  EXPECT_EQ(Get(kept).sightings, 2U);
  EXPECT_EQ(ReportAt(NorthOf(20), "debris"), kept);
  EXPECT_EQ(Zone().Sightings(kept, 10).size(), 3U);
  Restart();
  EXPECT_EQ(ReportAt(NorthOf(20), "debris"), kept);
  EXPECT_EQ(Zone().Undo(kept, "Anna", "", id), ZoneService::Undone::kDone);
  EXPECT_EQ(Get(other).state, HazardState::kActive);
  EXPECT_EQ(Get(kept).sightings, 3U);
  EXPECT_EQ(ReportAt(NorthOf(20), "debris"), other);
}

TEST_F(HazardDeskTest, TrustInAVehicleDoesNotSplitWhatWasMerged) {
  const Uuid kept = ReportAt(kDeskPlace);
  const Uuid other = ReportAt(NorthOf(20));
  const std::string witness = "car-" + std::to_string(vehicles_);
  ASSERT_EQ(ReportAt(NorthOf(20)), other);
  ASSERT_EQ(Zone().Distrust(witness, "Anna", "its key was stolen"), 1U);
  Act(kept, MergeWith(other));
  EXPECT_TRUE(Zone().Trust(witness, "Anna"));
  EXPECT_EQ(Get(other).state, HazardState::kGone);
}

TEST_F(HazardDeskTest, AMergeNeedsTwoHazardsThatAreNear) {
  const Uuid kept = ReportAt(kDeskPlace);
  const Uuid far = ReportAt(NorthOf(120));
  EXPECT_THAT(WhyNot(kept, MergeWith(far)), HasSubstr("at most 100 m"));
  EXPECT_THAT(WhyNot(kept, MergeWith(kept)), HasSubstr("with itself"));
  EXPECT_THAT(WhyNot(kept, MergeWith(Uuid{})), HasSubstr("not on the map"));
}

TEST_F(HazardDeskTest, AChainOfMergesLeadsToTheLast) {
  const Uuid one = ReportAt(kDeskPlace);
  const Uuid two = ReportAt(NorthOf(20));
  const Uuid three = ReportAt(NorthOf(40));
  Act(two, MergeWith(one));
  Act(three, MergeWith(two));
  EXPECT_EQ(ReportAt(kDeskPlace), three);
}

TEST_F(HazardDeskTest, AnEditLeavesTheConfirmationOfAnotherOfficialAlone) {
  const Uuid hazard = ReportAt(kDeskPlace);
  const auto confirmation = Zone().Confirm(hazard, "Ben");
  ASSERT_TRUE(confirmation);
  const std::uint64_t first = Act(hazard, MoveTo(NorthOf(10)));
  Act(hazard, MoveTo(NorthOf(20)));
  EXPECT_THROW(Zone().Undo(hazard, "Anna", "", first), DecisionConflict);
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", confirmation), ZoneService::Undone::kDone);
  EXPECT_LT(DistanceM(hazard, NorthOf(20)), 0.01);
}

TEST_F(HazardDeskTest, AStoreOfTheSchemaBeforeIsBroughtUpToDate) {
  SKIP_ON_POSTGRESQL();
  const Uuid hazard = ReportAt(kDeskPlace);
  ASSERT_TRUE(Zone().Confirm(hazard, "Ben", "seen"));
  Restart();
  Probe().Execute(
      "DROP TABLE decision_details; DROP TABLE assignments; DROP TABLE redirects; "
      "DELETE FROM livemap_schema WHERE version >= 8");
  EXPECT_EQ(Zone().DecisionsAbout(hazard, 10).at(0).reason, "seen");
  EXPECT_NE(Act(hazard, AssignTo("Roads")), 0U);
  EXPECT_NE(Act(hazard, MoveTo(NorthOf(5))), 0U);
  Restart();
  EXPECT_EQ(Zone().Assignments().size(), 1U);
  EXPECT_LT(DistanceM(hazard, NorthOf(5)), 0.01);
}

TEST_F(HazardDeskTest, BrokenRowsOfTheDeskAreLeftOutAndTold) {
  const Uuid hazard = ReportAt(kDeskPlace);
  Act(hazard, MoveTo(NorthOf(5)));
  Act(hazard, AssignTo("Roads"));
  Restart();
  Probe().Execute("UPDATE redirects SET hazard_uuid = 'nobody'; UPDATE assignments SET team = ''");
  EXPECT_TRUE(Zone().Assignments().empty());
  EXPECT_GT(Zone().Statistics().store_damage.rows, 0U);
}

}  // namespace
}  // namespace livemap::zone
