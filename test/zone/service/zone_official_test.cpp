// How officials take back what they decided.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <string>
#include <thread>
#include <vector>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;
using Undone = ZoneService::Undone;

const geo::GeoPoint kHere{40.44, -79.94};

class ZoneOfficialTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.catalogue = protocol::HazardCatalogue();  // Two vehicles confirm.
      config.allowance.evidence_per_hour = 1e6;
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  Uuid ReportBy(const std::string& vehicle, const geo::GeoPoint& place = kHere) {
    protocol::Report report = MakeReport(place);
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns_ - kOneSecond;
    return Zone().Handle(report).hazard_uuid;
  }
  Hazard Get(const Uuid& hazard) { return *Zone().Find(hazard); }
  std::string LastReason(const Uuid& hazard) { return Zone().Events(hazard, 1).front().reason; }
  /// What is held against the vehicles, as text.
  std::string Trust() {
    return Probe().Text(
        "SELECT CAST(round(suspicion * 1e9) AS BIGINT) FROM trust WHERE suspicion > 1e-9 "
        "ORDER BY vehicle_key");
  }

  std::int64_t now_ns_ = kNowNs;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(ZoneOfficialTest, AnUndoThatNamesItsDecisionLeavesALaterOneAlone) {
  const Uuid hazard = ReportBy("car-1");
  const auto rejection = Zone().Reject(hazard, "Anna", "nothing there");
  ASSERT_TRUE(rejection);
  EXPECT_EQ(Zone().Reject(hazard, "Anna", "nothing there"), rejection) << "the same again";
  const auto confirmation = Zone().Confirm(hazard, "Bert", "I see it");
  ASSERT_TRUE(confirmation);
  EXPECT_EQ(Zone().Undo(hazard, "Anna", "", rejection), Undone::kOther);
  EXPECT_EQ(Get(hazard).state, HazardState::kActive);
  EXPECT_EQ(Zone().Undo(hazard, "Bert", "", confirmation), Undone::kDone);
  EXPECT_EQ(Get(hazard).state, HazardState::kRejected);
  EXPECT_EQ(Zone().Undo(hazard, "Bert", "", confirmation), Undone::kBefore);
}

TEST_F(ZoneOfficialTest, AnUndoneRejectionLeavesTheCandidateThatItWas) {
  const Uuid hazard = ReportBy("car-1");
  const Hazard before = Get(hazard);
  ASSERT_EQ(before.state, HazardState::kCandidate);
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "nothing there"));
  EXPECT_NE(Trust(), "");
  EXPECT_EQ(Zone().Undo(hazard, "Bert", "wrong hazard"), Undone::kDone);
  const Hazard after = Get(hazard);
  EXPECT_EQ(after.state, HazardState::kCandidate);
  EXPECT_EQ(after.presence, before.presence);
  EXPECT_EQ(after.vehicles, before.vehicles);
  EXPECT_EQ(Trust(), "") << "nothing is held against the vehicle any more";
  EXPECT_EQ(LastReason(hazard), "reject undone by Bert: wrong hazard");
  // A second vehicle confirms it as if nothing had been.
  ReportBy("car-2");
  EXPECT_EQ(Get(hazard).state, HazardState::kActive);
}

TEST_F(ZoneOfficialTest, AnUndoneConfirmationLeavesVotesAndPresenceAlsoAfterARestart) {
  const Uuid hazard = ReportBy("car-1");
  const Hazard before = Get(hazard);
  EXPECT_TRUE(Zone().Confirm(hazard, "Anna"));
  EXPECT_EQ(Get(hazard).state, HazardState::kActive);
  zone_.reset();
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kDone);
  EXPECT_EQ(Get(hazard).state, before.state);
  EXPECT_EQ(Get(hazard).presence, before.presence);
  EXPECT_EQ(LastReason(hazard), "confirm undone by Anna");
  EXPECT_NEAR(Probe().Number("SELECT coalesce(sum(stood_s), 0) FROM lives"), 0, 1e-6)
      << "the class has learned nothing";
}

TEST_F(ZoneOfficialTest, WhatVehiclesSaidSinceCountsOnTopOfAnUndo) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_TRUE(Zone().Confirm(hazard, "Anna"));
  now_ns_ += kOneHour;
  ReportBy("car-2");
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kDone);
  EXPECT_EQ(Get(hazard).vehicles, 2U);
  EXPECT_EQ(Get(hazard).state, HazardState::kActive) << "two vehicles saw it";
}

