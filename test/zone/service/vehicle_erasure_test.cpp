// How the zone forgets a vehicle.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/sqlite.h"
#include "test/zone/map_change_fixture.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/erasure_desk.h"
#include "zone/service/zone_service.h"
#include "zone/store/erasure_requests.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;
using testing::Not;

const geo::GeoPoint kErasurePlace{40.44, -79.94};
constexpr char kErased[] = "car-erika";
const std::string kErasureSecret(64, '5');

class VehicleErasureTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.catalogue = protocol::HazardCatalogue();  // Two vehicles confirm.
      config.polls.picture_age_s = 1;
      config.allowance.evidence_per_hour = 1e6;
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  ErasureCounts Forget() { return Zone().Forget({kErased, kErasureSecret}, "anna"); }

  Uuid ReportBy(const std::string& vehicle, int place, bool has_picture = false) {
    protocol::Report report = MakeReport(geo::GeodesicDestination(kErasurePlace, 0, 100.0 * place));
    report.vehicle_id = vehicle;
    report.drive_id = "drive of " + vehicle;
    report.stamp_ns = now_ns_ - kOneSecond;
    if (has_picture) report.image = MakeJpeg(64, 48, 500, ++pictures_);
    return Zone().Handle(report).hazard_uuid;
  }
  void DriveBy(const std::string& vehicle, double from_m, double to_m) {
    for (double metres = from_m; metres <= to_m; metres += 15) {
      now_ns_ += kOneSecond;
      const double bearing = metres < 0 ? 3.14159265358979323846 : 0.0;
      const geo::GeoPoint at = geo::GeodesicDestination(kErasurePlace, bearing, std::abs(metres));
      Zone().UpdateVehicle({vehicle, "", at, 0.0, 15.0, now_ns_});
    }
  }
  /// The vehicle is asked about the hazard at place 0, and sends a picture with its answer.
  void AnswerBy(const std::string& vehicle, const Uuid& hazard) {
    now_ns_ += kOneDay / 2;
    DriveBy(vehicle, -200, -60);
    const std::vector<protocol::Poll> polls = Zone().TakeDuePolls();
    const auto poll = std::find_if(polls.begin(), polls.end(),
                                   [&](const auto& one) { return one.hazard == hazard; });
    ASSERT_NE(poll, polls.end());
    DriveBy(vehicle, -45, -15);
    protocol::PollAnswer answer;
    answer.poll = poll->poll;
    answer.hazard = poll->hazard;
    answer.vehicle_id = vehicle;
    answer.answer = protocol::PollAnswer::Answer::kYes;
    answer.confidence = 0.9F;
    answer.vehicle_position = kErasurePlace;
    answer.stamp_ns = now_ns_;
    answer.image = MakeJpeg(64, 48, 500, ++pictures_);
    ASSERT_TRUE(Zone().HandleAnswer(answer));
  }
  void TellMapChangeBy(const std::string& vehicle) {
    protocol::MapChangeReport report = MakeMapChange(vehicle, "drive of " + vehicle);
    report.stamp_ns = now_ns_ - kOneSecond;
    report.earlier_stamp_ns = report.stamp_ns - kOneDay;
    ASSERT_EQ(Zone().HandleMapChanges({report}).size(), 1U);
  }
  /// The files of the store that hold the text.
  std::vector<std::string> FilesWith(const std::string& text) const {
    std::vector<std::string> found;
    for (const auto& item : std::filesystem::recursive_directory_iterator(directory_)) {
      if (!item.is_regular_file()) continue;
      const std::string content = ReadFile(item.path().string(), std::size_t{1} << 30);
      if (content.find(text) != std::string::npos) found.push_back(item.path().filename().string());
    }
    return found;
  }
  /// As SQLite keeps a whole number, and as text.
  static std::vector<std::string> FormsOfKey() {
    const std::uint64_t key = VehicleKey(kErased);
    std::string bytes;
    for (int shift = 56; shift >= 0; shift -= 8) bytes += static_cast<char>(key >> shift & 0xFF);
    return {std::to_string(key), bytes};
  }
  std::string Select(const std::string& sql) const { return Probe().Text(sql); }
  std::map<std::string, std::string> Map() {
    std::map<std::string, std::string> map;
    for (const Hazard& hazard : Zone().Query(std::nullopt, 0, 1000)) {
      map[hazard.uuid.ToString()] = std::string(HazardStateName(hazard.state)) + " by " +
                                    std::to_string(hazard.vehicles) + ", " +
                                    std::to_string(hazard.presence);
    }
    for (const MapChangeFeature& change : Zone().QueryMapChanges(std::nullopt, 0, 1000)) {
      map[change.uuid.ToString()] = std::string(MapChangeStateName(change.state)) + " by " +
                                    std::to_string(change.Vehicles()) + ", " +
                                    std::to_string(change.drives);
    }
    return map;
  }

  std::int64_t now_ns_ = kNowNs;
  std::uint8_t pictures_ = 0;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(VehicleErasureTest, NothingInTheStoreLeadsToTheVehicleAndTheMapStays) {
  const Uuid first = ReportBy(kErased, 0, true);
  const std::string erased_picture = Zone().Find(first)->image_sha256;
  ASSERT_TRUE(Zone().ImagePath(erased_picture));
  ReportBy("car-2", 0);
  const Uuid second = ReportBy("car-2", 1, true);
  const std::string kept_picture = Zone().Find(second)->image_sha256;
  ReportBy(kErased, 1);
  ReportBy(kErased, 2);
  ASSERT_NO_FATAL_FAILURE(AnswerBy(kErased, first));
  const std::string answer_picture = Zone().Find(first)->image_sha256;
  ASSERT_NE(answer_picture, erased_picture);
  TellMapChangeBy(kErased);
  TellMapChangeBy("car-2");
  ASSERT_TRUE(Zone().Reject(ReportBy(kErased, 3), "miller", "car-erika's dirty lens"));
  ASSERT_TRUE(Zone().Distrust(kErased, "miller", "car-erika lies, car-erika2 does not"));
  ASSERT_TRUE(Zone().Trust(kErased, "miller"));
  const auto map = Map();
  const std::string has_key = " LIKE '%" + std::to_string(VehicleKey(kErased)) + "%'";
  const std::string with_evidence =
      Select("SELECT (SELECT count(*) FROM hazards WHERE life" + has_key +
             ") + (SELECT count(*) FROM map_changes WHERE witnesses" + has_key + ")");
  ASSERT_GE(std::stoi(with_evidence), 4) << "hazards and a map change";
  if (!IsOnPostgresql()) {
    ASSERT_THAT(FilesWith(kErased), Not(testing::IsEmpty())) << "else it finds nothing anyway";
  }

  const ErasureCounts counts = Forget();
  EXPECT_EQ(counts.reports, 5U);
  EXPECT_EQ(counts.answers, 1U);
  EXPECT_EQ(std::to_string(counts.hazards), with_evidence);
  EXPECT_EQ(counts.pictures, 2U);
  EXPECT_GT(counts.places, 0U);

  EXPECT_THAT(FilesWith("drive of car-erika"), testing::IsEmpty());
  for (const std::string& form : FormsOfKey()) EXPECT_THAT(FilesWith(form), testing::IsEmpty());
  EXPECT_EQ(Map(), map);
  EXPECT_FALSE(Zone().ImagePath(erased_picture));
  EXPECT_FALSE(Zone().ImagePath(answer_picture));
  EXPECT_TRUE(Zone().ImagePath(kept_picture));
  for (const VehicleState& vehicle : Zone().Vehicles()) EXPECT_NE(vehicle.vehicle_id, kErased);
  EXPECT_FALSE(Zone().PreviewDistrust(kErased)) << "the zone has never heard of it";
  for (const DecisionRecord& decision : Zone().Decisions(INT64_MAX, 100)) {
    EXPECT_NE(decision.subject, kErased);
    EXPECT_THAT(decision.reason, Not(HasSubstr("car-erika ")));
  }
  // Another vehicle whose name begins with it is not touched.
  EXPECT_TRUE(IsOnPostgresql() || !FilesWith("car-erika2").empty());
  zone_.reset();
  EXPECT_EQ(Map(), map) << "after a restart";
  EXPECT_EQ(Zone().Statistics().store_damage.rows, 0U) << Zone().Statistics().store_damage.first;
}

