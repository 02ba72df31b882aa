// What ./livemap bench fleet measures with: thousands of vehicles on a running zone's broker.
#include <sys/resource.h>

#include <cstdio>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "common/error.h"
#include "evaluation/quantile.h"
#include "fleet_load/city_fleet.h"
#include "fleet_load/map_viewers.h"
#include "tools/common/command_line.h"

namespace livemap::bench {
namespace {

void PrintFleetQuantiles(const char* name, const std::vector<double>& values) {
  for (const int percent : {50, 99}) {
    if (values.empty()) {
      std::printf("\"%s_p%d\":null,", name, percent);
    } else {
      std::printf("\"%s_p%d\":%.2f,", name, percent, evaluation::Quantile(values, percent / 100.0));
    }
  }
}

void PrintCount(const char* name, std::uint64_t count) {
  std::printf("\"%s\":%llu,", name, static_cast<unsigned long long>(count));
}

double Mean(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// What viewers heard of what the fleet reported.
void PrintViewers(const MapViewers::Config& config, const MapViewers::Result& viewers,
                  const CityFleet::Result& fleet) {
  std::vector<double> heard_ms;
  for (const MapViewers::Heard& heard : viewers.heard) {
    const auto report = fleet.report_ns.find(heard.sequence);
    if (report == fleet.report_ns.end()) continue;
    heard_ms.push_back(static_cast<double>(heard.heard_ns - report->second) * 1e-6);
  }
  PrintCount("viewers", config.viewers);
  PrintCount("slow_viewers", config.slow);
  PrintCount("viewers_connected", viewers.connected);
  PrintCount("viewers_lost", viewers.lost);
  PrintCount("slow_viewers_closed", viewers.slow_closed);
  PrintCount("viewer_events", viewers.heard.size());
  PrintFleetQuantiles("viewer_ms", heard_ms);
}

void PrintFleetJson(std::size_t vehicles, const CityFleet::Result& result) {
  std::printf("\"vehicles\":%zu,\"seconds\":%.3f,\"connect_s\":%.2f,", vehicles, result.seconds,
              result.connect_s);
  PrintCount("connected", result.connected);
  PrintCount("lost", result.lost);
  PrintCount("positions", result.positions);
  PrintCount("reports", result.reports);
  PrintCount("resent", result.resent);
  PrintCount("unanswered", result.unanswered);
  PrintCount("committed", result.committed);
  PrintCount("refused", result.refused);
  PrintCount("births", result.births);
  PrintCount("polls", result.polls);
  PrintCount("poll_answers", result.poll_answers);
  PrintCount("announcements", result.announcements);
  PrintCount("notices", result.notice_ms.size());
  PrintCount("notices_ahead", result.ahead_ms.size());
  PrintCount("told", result.told);
  PrintCount("cells_told", result.cells_told);
  PrintCount("joined", result.join_s.size());
  PrintFleetQuantiles("position_late_ms", result.late_ms);
  PrintFleetQuantiles("receipt_ms", result.receipt_ms);
  PrintFleetQuantiles("notice_ms", result.notice_ms);
  PrintFleetQuantiles("ahead_ms", result.ahead_ms);
  PrintFleetQuantiles("join_s", result.join_s);
  PrintFleetQuantiles("down_bytes", result.down_bytes);
  const double measured = result.seconds * static_cast<double>(vehicles);
  const auto bits_per_s = [measured](std::uint64_t bytes) {
    return static_cast<double>(bytes) * 8 / measured;
  };
  std::printf("\"up_bit_s\":%.1f,\"down_bit_s\":%.1f,\"notice_bit_s\":%.1f,",
              Mean(result.up_bytes) * 8 / result.seconds,
              Mean(result.down_bytes) * 8 / result.seconds, bits_per_s(result.notice_bytes));
  std::printf("\"near_notice_bit_s\":%.1f,\"told_bit_s\":%.1f}\n",
              bits_per_s(result.near_notice_bytes), bits_per_s(result.told_bytes));
}

/// As many connections as the system lets this user open.
void RaiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

int Run(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_fleet_load --zone ZONE --port PORT --credentials DIR [FLAGS]",
      "Drives many vehicles through a city, each with a connection of its own to a running zone's "
      "broker, and prints one line of JSON. The broker knows the logins car-0, car-1, ... and "
      "surveyor-0, ... surveyor-23.",
      0,
      {{"zone", "NAME", "the zone"},
       {"port", "PORT", "the broker's port on this machine"},
       {"credentials", "DIR", "folder of the logins' passwords"},
       {"vehicles", "N", "vehicles that drive (100)"},
       {"first-vehicle", "N", "number of the first one's login (0)"},
       {"hazards", "N", "hazards in the city at first (10000)"},
       {"surveyed", "", "the zone has them on its map, by an earlier run with the same --hazards"},
       {"births", "R", "new hazards per second, and as many that end (2)"},
       {"to-all", "", "vehicles hear of all hazards of the zone, not of the cells around them"},
       {"web-port", "PORT", "the map's port on this machine, for viewers"},
       {"viewers", "N", "clients of the map's live stream (0)"},
       {"slow-viewers", "N", "of them, that hardly take what they are told (0)"},
       {"trace", "FILE", "how the vehicles move; without it they turn at random"},
       {"warm-up", "SECONDS", "driven before the measurement (20)"},
       {"seconds", "SECONDS", "measured (60)"}});
  if (!line.Parse(argc, argv)) return 0;
  CityFleet::Config config;
  config.zone = line.Text("zone", "");
  config.credentials = line.Text("credentials", "");
  if (config.zone.empty() || config.credentials.empty()) {
    throw Error("--zone and --credentials are needed, see --help");
  }
  config.mqtt.port = line.Whole("port", 1883, 1, 65535);
  config.mqtt.client_id = "fleet";
  config.mqtt.clean_start = true;
  config.mqtt.session_expiry_s = 0;
  config.mqtt.keepalive_s = 60;
  config.mqtt.max_inflight = 1000;
  config.first_vehicle = static_cast<std::size_t>(line.Whole("first-vehicle", 0, 0, 1000000));
  config.hazards = static_cast<std::size_t>(line.Whole("hazards", 10000, 1, 40000));
  config.births_per_s = line.Number("births", 2, 0, 1000);
  config.by_cells = !line.Has("to-all");
  const double warm_up_s = line.Number("warm-up", 20, 0, 600);
  const double seconds = line.Number("seconds", 60, 1, 3600);
  Movement::Config drive;
  drive.vehicles = static_cast<std::size_t>(line.Whole("vehicles", 100, 1, 30000));
  drive.seconds = static_cast<std::size_t>(warm_up_s + seconds) + 1;
  MapViewers::Config crowd;
  crowd.port = line.Whole("web-port", 8080, 1, 65535);
  crowd.viewers = static_cast<std::size_t>(line.Whole("viewers", 0, 0, 20000));
  crowd.slow = static_cast<std::size_t>(line.Whole("slow-viewers", 0, 0, 20000));
  if (crowd.slow > crowd.viewers) {
    throw Error("--slow-viewers is " + std::to_string(crowd.slow) +
                ", accepted are 0 to --viewers");
  }
  RaiseFileLimit();
  const std::string trace = line.Text("trace", "");
  CityFleet fleet(config, trace.empty() ? Movement(drive) : Movement(drive, trace));
  if (!line.Has("surveyed")) fleet.Survey();
  fleet.Connect();
  std::optional<MapViewers> viewers;
  if (crowd.viewers > 0) viewers.emplace(crowd);
  const CityFleet::Result result = fleet.Drive(warm_up_s, seconds, [&viewers] {
    if (viewers) viewers->StartCounting();
  });
  std::printf("{");
  if (viewers) PrintViewers(crowd, viewers->End(), result);
  PrintFleetJson(drive.vehicles, result);
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_fleet_load", argc, argv, livemap::bench::Run);
}