TEST_F(ZoneOfficialTest, AHazardInAnotherStateThanWasSeenIsNotDecidedAbout) {
  const Uuid hazard = ReportBy("car-1");
  const SeenHazard seen{Get(hazard).sequence, kHere};
  now_ns_ += kOneSecond;
  ReportBy("car-2");
  const Hazard changed = Get(hazard);
  ASSERT_EQ(changed.state, HazardState::kActive);
  try {
    Zone().Reject(hazard, "Anna", "nothing there", seen);
    FAIL() << "it is decided about";
  } catch (const DecisionConflict& conflict) {
    EXPECT_STREQ(conflict.what(),
                 "the hazard changed since it was seen: it was candidate and is active now");
  }
  EXPECT_EQ(Get(hazard).sequence, changed.sequence);
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "nothing there", SeenHazard{changed.sequence, kHere}));
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "nothing there", SeenHazard{changed.sequence, kHere}))
      << "the same again, whatever was seen";
  EXPECT_THROW(Zone().Confirm(hazard, "Bert", "", SeenHazard{1, std::nullopt}), DecisionConflict);
  EXPECT_THROW(Zone().Confirm(hazard, "Bert", "", SeenHazard{0, std::nullopt}), DecisionConflict);
}

TEST_F(ZoneOfficialTest, ASightingThatChangesNeitherStateNorPlaceHindersNoDecision) {
  const Uuid hazard = ReportBy("car-1");
  const SeenHazard seen{Get(hazard).sequence, kHere};
  now_ns_ += kOneSecond;
  ReportBy("car-1");
  ASSERT_GT(Get(hazard).sequence, seen.sequence);
  const SeenHazard elsewhere{seen.sequence, geo::GeoPoint{40.4405, -79.94}};
  EXPECT_THROW(Zone().Reject(hazard, "Anna", "nothing there", elsewhere), DecisionConflict);
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "nothing there", seen));
}

TEST_F(ZoneOfficialTest, OneDecisionAboutAVehicleIsCarriedOutAtATime) {
  const Uuid hazard = ReportBy("car-1");
  std::vector<std::string> answers;
  const auto ask = [&](const auto& decide) {
    // In a thread of its own: whoever waits for the decision that is carried out waits for good.
    std::promise<std::string> answer;
    std::future<std::string> answered = answer.get_future();
    std::thread([decide, answer = std::move(answer)]() mutable {
      try {
        decide();
        answer.set_value("done");
      } catch (const DecisionConflict& conflict) {
        answer.set_value(conflict.what());
      }
    }).detach();
    answers.push_back(answered.wait_for(std::chrono::seconds(20)) == std::future_status::ready
                          ? answered.get()
                          : "waits");
  };
  const int subscription = Zone().Subscribe([&](const ZoneEvent& event) {
    if (!event.hazard || !answers.empty()) return;
    ask([this] { Zone().Trust("car-1", "Bert", "it was another one"); });
    if (answers.back() == "waits") return;
    ask([this] { Zone().Distrust("car-1", "Bert", "me too"); });
  });
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "stolen"), 1U);
  Zone().Unsubscribe(subscription);
  const std::string busy =
      "another decision about this vehicle is being carried out; decide again when it is done";
  EXPECT_EQ(answers, (std::vector<std::string>{busy, busy}));
  EXPECT_EQ(Get(hazard).vehicles, 0U);
  EXPECT_EQ(Zone().Trust("car-1", "Bert", "it was another one"), 1U) << "now it is its turn";
  EXPECT_EQ(Get(hazard).vehicles, 1U);
}

TEST_F(ZoneOfficialTest, ADistrustedVehicleAloneMakesNoHazard) {
  const geo::GeoPoint elsewhere{40.45, -79.94};
  ReportBy("car-1");
  ASSERT_TRUE(Zone().Distrust("car-1", "Anna", "stolen"));
  EXPECT_TRUE(ReportBy("car-1", elsewhere).IsNil()) << "it is refused";
  const Uuid hazard = ReportBy("car-2", elsewhere);
  EXPECT_EQ(ReportBy("car-1", elsewhere), hazard) << "a sighting of what there is";
  ASSERT_TRUE(Zone().Trust("car-1", "Anna"));
  EXPECT_FALSE(ReportBy("car-1", {40.46, -79.94}).IsNil());
}

