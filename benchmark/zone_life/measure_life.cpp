// Simulates weeks of a town's hazards and vehicles and prints what the zone made of them, as JSON.
#include <cstdio>
#include <map>

#include "common/error.h"
#include "tools/common/command_line.h"
#include "zone_life/study.h"

namespace livemap::bench {
namespace {

void PrintClass(const std::string& name, const ClassFigures& figures, bool last) {
  std::printf(
      "  \"%s\": {\"appeared\": %llu, \"told\": %llu, \"noticeable\": %llu, \"untold\": %llu, "
      "\"dropped\": %llu, \"false_told\": %llu, \"wrong_s\": %.1f, \"missing_s\": %.1f, "
      "\"learned_life_s\": %.1f, \"true_life_s\": %.1f, \"prior_life_s\": %.1f, \"minutes\": [",
      name.c_str(), static_cast<unsigned long long>(figures.appeared),
      static_cast<unsigned long long>(figures.told),
      static_cast<unsigned long long>(figures.noticeable),
      static_cast<unsigned long long>(figures.untold),
      static_cast<unsigned long long>(figures.dropped),
      static_cast<unsigned long long>(figures.false_told), figures.wrong_s, figures.missing_s,
      figures.learned_life_s, figures.true_life_s, figures.prior_life_s);
  const char* comma = "";
  for (const double minutes : figures.minutes_until_gone) {
    std::printf("%s%.2f", comma, minutes);
    comma = ", ";
  }
  std::printf("]}%s\n", last ? "" : ",");
}

void Print(const StudyConfig& config, const StudyFigures& figures) {
  std::printf(
      "{\"seed\": %llu, \"days\": %.0f, \"all_days\": %d, \"vehicles\": %zu, "
      "\"polls\": %llu, \"poll_bytes\": %.0f, \"traversals\": %llu, "
      "\"over_allowance\": %llu, \"hostile\": %llu, \"hostile_suspects\": %llu, "
      "\"honest_suspects\": %llu, \"classes\": {\n",
      static_cast<unsigned long long>(config.seed), figures.measured_days, config.days,
      config.vehicles, static_cast<unsigned long long>(figures.polls), figures.poll_bytes,
      static_cast<unsigned long long>(figures.traversals),
      static_cast<unsigned long long>(figures.refused_by_allowance),
      static_cast<unsigned long long>(figures.hostile),
      static_cast<unsigned long long>(figures.hostile_suspects),
      static_cast<unsigned long long>(figures.honest_suspects));
  std::size_t left = figures.classes.size();
  for (const auto& [name, of_class] : figures.classes) PrintClass(name, of_class, --left == 0);
  std::printf("}}\n");
}

PollingRule::Kind KindOf(const std::string& name) {
  const std::map<std::string, PollingRule::Kind> kinds = {
      {"worth", PollingRule::Kind::kWorth},
      {"interval", PollingRule::Kind::kInterval},
      {"life", PollingRule::Kind::kLife},
      {"insist", PollingRule::Kind::kInsist},
      {"never", PollingRule::Kind::kNobody}};
  const auto found = kinds.find(name);
  if (found != kinds.end()) return found->second;
  throw Error("--polls is '" + name + "', accepted are: worth, interval, life, insist, never");
}

int Run(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_measure_life CATALOGUE [FLAGS]",
      "Simulates the life of a town's hazards on the zone's map; prints JSON.", 1,
      {{"seed", "N", "of world, traffic and cameras (1)"},
       {"days", "DAYS", "simulated, the first 7 and the last 2 not counted (35)"},
       {"vehicles", "N", "of the fleet (400)"},
       {"polls", "RULE", "worth, interval, life, insist or never (worth)"},
       {"value", "X", "price or interval in seconds, or share of a life (120)"},
       {"bytes-per-hour", "BYTES", "budget of polls by worth (1e9)"},
       {"hostile", "SHARE", "of the vehicles, 0 to 1 (0)"},
       {"telling", "RULE",
        "life, alike (as life, but every vehicle is believed alike) or "
        "count (life)"}});
  if (!line.Parse(argc, argv)) return 0;
  StudyConfig config;
  config.seed = line.Seed("seed", 1);
  config.days = line.Whole("days", 35, 10, 1000);
  config.vehicles = static_cast<std::size_t>(line.Whole("vehicles", 400, 1, 100000));
  config.polling.kind = KindOf(line.Text("polls", "worth"));
  config.polling.value = line.Number("value", 120, 1e-6, 1e9);
  config.polling.bytes_per_hour = line.Number("bytes-per-hour", 1e9, 1, 1e12);
  config.malicious_share = line.Number("hostile", 0, 0, 1);
  const std::string telling = line.Text("telling", "life");
  if (telling != "life" && telling != "alike" && telling != "count") {
    throw Error("--telling is '" + telling + "', accepted are: life, alike, count");
  }
  config.telling = telling == "count" ? TellingRule::kCount : TellingRule::kLife;
  config.trust = telling == "life";
  Print(config, RunStudy(config, protocol::HazardCatalogue::Load(line.Positional(0))));
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_measure_life", argc, argv, livemap::bench::Run);
}
