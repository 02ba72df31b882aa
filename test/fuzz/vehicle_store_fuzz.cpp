// A sound store of a vehicle into which something else than the program wrote: what is loaded keeps
// the promises of hazard/local_hazard_map.h, the sound report and hazard beside it stay.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "test/fuzz/store_script.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::fuzz {
namespace {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

Uuid MakeUuid(std::uint8_t number) {
  Uuid uuid;
  uuid.bytes[0] = number;
  uuid.bytes[15] = 1;
  return uuid;
}

protocol::Report MakeReport(std::uint8_t number) {
  protocol::Report report;
  report.uuid = MakeUuid(number);
  report.drive_id = "drive";
  report.stamp_ns = kNowNs;
  report.class_name = "cone";
  report.confidence = 0.5F;
  report.box = {1, 1, 2, 2};
  report.position = {40 + 0.1 * number, 8};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 10;
  report.image_format = "jpeg";
  report.image = {0xff, 0xd8, 0xff, 0xd9};
  return report;
}

protocol::Notice MakeNotice(std::uint8_t number) {
  protocol::Notice notice;
  notice.action =
      number == 23 ? protocol::Notice::Action::kRemoved : protocol::Notice::Action::kAdded;
  notice.sequence = number;
  notice.previous_sequence = number == 20 ? 0 : number - 1U;
  notice.hazard_uuid = MakeUuid(number);
  notice.stamp_ns = kNowNs;
  notice.class_name = "deer";
  notice.confidence = 0.5F;
  notice.position = {40 + 0.1 * number, 8};
  notice.course_rad = 0.5;
  notice.trails = {{notice.position, {40.001 + 0.1 * number, 8}}};
  return notice;
}

vehicle::LocalHazardMap::Config ConfigOf(const std::string& path) {
  vehicle::LocalHazardMap::Config config;
  config.path = path;
  config.max_known = 8;
  return config;
}

/// A store as the program writes it, made once; the report 1 and the hazard 20 are spared.
struct Template {
  Template() {
    const std::string path = folder + "/made.sqlite3";
    {
      vehicle::LocalHazardMap map(ConfigOf(path), protocol::HazardCatalogue(), kNowNs);
      for (std::uint8_t i = 1; i < 5; ++i) map.Add(MakeReport(i));
      map.MarkSent(MakeUuid(2));
      map.Apply({MakeNotice(20), MakeNotice(21), MakeNotice(22), MakeNotice(23)});
    }
    content = ReadFile(path, 100 << 20);
    SqliteDatabase open(path, false);
    tables = {ReadFuzzTable(open, "known", "id", Literal(20)),
              ReadFuzzTable(open, "pending", "uuid", Literal(1)), ReadFuzzTable(open, "gone", "id"),
              ReadFuzzTable(open, "zones", "zone")};
  }
  ~Template() { std::filesystem::remove_all(folder); }

  /// As SQL's quote() writes the id.
  static std::string Literal(std::uint8_t number) {
    char text[40];
    std::snprintf(text, sizeof text, "X'%02X0000000000000000000000000000%02X'", number, 1);
    return text;
  }

  const std::string folder = FuzzFolder("vehicle_store_fuzz");
  std::string content;
  std::vector<FuzzTable> tables;
};

void RequireSound(const vehicle::LocalHazardMap& map) {
  Require(map.set_aside().empty());
  const auto pending = map.Pending();
  Require(pending.size() == map.pending_count());
  for (const auto& waiting : pending) {
    const auto report = map.LoadPending(waiting.uuid);
    Require(report && vehicle::IsSound(*report) &&
            report->image.size() <= vehicle::kMaxStoredImageBytes);
  }
  const auto known = map.Known(1000);
  Require(known.size() == map.known_count());
  for (const vehicle::KnownHazard& hazard : known) {
    Require(!hazard.id.IsNil() && geo::IsValid(hazard.position) && hazard.confidence >= 0);
    Require(hazard.confidence <= 1 && hazard.class_name.size() <= protocol::kMaxClassNameBytes);
  }
  Require(map.map_sequence() < (1ULL << 60));
}

void RequireSpared(const vehicle::LocalHazardMap& map) {
  const auto report = map.LoadPending(MakeUuid(1));
  Require(report && report->position.latitude_deg == MakeReport(1).position.latitude_deg);
}

void FuzzStore(const std::uint8_t* data, std::size_t size) {
  static const Template made;
  const std::string path = made.folder + "/run.sqlite3";
  for (const char* companion : {"", "-wal", "-shm"}) std::filesystem::remove(path + companion);
  FILE* file = std::fopen(path.c_str(), "wb");
  Require(file != nullptr);
  Require(std::fwrite(made.content.data(), 1, made.content.size(), file) == made.content.size());
  std::fclose(file);
  {
    SqliteDatabase database(path, false);
    FuzzBytes bytes(data, size);
    RunStoreScript(database, made.tables, bytes);
  }
  {
    vehicle::LocalHazardMap map(ConfigOf(path), protocol::HazardCatalogue(), kNowNs);
    RequireSound(map);
    RequireSpared(map);
    const auto known = map.Known(1000);
    Require(std::any_of(known.begin(), known.end(), [](const vehicle::KnownHazard& hazard) {
      return hazard.id == MakeUuid(20);
    }));
    Require(map.Add(MakeReport(100)) == vehicle::LocalHazardMap::AddResult::kAdded);
    map.Apply({MakeNotice(24)});
    for (const auto& waiting : map.Pending()) map.MarkSent(waiting.uuid);
    map.ForgetUnannounced(kNowNs + 1);
    protocol::Receipt receipt;
    receipt.status = protocol::Receipt::Status::kCommitted;
    receipt.report_uuid = MakeUuid(2);
    receipt.hazard_uuid = MakeUuid(20);
    map.Apply(receipt);
  }
  const vehicle::LocalHazardMap map(ConfigOf(path), protocol::HazardCatalogue(), kNowNs);
  RequireSound(map);
  RequireSpared(map);
  Require(map.LoadPending(MakeUuid(100)).has_value());
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzStore(data, size);
  return 0;
}