TEST_F(ZoneOfficialTest, NothingIsWithdrawnUnderADistrustThatWasTakenBack) {
  const Uuid hazard = ReportBy("car-1");
  zone_.reset();
  const ZoneConfig config = CheckedConfig(Config());
  ZoneState state(config, config.directory, 1);
  HazardSteps steps(config, state);
  OfficialActions officials(config, state, steps);
  const std::vector<OfficialActions::Slot> none;
  const std::vector<OfficialActions::Slot> slots{*state.hazards.Find(hazard)};
  OfficialActions::VehiclePiece piece;
  const auto run = [&](const auto& body) {
    ZoneTransaction transaction(state, now_ns_);
    transaction.Run([&] { body(transaction); });
  };
  run([&](ZoneTransaction& transaction) {
    piece = officials.Distrust("car-1", none, "Anna", "stolen", 0, transaction);
  });
  run([&](ZoneTransaction& transaction) {
    officials.Trust("car-1", 500, "Bert", "", 0, transaction);
  });
  EXPECT_THROW(run([&](ZoneTransaction& transaction) {
                 officials.Distrust("car-1", slots, "Anna", "stolen", piece.decision, transaction);
               }),
               DecisionConflict);
  EXPECT_EQ(state.hazards.Get(slots[0]).vehicles, 1U);
}

TEST_F(ZoneOfficialTest, ASecondUndoChangesNothing) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kNothing);
  EXPECT_TRUE(Zone().Confirm(hazard, "Anna"));
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "no"));
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kDone);
  EXPECT_EQ(Get(hazard).state, HazardState::kActive);
  const std::uint64_t sequence = Zone().Sequence();
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kBefore);
  EXPECT_EQ(Zone().Sequence(), sequence);
  EXPECT_EQ(Zone().Undo(Uuid(), "Anna"), Undone::kUnknown);
  EXPECT_TRUE(Zone().Remove(hazard, "test"));
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kGone);
}

TEST_F(ZoneOfficialTest, TheSameConfirmationThriceIsOneEvent) {
  const Uuid hazard = ReportBy("car-1");
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Zone().Confirm(hazard, "Anna", "seen"));
  EXPECT_EQ(Zone().Events(hazard, 10).size(), 2U);
  EXPECT_TRUE(Zone().Confirm(hazard, "Bert", "seen")) << "another official's word is news";
  EXPECT_EQ(Zone().Events(hazard, 10).size(), 3U);
}

TEST_F(ZoneOfficialTest, AReasonOfBlanksIsNoReason) {
  const Uuid hazard = ReportBy("car-1");
  for (const std::string blank : {"  ", "\xc2\xa0", "\xe3\x80\x80", "\xe2\xa0\x80"}) {
    EXPECT_THROW(Zone().Reject(hazard, "Anna", blank), Error);
    EXPECT_THROW(Zone().Distrust("car-1", "Anna", blank), Error);
    EXPECT_THROW(Zone().Confirm(hazard, blank, ""), Error);
  }
}

TEST_F(ZoneOfficialTest, DecisionsAboutMapChangesAreUndoneToo) {
  protocol::MapChangeReport change = MakeBarrier();
  change.stamp_ns = now_ns_ - kOneSecond;
  change.earlier_stamp_ns = now_ns_ - kOneDay;
  const Uuid uuid = Zone().HandleMapChanges({change}).front().hazard_uuid;
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Anna"), Undone::kNothing);
  EXPECT_TRUE(Zone().DismissMapChange(uuid, "Anna", "no"));
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Anna", "yes"), Undone::kDone);
  EXPECT_EQ(Zone().FindMapChange(uuid)->state, MapChangeState::kProposed);
  EXPECT_EQ(Zone().MapChangeEvents(uuid, 1).front().reason, "dismiss undone by Anna: yes");
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Zone().ConfirmMapChange(uuid, "Anna", "seen"));
  EXPECT_EQ(Zone().MapChangeEvents(uuid, 10).size(), 4U);
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Anna"), Undone::kDone);
  EXPECT_EQ(Zone().FindMapChange(uuid)->state, MapChangeState::kProposed);
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Anna"), Undone::kBefore);
}

