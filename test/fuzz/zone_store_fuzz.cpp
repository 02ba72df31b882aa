// A sound database of a zone into which something else than the program wrote: what is loaded keeps
// the promises of zone/hazard.h, the sound hazard beside it stays, and the zone goes on.
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "protocol/text_rules.h"
#include "test/fuzz/store_script.h"
#include "zone/service/zone_service.h"

namespace livemap::fuzz {
namespace {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

protocol::Report MakeReport(std::uint8_t number, const std::string& vehicle, double latitude_deg) {
  protocol::Report report;
  report.uuid.bytes[0] = number;
  report.uuid.bytes[15] = 1;
  report.vehicle_id = vehicle;
  report.drive_id = "drive";
  report.stamp_ns = kNowNs - 1'000'000'000;
  report.class_name = number % 2 == 0 ? "pothole" : "cone";
  report.confidence = 0.5F;
  report.box = {1, 1, 2, 2};
  report.position = {latitude_deg, 8};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 10;
  return report;
}

protocol::MapChangeReport MakeMapChange(std::uint8_t number, const std::string& vehicle,
                                        double latitude_deg) {
  protocol::MapChangeReport report;
  report.uuid.bytes[0] = number;
  report.uuid.bytes[15] = 2;
  report.vehicle_id = vehicle;
  report.drive_id = "drive";
  report.stamp_ns = kNowNs - 1'000'000'000;
  report.class_name = "barrier";
  report.confidence = 0.5F;
  report.seen = 3;
  report.position = {latitude_deg, 8};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  return report;
}

zone::ZoneService::Config ConfigOf(const std::string& directory) {
  zone::ZoneService::Config config;
  config.directory = directory;
  config.speed.max_speed_mps = 1e9;
  return config;
}

std::int64_t Now() { return kNowNs; }

/// An official asks for a whole frame, and a vehicle that stands before the hazard brings it.
void AnswerForFrame(zone::ZoneService& zone, const zone::Hazard& hazard) {
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kAskFrame;
  zone.Act(hazard.uuid, "Anna", action);
  constexpr double kSouthRad = 3.14159265358979323846;
  const geo::GeoPoint at = geo::GeodesicDestination(hazard.position, kSouthRad, 30);
  zone.UpdateVehicle({"car-8", "", at, 0, 0, kNowNs, 0});
  for (const protocol::Poll& poll : zone.TakeDuePolls()) {
    if (poll.vehicle_id != "car-8") continue;
    protocol::PollAnswer answer;
    answer.poll = poll.poll;
    answer.hazard = poll.hazard;
    answer.vehicle_id = poll.vehicle_id;
    answer.stamp_ns = kNowNs;
    answer.answer = protocol::PollAnswer::Answer::kYes;
    answer.confidence = 0.5F;
    answer.vehicle_position = at;
    // The header of a JPEG of 32 x 32 pixels.
    answer.image = {0xff, 0xd8, 0xff, 0xe0, 0, 4,  0, 0, 0xff, 0xc0, 0,
                    11,   8,    0,    32,   0, 32, 1, 1, 0x11, 0};
    answer.image_format = "jpeg";
    zone.HandleAnswer(answer);
  }
  Require(zone.AnswerPictures(hazard.uuid, 10).size() == 1);
}

/// A database as the program writes it, made once; its first hazard is spared.
struct Template {
  Template() {
    const std::string made = folder + "/made";
    {
      zone::ZoneService zone(ConfigOf(made), Now, 1);
      for (std::uint8_t i = 2; i < 6; ++i) {
        zone.Handle(MakeReport(i, "car-1", 40 + i));
        protocol::Report second = MakeReport(static_cast<std::uint8_t>(i + 100), "car-2", 40 + i);
        zone.Handle(second);
      }
      spared = zone.Query(std::nullopt, 0, 1).at(0);
      const auto all = zone.Query(std::nullopt, 0, 10);
      zone.Reject(all.at(2).uuid, "Anna", "a shadow");
      zone.Confirm(all.at(3).uuid, "Anna");
      zone.Handle(MakeReport(50, "car-7", 47));
      zone.Distrust("car-7", "Anna", "stolen");
      AnswerForFrame(zone, all.at(1));
      zone.HandleMapChanges({MakeMapChange(1, "car-1", 50), MakeMapChange(2, "car-2", 50),
                             MakeMapChange(3, "car-1", 51)});
    }
    database = ReadFile(made + "/zone.sqlite3", 100 << 20);
    SqliteDatabase open(made + "/zone.sqlite3", false);
    tables = {ReadFuzzTable(open, "hazards", "id", "1"),
              ReadFuzzTable(open, "events", "sequence"),
              ReadFuzzTable(open, "reports", "uuid"),
              ReadFuzzTable(open, "answers", "poll_uuid"),
              ReadFuzzTable(open, "answer_pictures", "poll_uuid"),
              ReadFuzzTable(open, "lives", "class_name"),
              ReadFuzzTable(open, "trust", "vehicle_key"),
              ReadFuzzTable(open, "places", "vehicle_id"),
              ReadFuzzTable(open, "decisions", "id"),
              ReadFuzzTable(open, "withdrawals", "hazard_uuid"),
              ReadFuzzTable(open, "map_changes", "id"),
              ReadFuzzTable(open, "map_change_events", "sequence"),
              ReadFuzzTable(open, "map_change_reports", "uuid"),
              ReadFuzzTable(open, "livemap_schema", "version")};
  }
  ~Template() { std::filesystem::remove_all(folder); }