TEST_F(VehicleErasureTest, NoByteOfItsNameStaysInTheFilesOfARunningZone) {
  for (int place = 0; place < 300; ++place) ReportBy(kErased, place, place % 10 == 0);
  for (int place = 0; place < 300; ++place) ReportBy("car-2", place);
  ASSERT_TRUE(Zone().Distrust(kErased, "miller", "lies"));
  Forget();
  EXPECT_THAT(FilesWith("erika"), testing::IsEmpty());
  for (const std::string& key : FormsOfKey()) EXPECT_THAT(FilesWith(key), testing::IsEmpty());
}

TEST_F(VehicleErasureTest, TheTrailSaysWhoErasedAndWhenAndNotWhom) {
  ReportBy(kErased, 0);
  now_ns_ += kOneHour;
  Forget();
  const std::vector<DecisionRecord> trail = Zone().Decisions(INT64_MAX, 10);
  ASSERT_EQ(trail.size(), 1U);
  EXPECT_EQ(trail.front().kind, DecisionKind::kForgetVehicle);
  EXPECT_EQ(trail.front().official, "anna");
  EXPECT_EQ(trail.front().at_ns, now_ns_);
  EXPECT_EQ(trail.front().hazards, 1U);
  EXPECT_THAT(trail.front().subject, testing::StartsWith("forgotten-"));
}