TEST_F(ZoneOfficialTest, AnUndoThatNamesADecisionAboutAMapChangeLeavesALaterOneAlone) {
  protocol::MapChangeReport change = MakeBarrier();
  change.stamp_ns = now_ns_ - kOneSecond;
  change.earlier_stamp_ns = now_ns_ - kOneDay;
  const Uuid uuid = Zone().HandleMapChanges({change}).front().hazard_uuid;
  const auto dismissal = Zone().DismissMapChange(uuid, "Anna", "no");
  const auto confirmation = Zone().ConfirmMapChange(uuid, "Bert", "seen");
  ASSERT_TRUE(dismissal && confirmation);
  EXPECT_EQ(Zone().ConfirmMapChange(uuid, "Bert", "seen"), confirmation) << "the same again";
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Anna", "", dismissal), Undone::kOther);
  EXPECT_EQ(Zone().FindMapChange(uuid)->state, MapChangeState::kConfirmed);
  EXPECT_EQ(Zone().UndoMapChange(uuid, "Bert", "", confirmation), Undone::kDone);
  EXPECT_EQ(Zone().FindMapChange(uuid)->state, MapChangeState::kDismissed);
}

TEST_F(ZoneOfficialTest, DistrustIsPreviewedDoneAndTakenBackInPiecesAlsoAfterARestart) {
  constexpr std::size_t kCount = 1203;  // More than two pieces.
  std::vector<Uuid> hazards;
  for (std::size_t i = 0; i < kCount; ++i) {
    const geo::GeoPoint place{40 + 1e-3 * static_cast<double>(i), -79.94};
    hazards.push_back(ReportBy("car-9", place));
    if (i % 3 == 0) ReportBy("car-2", place);
    if (i % 6 == 0) ReportBy("car-3", place);
  }
  const Uuid rejected = hazards[1];
  const auto states = [&] {
    std::string text;
    for (const Uuid& hazard : hazards) {
      const Hazard now = Get(hazard);
      text += std::string(HazardStateName(now.state)) + " " + std::to_string(now.presence) + " " +
              std::to_string(now.vehicles) + "\n";
    }
    return text;
  };
  const std::string before = states();
  const auto preview = Zone().PreviewDistrust("car-9");
  ASSERT_TRUE(preview);
  EXPECT_EQ(states(), before);
  EXPECT_FALSE(preview->is_distrusted);
  EXPECT_EQ(preview->hazards, kCount);
  EXPECT_EQ(preview->would_vanish, 802U) << "that nobody else saw";
  EXPECT_EQ(preview->would_change, 802U + 200U) << "and those of two vehicles";
  EXPECT_EQ(preview->examples.size(), 20U);
  EXPECT_EQ(preview->examples.front().to, "gone");

  EXPECT_EQ(Zone().Distrust("car-9", "Anna", "stolen"), kCount);
  EXPECT_EQ(Get(rejected).state, HazardState::kGone);
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 1U);
  EXPECT_TRUE(Zone().PreviewDistrust("car-9")->is_distrusted);
  const std::uint64_t sequence = Zone().Sequence();
  EXPECT_EQ(Zone().Distrust("car-9", "Anna", "stolen"), 0U) << "once is enough";
  EXPECT_EQ(Zone().Sequence(), sequence);

  zone_.reset();
  EXPECT_EQ(Zone().Trust("car-9", "Bert", "it was another"), kCount);
  EXPECT_EQ(states(), before);
  EXPECT_EQ(LastReason(rejected), "words of car-9 restored by Bert: it was another");
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 0U);
  EXPECT_EQ(Zone().Trust("car-9", "Bert"), 0U);
  EXPECT_FALSE(Zone().Trust("car-77", "Bert"));
  EXPECT_FALSE(Zone().PreviewDistrust("car-77"));
  const auto history = Zone().PreviewDistrust("car-9")->decisions;
  ASSERT_EQ(history.size(), 2U);
  EXPECT_EQ(history[0].kind, DecisionKind::kTrustVehicle);
  EXPECT_EQ(history[0].hazards, kCount);
  EXPECT_NE(history[1].undone_by, 0U);
  EXPECT_EQ(history[1].official, "Anna");
}