  const std::string folder = FuzzFolder("zone_store_fuzz");
  zone::Hazard spared;
  std::string database;
  std::vector<FuzzTable> tables;
};

void RequireSound(const zone::Hazard& hazard) {
  Require(!hazard.uuid.IsNil() && protocol::IsPrintableText(hazard.class_name, 64));
  Require(hazard.confidence >= 0 && hazard.confidence <= 1);
  Require(hazard.presence >= 0 && hazard.presence <= 1);
  Require(geo::IsValid(hazard.position) && hazard.covariance_m2.allFinite());
  Require(hazard.covariance_m2.determinant() > 0 && hazard.covariance_m2(0, 0) > 0);
  Require(hazard.first_seen_ns >= 0 && hazard.first_seen_ns <= hazard.last_seen_ns);
  Require(hazard.sequence > 0 && hazard.announced_sequence <= hazard.sequence);
  Require(hazard.image_sha256.empty() || hazard.image_sha256.size() == 64);
  Require(hazard.sightings > 0 && hazard.vehicles <= zone::kMaxEvidencePerHazard);
}

void RequireSound(const zone::MapChangeFeature& feature) {
  Require(!feature.uuid.IsNil() && protocol::IsPrintableText(feature.class_name, 64));
  Require(feature.confidence >= 0 && feature.confidence <= 1);
  Require(geo::IsValid(feature.position) && feature.covariance_m2.allFinite());
  Require(feature.covariance_m2.determinant() > 0 && feature.covariance_m2(0, 0) > 0);
  Require(feature.first_seen_ns >= 0 && feature.first_seen_ns <= feature.last_seen_ns);
  Require(feature.sequence > 0 && feature.witnesses.size() <= 2 * zone::kMaxWitnesses);
}

void RequireWorking(zone::ZoneService& zone, const Template& made) {
  const auto spared = zone.Find(made.spared.uuid);
  Require(spared && spared->position.latitude_deg == made.spared.position.latitude_deg);
  Require(spared->sightings >= made.spared.sightings && spared->state == made.spared.state);
  for (const zone::Hazard& hazard : zone.Query(std::nullopt, 1, 1000)) {
    RequireSound(hazard);
    for (const zone::StoredEvent& event : zone.Events(hazard.uuid, 100)) {
      Require(event.reason.size() <= 200 && event.at_ns >= 0);
    }
    for (const zone::AnswerPicture& picture : zone.AnswerPictures(hazard.uuid, 100)) {
      Require(picture.image_sha256.size() == 64 && picture.confidence >= 0);
    }
    if (const auto frame = zone.FrameOf(hazard.uuid)) Require(frame->request.decision > 0);
  }
  // What officials decided can be looked at and taken back, whatever the rows say.
  for (const zone::Hazard& hazard : zone.Query(std::nullopt, 1, 1000)) {
    if (hazard.uuid == made.spared.uuid) continue;
    zone.Undo(hazard.uuid, "Bert");
    RequireSound(*zone.Find(hazard.uuid));
  }
  if (const auto preview = zone.PreviewDistrust("car-7")) {
    Require(preview->would_vanish <= preview->would_change);
    Require(preview->would_change <= preview->hazards);
  }
  zone.Trust("car-7", "Bert");
  for (const zone::Hazard& hazard : zone.QueryNear({42, 8}, 1e6, 100)) RequireSound(hazard);
  for (const zone::MapChangeFeature& feature : zone.QueryMapChanges(std::nullopt, 1, 1000)) {
    RequireSound(feature);
    for (const zone::StoredMapChangeEvent& event : zone.MapChangeEvents(feature.uuid, 100)) {
      Require(event.reason.size() <= 200 && event.at_ns >= 0);
    }
  }
  zone.HandleMapChanges({MakeMapChange(3, "car-1", 51), MakeMapChange(4, "car-3", 50)});
  // What was committed is committed still, and what is new is taken.
  Require(zone.Handle(MakeReport(3, "car-1", 43)).status == protocol::Receipt::Status::kCommitted ||
          zone.Statistics().refused > 0);
  zone.UpdateVehicle({"car-3", "", {42, 8}, 0, 10, kNowNs, 0});
  zone.TakeDuePolls();
  zone.Advance();
}

void FuzzStore(const std::uint8_t* data, std::size_t size) {
  static const Template made;
  const std::string directory = made.folder + "/run";
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  const std::string path = directory + "/zone.sqlite3";
  FILE* file = std::fopen(path.c_str(), "wb");
  Require(file != nullptr);
  Require(std::fwrite(made.database.data(), 1, made.database.size(), file) == made.database.size());
  std::fclose(file);
  {
    SqliteDatabase database(path, false);
    FuzzBytes bytes(data, size);
    RunStoreScript(database, made.tables, bytes);
  }
  try {
    zone::ZoneService zone(ConfigOf(directory), Now, 2);
    RequireWorking(zone, made);
    const protocol::Receipt receipt = zone.Handle(MakeReport(200, "car-9", 60));
    Require(receipt.status == protocol::Receipt::Status::kCommitted);
  } catch (const StoreError& error) {
    // Another schema's version; everything else must have been passed over.
    const std::string why = error.what();
    // With the number of another version its steps are tried, and refused as a whole.
    Require(why.find("schema version") != std::string::npos ||
            why.find("opening '") != std::string::npos);
    return;
  }
  zone::ZoneService zone(ConfigOf(directory), Now, 3);
  RequireWorking(zone, made);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzStore(data, size);
  return 0;
}
