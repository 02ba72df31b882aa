#pragma once

#include <string>

#include "ros/parameters/shared/parameter_reader.h"
#include "vehicle/speech/speaker.h"
#include "vehicle/speech/speechd_voice.h"

namespace livemap::ros_io {

/// Defaults of the driver_speech nodelet; the reader states their meanings.
struct DriverSpeechConfig {
  std::string catalogue;        ///< Path of the hazard classes; empty: the package's.
  std::string language = "en";  ///< Name of a file of config/languages.
  std::string language_file;    ///< Its path instead; empty: by `language`.
  bool use_words = true;        ///< Else the tone alone.
  std::string player = "aplay";
  vehicle::SpeechdVoice::Config speech;  ///< But for the language, which the file tells.
  vehicle::Speaker::Config speaker;
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
DriverSpeechConfig ReadDriverSpeechConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
