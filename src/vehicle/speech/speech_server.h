#pragma once

#include <string>

#include "vehicle/speech/voice.h"

namespace livemap::vehicle {

/// What the socket of a speech-dispatcher has behind it.
enum class SpeechServer {
  kAnswers,  ///< A server that answers.
  kAbsent,   ///< Nobody.
  kSilent,   ///< Somebody who accepts, and says nothing in time: stopped, or hung.
};

/// Asks the server at a local socket for its farewell (QUIT of SSIP, the Speech Synthesis Interface
/// Protocol), for at most `timeout_s`, less where it must stop. libspeechd itself waits for ever.
SpeechServer AskSpeechServer(const std::string& socket_path, double timeout_s,
                             const Voice::MustStop& must_stop);

/// Starts one there, as libspeechd would, and waits until it has gone to the background, at most
/// `timeout_s`. What became of it AskSpeechServer tells.
void StartSpeechServer(const std::string& socket_path, double timeout_s,
                       const Voice::MustStop& must_stop);

}  // namespace livemap::vehicle
