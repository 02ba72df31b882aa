#pragma once

#include <memory>
#include <string>

#include "common/mutex.h"
#include "vehicle/speech/voice.h"

namespace livemap::vehicle {

/// Speech by speech-dispatcher, which has synthesizers such as espeak-ng and reaches the sound
/// device (https://freebsoft.org/speechd). It is started where it does not run. It tells when a
/// sentence begins and ends; one that does not begin in time was not heard.
class SpeechdVoice : public Voice {
 public:
  struct Config {
    std::string language = "en";  ///< BCP 47.
    int rate = 0;                 ///< -100 the slowest to 100 the fastest.
    int volume = 100;             ///< -100 silent to 100 the loudest.
    double begin_timeout_s = 3;
    double end_timeout_s = 15;    ///< From its begin.
    double answer_timeout_s = 3;  ///< Of the server, and of its start.
  };

  explicit SpeechdVoice(const Config& config);
  ~SpeechdVoice() override;

  std::string name() const override { return "speech"; }
  /// Connects, and says something at volume -100: without a sound device it does not end.
  void Open(const MustStop& must_stop) override;
  void Say(const std::string& sentence, const MustStop& must_stop) override;
  void Abort() override;

 private:
  class Connection;

  void Connect(const MustStop& must_stop);

  const Config config_;
  std::unique_ptr<Connection> connection_;
  Mutex mutex_;
  int socket_ GUARDED_BY(mutex_) = -1;  ///< Of the connection; -1: there is none.
};

}  // namespace livemap::vehicle
