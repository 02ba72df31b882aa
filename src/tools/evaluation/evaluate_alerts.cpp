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

/// Figures of all drives and of each scenario.
struct TrafficFigures {
  AlertFigures all;
  std::map<std::string, AlertFigures> by_scenario;

  void Add(const std::string& scenario, const AlertFigures& figures) {
    by_scenario[scenario].Add(figures);
    all.Add(figures);
  }
};

nlohmann::ordered_json ToJson(const TrafficFigures& figures,
                              const std::vector<std::string>& scenarios) {
  nlohmann::ordered_json json = ToJson(figures.all);
  for (const std::string& scenario : scenarios) {
    json["scenarios"][scenario] = ToJson(figures.by_scenario.at(scenario));
  }
  return json;
}

void PrintTable(const TrafficFigures& figures, const std::vector<std::string>& scenarios) {
  std::cout << HeadOfAlertTable();
  for (const std::string& scenario : scenarios) {
    std::cout << ToRow(scenario, figures.by_scenario.at(scenario));
  }
  std::cout << ToRow("all", figures.all);
}

/// With a map of the streets, without, or both, one after the other.
std::vector<bool> ChosenStreets(const std::string& text) {
  if (text == "both") return {false, true};
  if (text == "true" || text == "false") return {text == "true"};
  throw Error("--streets is '" + text + "', accepted are both, true and false");
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
       {"streets", "WORD",
        "true: the vehicle has a map of the streets; false: it has not; default both"},
       {"per-km", "X", "hazards per kilometre of lane, default 1"},
       {"fixes-per-s", "X", "of the receiver, default 5; 1 to 10"},
       {"fix-noise-m", "X", "new at every fix, standard deviation per axis, m, default 0.4"},
       {"fix-bias-m", "X", "slow error of the fixes, the same, m, default 1.5"},
       {"velocity-noise-mps", "X",
        "of the velocity that the receiver measures with each fix, standard deviation per axis,\n"
        "m/s, default 0.15; 0: it measures none"},
       {"place-sigma-m", "X", "of the hazards on the zone's map, the same, m, default 1"},
       {"absent", "X", "share of the streets that the map does not have, default 0.02"},
       {"course-noise-deg", "X",
        "of the direction in which a hazard is passed, as the zone tells it, standard deviation,\n"
        "degrees, default 5"},
       {"no-course-share", "X",
        "share of the hazards of which the zone tells no direction, default 0.15; 1: of all"},
       {"wrong-course-share", "X",
        "share of the hazards within 20 m of a junction that a vehicle of the crossing street has\n"
        "reported, default 0.2; elsewhere a tenth of it have any direction"},
       {"oncoming-share", "X",
        "share of the hazards on streets driven in both directions that a vehicle on the oncoming\n"
        "lane has reported, default 0.2"},
       {"trails", "N",
        "vehicles of each hazard whose trails past it the zone tells, default 2; 0 to 3"},
       {"no-trail-share", "X",
        "share of these vehicles of which the zone knows no trail, default 0.15"},
       {"hazards", "FILE", "catalogue of hazard classes; default: every class has rank 2"}});
  if (!line.Parse(argc, argv)) return 0;
  const std::vector<std::string> scenarios = ChosenScenarios(line.Text("scenario", ""));
  const std::vector<bool> with_streets = ChosenStreets(line.Text("streets", "both"));
  const int drives = line.Whole("drives", 20, 1, 100000);
  const std::uint64_t seed = line.Seed("seed", 2);
  const double per_km = line.Number("per-km", 1, 0.001, 100);
  AlertTrial trial;
  trial.fixes_per_s = line.Number("fixes-per-s", trial.fixes_per_s, 1, 10);
  trial.receiver.white_sigma_m = line.Number("fix-noise-m", trial.receiver.white_sigma_m, 0, 100);
  trial.receiver.bias_sigma_m = line.Number("fix-bias-m", trial.receiver.bias_sigma_m, 0, 100);
  trial.velocity_sigma_mps = line.Number("velocity-noise-mps", trial.velocity_sigma_mps, 0, 100);
  trial.place_sigma_m = line.Number("place-sigma-m", trial.place_sigma_m, 0, 100);
  trial.map_errors.absent_share = line.Number("absent", trial.map_errors.absent_share, 0, 1);
  CourseErrors& courses = trial.course_errors;
  courses.sigma_deg = line.Number("course-noise-deg", courses.sigma_deg, 0, 180);
  courses.none_share = line.Number("no-course-share", courses.none_share, 0, 1);
  courses.wrong_share = line.Number("wrong-course-share", courses.wrong_share, 0, 1);
  courses.oncoming_share = line.Number("oncoming-share", courses.oncoming_share, 0, 1);
  TrailErrors& trails = trial.trail_errors;
  trails.trails = static_cast<std::size_t>(line.Whole("trails", 2, 0, 3));
  trails.none_share = line.Number("no-trail-share", trails.none_share, 0, 1);
  trails.bias_m = trial.receiver.bias_sigma_m;
  trails.scatter_m = trial.receiver.white_sigma_m;
  trails.oncoming_share = courses.oncoming_share;
  const std::string hazards = line.Text("hazards", "");
  const protocol::HazardCatalogue catalogue =
      hazards.empty() ? protocol::HazardCatalogue() : protocol::HazardCatalogue::Load(hazards);

  Progress progress("drives", scenarios.size() * static_cast<std::size_t>(drives));
  std::map<bool, TrafficFigures> measured;
  std::size_t done = 0;
  for (const std::string& scenario : scenarios) {
    for (int i = 0; i < drives; ++i) {
      trial.seed = seed + 2 * static_cast<std::uint64_t>(i);
      const TrafficDrive drive = MakeTrafficDrive(scenario, per_km, trial.seed);
      for (const bool streets : with_streets) {
        trial.streets = streets;
        measured[streets].Add(scenario,
                              TryAlerts(drive, trial, vehicle::DriverAlerts::Config(), catalogue));
      }
      progress.At(++done);
    }
  }
  const bool nothing = measured.begin()->second.all.on_way == 0;
  const std::string why = "no hazard lies on the way of any drive: more --drives or --per-km";
  if (line.Has("json")) {
    nlohmann::ordered_json json;
    if (measured.count(false) > 0) json = ToJson(measured[false], scenarios);
    if (measured.count(true) > 0) json["with_streets"] = ToJson(measured[true], scenarios);
    if (nothing) json["reason"] = why;
    std::cout << json.dump() << "\n";
  } else {
    for (const auto& [streets, figures] : measured) {
      std::cout << (streets ? "with a map of the streets\n" : "by the course alone\n");
      PrintTable(figures, scenarios);
    }
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
