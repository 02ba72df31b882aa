#include "vehicle/speech/speechd_voice.h"

#include <libspeechd.h>
#include <sys/socket.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <thread>

#include "common/clock.h"
#include "common/error.h"
#include "common/mutex.h"
#include "vehicle/speech/speech_server.h"

namespace livemap::vehicle {
namespace {

constexpr std::chrono::milliseconds kLookAgain{10};
constexpr double kCancelTimeoutS = 1;

/// How far the messages of each client have come. libspeechd's callbacks know nothing but numbers;
/// those of messages only grow.
class SpeechProgress {
 public:
  struct Of {
    std::size_t begun = 0;
    std::size_t ended = 0;
  };

  static SpeechProgress& Instance() {
    static SpeechProgress instance;
    return instance;
  }
  void Begin(std::size_t client, std::size_t message) {
    const MutexLock lock(mutex_);
    of_[client].begun = message;
  }
  void End(std::size_t client, std::size_t message) {
    const MutexLock lock(mutex_);
    of_[client] = {message, message};
  }
  Of Get(std::size_t client) {
    const MutexLock lock(mutex_);
    return of_[client];
  }
  void Forget(std::size_t client) {
    const MutexLock lock(mutex_);
    of_.erase(client);
  }

 private:
  Mutex mutex_;
  std::map<std::size_t, Of> of_ GUARDED_BY(mutex_);
};

void OnSpeechBegin(std::size_t message, std::size_t client, SPDNotificationType) {
  SpeechProgress::Instance().Begin(client, message);
}

void OnSpeechEnd(std::size_t message, std::size_t client, SPDNotificationType) {
  SpeechProgress::Instance().End(client, message);
}

double SpeechNowS() { return static_cast<double>(SteadyNs()) * 1e-9; }

}  // namespace

/// Open as long as it lives.
class SpeechdVoice::Connection {
 public:
  explicit Connection(const SPDConnectionAddress* address) {
    char* reason = nullptr;
    handle_ = spd_open2("livemap", "driver", nullptr, SPD_MODE_THREADED, address, 0, &reason);
    const std::string why = reason == nullptr ? "it does not answer" : reason;
    std::free(reason);
    if (handle_ == nullptr) throw Error("speech-dispatcher cannot be reached: " + why);
    client_ = static_cast<std::size_t>(spd_get_client_id(handle_));
    handle_->callback_begin = OnSpeechBegin;
    handle_->callback_end = OnSpeechEnd;
    handle_->callback_cancel = OnSpeechEnd;
  }
  ~Connection() {
    spd_close(handle_);
    SpeechProgress::Instance().Forget(client_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void Set(const std::string& language, int rate) {
    for (const SPDNotification each : {SPD_BEGIN, SPD_END, SPD_CANCEL}) {
      Require(spd_set_notification_on(handle_, each), "does not tell when it speaks");
    }
    Require(spd_set_language(handle_, language.c_str()), "does not take the language " + language);
    Require(spd_set_voice_rate(handle_, rate), "does not take the rate " + std::to_string(rate));
  }
  void SetVolume(int volume) {
    Require(spd_set_volume(handle_, volume), "does not take the volume " + std::to_string(volume));
  }
  /// The message's number.
  std::size_t Say(const std::string& sentence) {
    const int message = spd_say(handle_, SPD_IMPORTANT, sentence.c_str());
    Require(message, "does not take the sentence");
    return static_cast<std::size_t>(message);
  }
  void Cancel() { spd_cancel(handle_); }
  int socket() const { return handle_->socket; }
  bool HasBegun(std::size_t message) const {
    return SpeechProgress::Instance().Get(client_).begun >= message;
  }
  bool HasEnded(std::size_t message) const {
    return SpeechProgress::Instance().Get(client_).ended >= message;
  }

 private:
  static void Require(int result, const std::string& what) {
    if (result < 0) throw Error("speech-dispatcher " + what);
  }

  SPDConnection* handle_;
  std::size_t client_ = 0;
};

SpeechdVoice::SpeechdVoice(const Config& config) : config_(config) {}

SpeechdVoice::~SpeechdVoice() = default;

void SpeechdVoice::Connect(const MustStop& must_stop) {
  char* reason = nullptr;
  const std::unique_ptr<SPDConnectionAddress, decltype(&SPDConnectionAddress__free)> address(
      spd_get_default_address(&reason), SPDConnectionAddress__free);
  std::free(reason);
  if (!address) throw Error("SPEECHD_ADDRESS names no address of a speech-dispatcher");
  // Whoever is there must answer: libspeechd would wait for it for ever.
  if (address->method == SPD_METHOD_UNIX_SOCKET) {
    const std::string path = address->unix_socket_name;
    SpeechServer server = AskSpeechServer(path, config_.answer_timeout_s, must_stop);
    if (server == SpeechServer::kAbsent && !must_stop()) {
      StartSpeechServer(path, config_.answer_timeout_s, must_stop);
      server = AskSpeechServer(path, config_.answer_timeout_s, must_stop);
    }
    if (server == SpeechServer::kAbsent) {
      throw Error("speech-dispatcher cannot be reached: nobody listens at " + path);
    }
    if (server == SpeechServer::kSilent) {
      throw Error("speech-dispatcher cannot be reached: it does not answer at " + path);
    }
  }
  connection_ = std::make_unique<Connection>(address.get());
  const MutexLock lock(mutex_);
  socket_ = connection_->socket();
}

void SpeechdVoice::Abort() {
  const MutexLock lock(mutex_);
  if (socket_ >= 0) shutdown(socket_, SHUT_RDWR);
}

void SpeechdVoice::Open(const MustStop& must_stop) {
  {
    const MutexLock lock(mutex_);
    socket_ = -1;
  }
  connection_.reset();
  Connect(must_stop);
  connection_->Set(config_.language, config_.rate);
  connection_->SetVolume(-100);
  Say("1", must_stop);
  connection_->SetVolume(config_.volume);
}

void SpeechdVoice::Say(const std::string& sentence, const MustStop& must_stop) {
  if (!connection_) throw Error("speech-dispatcher is not connected");
  const std::size_t message = connection_->Say(sentence);
  const double start_s = SpeechNowS();
  double end_s = start_s + config_.begin_timeout_s;
  bool has_begun = false;
  bool is_stopped = false;
  while (!connection_->HasEnded(message)) {
    if (!has_begun && connection_->HasBegun(message)) {
      has_begun = true;
      end_s = SpeechNowS() + config_.end_timeout_s;
    }
    if (!is_stopped && must_stop()) {
      is_stopped = true;
      connection_->Cancel();
      end_s = SpeechNowS() + kCancelTimeoutS;
    }
    if (SpeechNowS() > end_s) {
      connection_->Cancel();
      throw Error(has_begun ? "speech-dispatcher does not end a sentence"
                            : "speech-dispatcher says nothing: has it a voice and a sound device?");
    }
    std::this_thread::sleep_for(kLookAgain);
  }
}

}  // namespace livemap::vehicle
