#pragma once

#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "vehicle/speech/speech_queue.h"
#include "vehicle/speech/spoken_language.h"
#include "vehicle/speech/voice.h"

namespace livemap::vehicle {

/// Lets the driver hear alerts, on a thread of its own: nobody waits for a sound. Each sentence is
/// said by the first of its voices that works; one that was silent is opened again when nothing was
/// to be said for `retry_s`.
/// Thread-safe.
class Speaker {
 public:
  struct Config {
    SpeechQueue::Config queue;
    double retry_s = 10;
  };
  struct State {
    SpeechQueue::Counters counters;
    std::size_t waiting = 0;
    std::string voice;                ///< The one that works; empty: none.
    std::vector<std::string> silent;  ///< Of each voice before it, why nothing is heard of it.
    bool is_known = false;            ///< The voices have been tried.
  };

  /// Starts the thread, which opens the voices; the first is the one that the driver should hear.
  Speaker(const Config& config, SpokenLanguage language,
          std::vector<std::unique_ptr<Voice>> voices);
  /// Ends what is being said.
  ~Speaker();
  Speaker(const Speaker&) = delete;
  Speaker& operator=(const Speaker&) = delete;

  /// Any alert as it comes.
  void Take(const HazardAlert& alert);
  State state() const;

 private:
  struct Source {
    std::unique_ptr<Voice> voice;
    std::string error;  ///< Why it was silent; empty: it works, or was not tried yet.
    bool is_open = false;
  };

  void Work();
  /// Opens those that are due, up to the first that works.
  void OpenVoices();
  bool Open(Source& source);
  /// The next alert; none at the end.
  std::optional<HazardAlert> Await();
  SpeechQueue::End Say(const std::string& sentence);
  void Publish();
  bool IsClosed();
  bool MustStop();

  const Config config_;
  const SpokenLanguage language_;
  std::vector<Source> sources_;  ///< The thread's own, but for Abort().

  mutable Mutex mutex_;
  ConditionVariable changed_;
  SpeechQueue queue_ GUARDED_BY(mutex_);
  bool stop_ GUARDED_BY(mutex_) = false;  ///< What is being said.
  bool closed_ GUARDED_BY(mutex_) = false;
  bool ended_ GUARDED_BY(mutex_) = false;  ///< The thread's work.
  State voices_ GUARDED_BY(mutex_);        ///< What state() says of the voices.
  std::thread thread_;
};

}  // namespace livemap::vehicle
