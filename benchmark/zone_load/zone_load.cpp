// What ./livemap bench load measures with: a fleet's reports through a zone's broker.
#include <algorithm>
#include <cstdio>
#include <string>

#include "common/error.h"
#include "evaluation/quantile.h"
#include "tools/common/command_line.h"
#include "zone_load/fleet.h"

namespace livemap::bench {
namespace {

void PrintQuantiles(const char* name, std::vector<double> values) {
  for (const int percent : {50, 95, 99}) {
    if (values.empty()) {
      std::printf("\"%s_ms_p%d\":null,", name, percent);
    } else {
      std::printf("\"%s_ms_p%d\":%.2f,", name, percent,
                  evaluation::Quantile(values, percent / 100.0));
    }
  }
}

void PrintJson(const Fleet::Config& config, Fleet::Result result) {
  std::printf("{\"vehicles\":%u,\"rate\":%.1f,\"seconds\":%.3f,\"sent\":%llu,\"committed\":%llu,",
              config.vehicles, config.rate, result.seconds,
              static_cast<unsigned long long>(result.sent),
              static_cast<unsigned long long>(result.committed));
  std::printf("\"committed_per_s\":%.1f,\"refused\":%llu,\"resent\":%llu,\"behind\":%llu,",
              static_cast<double>(result.committed) / result.seconds,
              static_cast<unsigned long long>(result.refused),
              static_cast<unsigned long long>(result.resent),
              static_cast<unsigned long long>(result.behind));
  PrintQuantiles("receipt", result.receipt_ms);
  const std::size_t notices = result.notice_ms.size();
  const std::uint32_t next_step = result.next_step;
  PrintQuantiles("notice", std::move(result.notice_ms));
  std::printf("\"notices\":%zu,\"next_step\":%u}\n", notices, next_step);
}

int Run(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_zone_load --zone ZONE --port PORT --credentials DIR [FLAGS]",
      "Sends reports as many vehicles to a running zone over its broker and prints one "
      "line of JSON. The broker knows the logins car-0, car-1, ... and listener.",
      0,
      {{"zone", "NAME", "the zone"},
       {"port", "PORT", "the broker's port on this machine"},
       {"credentials", "DIR", "folder of the logins' passwords"},
       {"vehicles", "N", "vehicles that report (20)"},
       {"rate", "R", "reports per second of all; 0: as fast as they are answered (0)"},
       {"window", "N", "reports of one vehicle waiting for a receipt (50)"},
       {"first-step", "N", "begin where an earlier run's next_step was (0)"},
       {"warm-up", "SECONDS", "not counted (2)"},
       {"seconds", "SECONDS", "counted (10)"}});
  if (!line.Parse(argc, argv)) return 0;
  Fleet::Config config;
  config.zone = line.Text("zone", "");
  config.credentials = line.Text("credentials", "");
  if (config.zone.empty() || config.credentials.empty()) {
    throw Error("--zone and --credentials are needed, see --help");
  }
  config.port = line.Whole("port", 1883, 1, 65535);
  config.vehicles = static_cast<std::uint32_t>(line.Whole("vehicles", 20, 1, 1000));
  config.window = static_cast<std::uint32_t>(line.Whole("window", 50, 1, 10000));
  config.first_step = static_cast<std::uint32_t>(line.Whole("first-step", 0, 0, 10000000));
  config.rate = line.Number("rate", 0, 0, 1e6);
  const double warm_up_s = line.Number("warm-up", 2, 0, 600);
  const double seconds = line.Number("seconds", 10, 0.1, 600);
  PrintJson(config, Fleet(config).Run(warm_up_s, seconds));
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_zone_load", argc, argv, livemap::bench::Run);
}
