#pragma once

#include <string>

#include "vehicle/speech/voice.h"

namespace livemap::vehicle {

/// Two beeps by ALSA's player instead of words, for vehicles without speech synthesis. The player
/// is a process of its own: a sound device that hangs holds nothing up but it.
class ToneVoice : public Voice {
 public:
  /// `player` reads a WAV file from its standard input; found by PATH.
  explicit ToneVoice(std::string player = "aplay");

  std::string name() const override { return "tone"; }
  /// Plays silence: without a sound device the player ends with an error.
  void Open(const MustStop& must_stop) override;
  void Say(const std::string& sentence, const MustStop& must_stop) override;

 private:
  void Play(const std::string& wav, const MustStop& must_stop) const;

  const std::string player_;
};

}  // namespace livemap::vehicle
