#include "ros/parameters/driver_speech_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {

DriverSpeechConfig ReadDriverSpeechConfig(ParameterReader& parameters) {
  DriverSpeechConfig config;
  parameters.Section("What is said");
  parameters.Read("language", config.language,
                  "Name of the language's file in config/languages of the package, without its "
                  "ending. vehicle.launch sets it by the argument `language`.");
  parameters.Read("language_file", config.language_file,
                  "Path of a file of your own in the same form. Empty: that of `language`.");
  parameters.Read(
      "catalogue", config.catalogue,
      "Path of the hazard classes, each of which the language's file must name. Empty: "
      "config/hazards.yaml of the package. vehicle.launch sets it by the argument `hazards`.");
  parameters.Section("How it is said");
  parameters.ReadChoice<bool>("voice", config.use_words, {{"speech", true}, {"tone", false}},
                              "speech (sentences by speech-dispatcher, and a tone while it says "
                              "nothing) or tone (a tone alone).");
  parameters.Read("rate", config.speech.rate, {-100, 100},
                  "Speed of speech, from the slowest to the fastest.");
  parameters.Read("volume", config.speech.volume, {-100, 100},
                  "Loudness of speech, from silent to the loudest.");
  parameters.Read("player", config.player,
                  "Program that plays the tone; it reads a WAV file from its standard input.");
  parameters.Read(
      "begin_timeout_s", config.speech.begin_timeout_s, {0.2, 30},
      "A sentence that has not begun after this time is not heard: the tone takes over.", "s");
  parameters.Section("When it is said");
  parameters.Read("max_waiting", config.speaker.queue.max_waiting, {1, 100},
                  "Number of alerts that wait for others to be said. The least urgent go first.");
  parameters.Read("max_wait_s", config.speaker.queue.max_wait_s, {0.1, 60},
                  "An alert that has waited for longer is not said.", "s");
  parameters.Read("min_left_s", config.speaker.queue.min_left_s, {0, 10},
                  "An alert is not said when its hazard is reached sooner than this.", "s");
  parameters.Read("retry_s", config.speaker.retry_s, {0.1, 3600},
                  "A voice that was silent is tried again when nothing was to be said for so long.",
                  "s");
  parameters.Section("Period of the diagnostics");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