TEST_F(VehicleErasureTest, ItStaysOneWitnessAtEachHazardAndNobodyCanTellThatItWasOne) {
  const Uuid hazard = ReportBy(kErased, 0);
  ReportBy(kErased, 0);
  ReportBy(kErased, 1);
  Forget();
  EXPECT_EQ(Zone().Find(hazard)->vehicles, 1U);
  EXPECT_EQ(Select("SELECT count(DISTINCT vehicle_id) FROM reports"), "2")
      << "one name for each hazard";
  EXPECT_EQ(Select("SELECT count(*) FROM reports"), "3");
  EXPECT_EQ(Zone().Find(hazard)->state, HazardState::kCandidate);
  ReportBy("car-2", 0);
  EXPECT_EQ(Zone().Find(hazard)->vehicles, 2U);
  EXPECT_EQ(Zone().Find(hazard)->state, HazardState::kActive) << "both count";
}

TEST_F(VehicleErasureTest, WhatItTellsAfterwardsIsANewVehicles) {
  const Uuid hazard = ReportBy(kErased, 0);
  Forget();
  now_ns_ += kOneHour;
  EXPECT_EQ(ReportBy(kErased, 0), hazard);
  EXPECT_EQ(Zone().Find(hazard)->vehicles, 2U);
}

TEST_F(VehicleErasureTest, AnUndoOfADecisionOfBeforeLeavesTheHazardAsItWas) {
  const Uuid hazard = ReportBy(kErased, 0);
  const Hazard before = *Zone().Find(hazard);
  ASSERT_TRUE(Zone().Reject(hazard, "miller", "nothing there"));
  Forget();
  EXPECT_EQ(Zone().Undo(hazard, "miller"), ZoneService::Undone::kDone);
  EXPECT_EQ(Zone().Find(hazard)->state, before.state);
  EXPECT_EQ(Zone().Find(hazard)->vehicles, before.vehicles);
  EXPECT_THAT(FilesWith("erika"), testing::IsEmpty());
}

TEST_F(VehicleErasureTest, OneThatWasCutOffGoesOn) {
  for (int place = 0; place < 5; ++place) ReportBy(kErased, place, true);
  Probe().Refuse("DELETE", "places", "full");
  EXPECT_THROW(Forget(), StoreError);
  Probe().Accept("places");
  zone_.reset();
  Forget();
  EXPECT_THAT(FilesWith("erika"), testing::IsEmpty());
  EXPECT_EQ(Zone().Statistics().image_bytes, 0U);
}

TEST_F(VehicleErasureTest, AnUnknownVehicleLeavesNoTrace) {
  ReportBy("car-2", 0);
  EXPECT_EQ(Forget().rows(), 0U);
  EXPECT_TRUE(Zone().Decisions(INT64_MAX, 10).empty());
}

