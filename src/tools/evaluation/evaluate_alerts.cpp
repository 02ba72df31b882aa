// livemap_evaluate_alerts: which hazards a driver is warned of, in simulated traffic.

#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/error.h"
#include "protocol/hazard_catalogue.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"
#include "tools/evaluation/alert_traffic.h"
#include "tools/evaluation/alert_trial.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::tools {
namespace {

/// Names of scenarios, separated by commas; empty: all.
std::vector<std::string> ChosenScenarios(const std::string& text) {
  if (text.empty()) return TrafficScenarios();
  std::vector<std::string> chosen;
  std::string accepted;
  for (const std::string& name : TrafficScenarios()) accepted += " " + name;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    const auto& all = TrafficScenarios();
    if (std::find(all.begin(), all.end(), name) == all.end()) {
      throw Error("--scenario is '" + text + "', accepted are, separated by commas:" + accepted);
    }
    chosen.push_back(name);
    begin = end + 1;
  }
  return chosen;
}

int EvaluateAlerts(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_alerts [FLAGS]",
      "Drives simulated vehicles through simulated streets with hazards, and compares of which "
      "ones\n"
      "their drivers are warned with which ones lie on their way. docs/reference/measures.md "
      "defines\n"
      "the figures.",
      0,
      {{"json", "", "one line of JSON instead of a table"},
       {"scenario", "NAMES",
        "parallel, opposite, crossings, bridges, curves, roundabouts, turns, stops, separated by\n"
        "commas; default all"},
       {"drives", "N", "per scenario, default 20"},
       {"seed", "N", "of the first drive, default 2; the others follow in steps of 2"},
       {"per-km", "X", "hazards per kilometre of lane, default 1"},
       {"fixes-per-s", "X", "of the receiver, default 5; 1 to 10"},
       {"fix-noise-m", "X", "new at every fix, standard deviation per axis, m, default 0.4"},
       {"fix-bias-m", "X", "slow error of the fixes, the same, m, default 1.5"},
       {"place-sigma-m", "X", "of the hazards on the zone's map, the same, m, default 1"},
       {"hazards", "FILE", "catalogue of hazard classes; default: every class has rank 2"}});
  if (!line.Parse(argc, argv)) return 0;
  const std::vector<std::string> scenarios = ChosenScenarios(line.Text("scenario", ""));
  const int drives = line.Whole("drives", 20, 1, 100000);
  const std::uint64_t seed = line.Seed("seed", 2);
  const double per_km = line.Number("per-km", 1, 0.001, 100);
  AlertTrial trial;
  trial.fixes_per_s = line.Number("fixes-per-s", trial.fixes_per_s, 1, 10);
  trial.receiver.white_sigma_m = line.Number("fix-noise-m", trial.receiver.white_sigma_m, 0, 100);
  trial.receiver.bias_sigma_m = line.Number("fix-bias-m", trial.receiver.bias_sigma_m, 0, 100);
  trial.place_sigma_m = line.Number("place-sigma-m", trial.place_sigma_m, 0, 100);
  const std::string hazards = line.Text("hazards", "");
  const protocol::HazardCatalogue catalogue =
      hazards.empty() ? protocol::HazardCatalogue() : protocol::HazardCatalogue::Load(hazards);

  Progress progress("drives", scenarios.size() * static_cast<std::size_t>(drives));
  std::map<std::string, AlertFigures> by_scenario;
  AlertFigures all;
  std::size_t done = 0;
  for (const std::string& scenario : scenarios) {
    for (int i = 0; i < drives; ++i) {
      trial.seed = seed + 2 * static_cast<std::uint64_t>(i);
      const TrafficDrive drive = MakeTrafficDrive(scenario, per_km, trial.seed);
      const AlertFigures figures =
          TryAlerts(drive, trial, vehicle::DriverAlerts::Config(), catalogue);
      by_scenario[scenario].Add(figures);
      all.Add(figures);
      progress.At(++done);
    }
  }
  const bool nothing = all.on_way == 0;
  const std::string why = "no hazard lies on the way of any drive: more --drives or --per-km";
  if (line.Has("json")) {
    nlohmann::ordered_json json = ToJson(all);
    for (const std::string& scenario : scenarios) {
      json["scenarios"][scenario] = ToJson(by_scenario[scenario]);
    }
    if (nothing) json["reason"] = why;
    std::cout << json.dump() << "\n";
  } else {
    std::cout << HeadOfAlertTable();
    for (const std::string& scenario : scenarios) {
      std::cout << ToRow(scenario, by_scenario[scenario]);
    }
    std::cout << ToRow("all", all);
  }
  if (!nothing) return 0;
  SayNothingMeasured("livemap_evaluate_alerts", why);
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_alerts", argc, argv,
                                    livemap::tools::EvaluateAlerts);
}