TEST_F(ZoneOfficialTest, ADecisionThatStandsIsFoundBehindAnyNumberOfOthersAndBrokenRows) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_TRUE(Zone().Confirm(hazard, "Anna"));
  ReportBy("car-2", {41, -79.94});
  EXPECT_EQ(Zone().Distrust("car-2", "Anna", "a"), 1U);
  const auto add = [this](int rows, int kind, const std::string& subject) {
    Probe().Execute("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
                    std::to_string(rows) +
                    ") INSERT INTO decisions (kind, subject, official, reason, at_ns, hazards, "
                    "undone_by, before, effects) SELECT " +
                    std::to_string(kind) + ", '" + subject +
                    "', 'Bert', '', 0, 0, 0, '', '' FROM n");
  };
  for (const std::string& subject : {hazard.ToString(), std::string("car-2")}) {
    add(1500, static_cast<int>(DecisionKind::kUndo), subject);
    add(3, 99, subject);
  }
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kDone);
  EXPECT_TRUE(Zone().PreviewDistrust("car-2")->is_distrusted);
  EXPECT_EQ(Zone().Trust("car-2", "Anna"), 1U);
  EXPECT_FALSE(Zone().PreviewDistrust("car-2")->is_distrusted);
}

TEST_F(ZoneOfficialTest, ABrokenWithdrawalIsLeftOutAndToldAndTheOthersAreTakenBack) {
  std::vector<protocol::Report> reports;  // More than one piece.
  for (int i = 0; i < 503; ++i) reports.push_back(MakeReport({40 + 1e-3 * i, -79.94}));
  Zone().HandleBatch(reports);
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "stolen"), 503U);
  Probe().Execute(
      "UPDATE withdrawals SET hazard_uuid = '********-****-****-****-************' WHERE "
      "hazard_uuid = (SELECT max(hazard_uuid) FROM withdrawals)");
  zone_.reset();
  EXPECT_EQ(Zone().Statistics().store_damage.rows, 1U);
  EXPECT_THAT(Zone().Statistics().store_damage.first, HasSubstr("withdrawals"));
  EXPECT_EQ(Zone().Trust("car-1", "Anna"), 502U);
}

TEST_F(ZoneOfficialTest, TrustingOneVehicleDoesNotRestoreAnotherThatIsDistrusted) {
  const Uuid hazard = ReportBy("car-1");
  ReportBy("car-2");
  ReportBy("car-3");
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "a"), 1U);
  EXPECT_EQ(Zone().Distrust("car-2", "Anna", "b"), 1U);
  EXPECT_EQ(Get(hazard).vehicles, 1U);
  EXPECT_EQ(Zone().Trust("car-1", "Anna"), 1U);
  EXPECT_EQ(Get(hazard).vehicles, 2U);
  EXPECT_EQ(Zone().Trust("car-2", "Anna"), 1U);
  EXPECT_EQ(Get(hazard).vehicles, 3U);
}

TEST_F(ZoneOfficialTest, WhatAnOfficialDecidedSinceADistrustHolds) {
  const Uuid hazard = ReportBy("car-1");
  ReportBy("car-2");
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "a"), 1U);
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "nothing there"));
  Zone().Trust("car-1", "Anna");
  EXPECT_EQ(Get(hazard).state, HazardState::kRejected);
}

TEST_F(ZoneOfficialTest, AHazardThatWasReportedAnewIsNotDoubledByTrust) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "a"), 1U);
  const Uuid successor = ReportBy("car-2");
  ASSERT_NE(successor, hazard);
  EXPECT_EQ(Zone().Trust("car-1", "Anna"), 0U);
  EXPECT_EQ(Get(hazard).state, HazardState::kGone);
  EXPECT_EQ(Zone().Query(std::nullopt, 0, 10).size(), 1U);
}

TEST_F(ZoneOfficialTest, AFailedUndoLeavesMemoryAndStoreAsTheyWere) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", "no"));
  StoreProbe saboteur = Probe();
  saboteur.Refuse("UPDATE", "hazards", "full");
  EXPECT_THROW(Zone().Undo(hazard, "Anna"), StoreError);
  EXPECT_EQ(Get(hazard).state, HazardState::kRejected);
  saboteur.Accept("hazards");
  EXPECT_EQ(Zone().Undo(hazard, "Anna"), Undone::kDone);
}

}  // namespace
}  // namespace livemap::zone
