// livemap_evaluate_recordings: how well the clocks of recorders and receivers are brought together.

#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <vector>

#include "evaluation/quantile.h"
#include "recordings/clock/clock_offset.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"
#include "tools/evaluation/simulated_recording.h"

namespace livemap::tools {
namespace {

constexpr char kRecordingsName[] = "livemap_evaluate_recordings";
/// What a drive's use asks for.
constexpr double kGoodOffsetS = 0.15;

struct RecordingTrial {
  std::uint64_t seed = 0;
  double offset_s = 0;
  bool stops = false, turns = false;
  std::string receiver;
  recordings::ClockOffsetAnswer answer;

  bool eventful() const { return stops || turns; }
  bool told() const { return answer.offset.has_value(); }
  double error_s() const { return answer.offset->seconds - offset_s; }
  bool good() const { return told() && std::abs(error_s()) <= kGoodOffsetS; }
};

RecordingTrial TryRecording(std::uint64_t seed, double seconds, int threads) {
  const SimulatedRecording recording = SimulateRecording(seed, seconds, threads);
  RecordingTrial trial{
      seed, recording.offset_s, recording.stops, recording.turns, recording.receiver, {}};
  trial.answer = recordings::FindClockOffset(recording.picture, recording.track);
  return trial;
}

nlohmann::ordered_json TrialReport(const RecordingTrial& trial) {
  nlohmann::ordered_json json;
  json["seed"] = trial.seed;
  json["receiver"] = trial.receiver;
  json["stops"] = trial.stops;
  json["turns"] = trial.turns;
  json["offset_s"] = trial.offset_s;
  json["found_s"] = nullptr;
  json["sigma_s"] = nullptr;
  json["error_s"] = nullptr;
  json["reason"] = nullptr;
  if (!trial.told()) {
    json["reason"] = trial.answer.reason;
    return json;
  }
  const recordings::ClockOffset& found = *trial.answer.offset;
  json["found_s"] = found.seconds;
  json["sigma_s"] = found.sigma_s;
  json["error_s"] = trial.error_s();
  json["turn_correlation"] = found.turn_correlation;
  json["speed_correlation"] = found.speed_correlation;
  return json;
}

nlohmann::ordered_json SummaryReport(const std::vector<RecordingTrial>& trials) {
  std::size_t eventful = 0, told = 0, good = 0, uneventful_told = 0, wrong = 0, within = 0;
  std::vector<double> errors;
  for (const RecordingTrial& trial : trials) {
    eventful += trial.eventful() ? 1U : 0U;
    wrong += trial.told() && !trial.good() ? 1U : 0U;
    if (!trial.eventful()) {
      uneventful_told += trial.told() ? 1U : 0U;
      continue;
    }
    good += trial.good() ? 1U : 0U;
    if (!trial.told()) continue;
    ++told;
    errors.push_back(std::abs(trial.error_s()));
    within += errors.back() <= 2 * trial.answer.offset->sigma_s ? 1U : 0U;
  }
  nlohmann::ordered_json json;
  json["recordings"] = trials.size();
  json["with_stop_or_turn"] = eventful;
  json["told"] = told;
  json["within_0_15_s"] = good;
  json["told_and_wrong"] = wrong;
  json["without_stop_or_turn"] = trials.size() - eventful;
  json["told_without_stop_or_turn"] = uneventful_told;
  for (const char* key :
       {"share_within_0_15_s", "error_s_median", "error_s_p90", "within_2_sigma", "reason"}) {
    json[key] = nullptr;
  }
  if (eventful > 0) {
    json["share_within_0_15_s"] = static_cast<double>(good) / static_cast<double>(eventful);
  }
  if (errors.empty()) {
    json["reason"] = "no offset of a recording with a stop or a turn was told";
    return json;
  }
  json["error_s_median"] = evaluation::Quantile(errors, 0.5);
  json["error_s_p90"] = evaluation::Quantile(errors, 0.9);
  json["within_2_sigma"] = static_cast<double>(within) / static_cast<double>(told);
  return json;
}

void PrintTable(const nlohmann::ordered_json& report) {
  for (const auto& [key, value] : report.items()) {
    if (key == "trials") continue;
    std::cout << key << std::string(key.size() < 28 ? 28 - key.size() : 1, ' ') << value << "\n";
  }
  for (const auto& trial : report["trials"]) std::cout << trial.dump() << "\n";
}

int EvaluateRecordings(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_recordings [FLAGS]",
      "Films drives through simulated streets with a recorder and a receiver whose clocks differ "
      "by\n"
      "up to 20 s, and finds out by how much. docs/reference/measures.md defines the figures.",
      0,
      {{"json", "", "one line of JSON instead of a table"},
       {"first", "N", "seed of the first recording, default 1"},
       {"recordings", "N", "how many, default 10"},
       {"seconds", "S", "length of each, default 60"},
       {"threads", "N", "that render, default 2"}});
  if (!line.Parse(argc, argv)) return 0;
  const std::uint64_t first = line.Seed("first", 1);
  const int count = line.Whole("recordings", 10, 1, 10000);
  const double seconds = line.Number("seconds", 60, 20, 3600);
  const int threads = line.Whole("threads", 2, 1, 64);
  std::vector<RecordingTrial> trials;
  Progress progress("recording", static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    trials.push_back(TryRecording(first + static_cast<std::uint64_t>(i), seconds, threads));
    progress.At(trials.size());
  }
  nlohmann::ordered_json report = SummaryReport(trials);
  report["trials"] = nlohmann::ordered_json::array();
  for (const RecordingTrial& trial : trials) report["trials"].push_back(TrialReport(trial));
  if (line.Has("json")) {
    std::cout << report.dump() << "\n";
  } else {
    PrintTable(report);
  }
  if (report["reason"].is_null()) return 0;
  SayNothingMeasured(kRecordingsName, report["reason"].get<std::string>());
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram(livemap::tools::kRecordingsName, argc, argv,
                                    livemap::tools::EvaluateRecordings);
}