TEST_F(VehicleErasureTest, ReportsOfOthersAreCommittedMeanwhile) {
  for (int place = 0; place < 200; ++place) ReportBy(kErased, place);
  std::atomic<bool> is_done{false};
  std::thread erasure([&] {
    Forget();
    is_done = true;
  });
  int committed = 0;
  while (!is_done || committed == 0) {
    protocol::Report report = MakeReport(kErasurePlace);
    report.vehicle_id = "car-" + std::to_string(committed % 50);
    report.stamp_ns = now_ns_ - kOneSecond;
    EXPECT_EQ(Zone().Handle(report).status, protocol::Receipt::Status::kCommitted);
    ++committed;
  }
  erasure.join();
  EXPECT_THAT(FilesWith("erika"), testing::IsEmpty());
}

TEST_F(VehicleErasureTest, ARunningZoneDoesWhatItsFileAsks) {
  ReportBy(kErased, 0);
  ErasureRequests requests(ErasureRequests::PathIn(directory_ + "/zone"));
  const std::int64_t id = requests.Add(kErased, "anna", now_ns_);
  EXPECT_FALSE(requests.Find(id));
  {
    const ErasureDesk desk(directory_ + "/zone", Zone(), Clock(), [](const std::string& line) {
      EXPECT_THAT(line, Not(HasSubstr("erika")));
    });
    while (!requests.Find(id)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(requests.Find(id)->counts.reports, 1U);
  EXPECT_FALSE(requests.Next());
  EXPECT_THAT(FilesWith("erika"), testing::IsEmpty());
}

TEST_F(VehicleErasureTest, AFileOfRequestsTakesNoNameThatNobodyHas) {
  std::filesystem::create_directories(directory_ + "/zone");
  ErasureRequests requests(ErasureRequests::PathIn(directory_ + "/zone"));
  EXPECT_THROW(requests.Add("", "anna", 1), Error);
  EXPECT_THROW(requests.Add(std::string(65, 'x'), "anna", 1), Error);
  EXPECT_THROW(requests.Add("car\n1", "anna", 1), Error);
  EXPECT_THROW(requests.Add("car-1", "", 1), Error);
  EXPECT_FALSE(requests.Next());
}

TEST(PseudonymsTest, ReplaceANameWhereItStandsAlone) {
  const Pseudonyms names("car-1", kErasureSecret);
  const std::string pseudonym = names.IdFor("x");
  const auto replaced = [&](std::string text) {
    names.ReplaceName(text, "x", 1000);
    return text;
  };
  EXPECT_EQ(replaced("car-1"), pseudonym);
  EXPECT_EQ(replaced("it is car-1."), "it is " + pseudonym + ".");
  EXPECT_EQ(replaced("'car-1', car-1"), "'" + pseudonym + "', " + pseudonym);
  for (const char* other : {"car-12", "mycar-1", "car-1-b", "car-1_b", "car-1.2", "a.car-1"}) {
    EXPECT_EQ(replaced(other), other);
  }
  std::string text = "car-1 " + std::string(190, 'x');
  EXPECT_TRUE(names.ReplaceName(text, "x", 200));
  EXPECT_EQ(text.size(), 200U);
}

TEST(PseudonymsTest, ReplaceAKeyInALineOfNumbers) {
  const Pseudonyms names("car-1", kErasureSecret);
  const std::string key = std::to_string(names.key());
  const std::string other = std::to_string(names.KeyFor("x"));
  std::string line = "1 " + key + " 2|" + key + " " + key + "1 1" + key;
  EXPECT_TRUE(names.ReplaceKey(line, "x"));
  EXPECT_EQ(line, "1 " + other + " 2|" + other + " " + key + "1 1" + key);
  line = "1 2 3";
  EXPECT_FALSE(names.ReplaceKey(line, "x"));
  EXPECT_NE(names.KeyFor("x"), names.KeyFor("y"));
  EXPECT_NE(names.KeyFor("x"), Pseudonyms("car-1", std::string(64, '6')).KeyFor("x"));
}

}  // namespace
}  // namespace livemap::zone
