#include "vehicle/speech/speaker.h"

#include <utility>

#include "common/clock.h"
#include "common/error.h"

namespace livemap::vehicle {
namespace {

constexpr double kEndTimeoutS = 3;  // A voice that hears of its end takes less.

double SpeakerNowS() { return static_cast<double>(SteadyNs()) * 1e-9; }

}  // namespace

Speaker::Speaker(const Config& config, SpokenLanguage language,
                 std::vector<std::unique_ptr<Voice>> voices)
    : config_(config), language_(std::move(language)), queue_(config.queue) {
  for (auto& voice : voices) {
    Source source;
    source.voice = std::move(voice);
    sources_.push_back(std::move(source));
  }
  thread_ = std::thread([this] {
    Work();
    const MutexLock lock(mutex_);
    ended_ = true;
    changed_.NotifyAll();
  });
}

Speaker::~Speaker() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
    changed_.NotifyAll();
    const auto deadline = SteadyDeadline(kEndTimeoutS);
    while (!ended_ && changed_.WaitUntil(mutex_, deadline)) {
    }
    // A voice that hangs does not ask whether it must stop.
    if (!ended_) {
      for (const Source& source : sources_) source.voice->Abort();
    }
  }
  thread_.join();
}

void Speaker::Take(const HazardAlert& alert) {
  {
    const MutexLock lock(mutex_);
    if (queue_.Take(alert, SpeakerNowS())) stop_ = true;
  }
  changed_.NotifyAll();
}

Speaker::State Speaker::state() const {
  const MutexLock lock(mutex_);
  State state = voices_;
  state.counters = queue_.counters();
  state.waiting = queue_.waiting();
  return state;
}

void Speaker::Work() {
  OpenVoices();
  while (const std::optional<HazardAlert> alert = Await()) {
    const SpeechQueue::End end = Say(language_.SentenceOf(*alert));
    const MutexLock lock(mutex_);
    queue_.Finish(stop_ ? SpeechQueue::End::kInterrupted : end);
    stop_ = false;
  }
}

std::optional<HazardAlert> Speaker::Await() {
  MutexLock lock(mutex_);
  while (!closed_) {
    if (std::optional<HazardAlert> alert = queue_.Next(SpeakerNowS())) return alert;
    const bool in_time = changed_.WaitUntil(mutex_, SteadyDeadline(config_.retry_s));
    if (in_time || closed_) continue;
    lock.Unlock();
    OpenVoices();  // A sound device may have come meanwhile.
    lock.Lock();
  }
  return std::nullopt;
}

void Speaker::OpenVoices() {
  for (Source& source : sources_) {
    if (source.is_open || Open(source)) break;
  }
  Publish();
}

bool Speaker::Open(Source& source) {
  try {
    source.voice->Open([this] { return IsClosed(); });
    source.is_open = true;
    source.error.clear();
  } catch (const Error& error) {
    source.error = error.what();
  }
  return source.is_open;
}

SpeechQueue::End Speaker::Say(const std::string& sentence) {
  SpeechQueue::End end = SpeechQueue::End::kFailed;
  for (Source& source : sources_) {
    // A warning does not wait for one that was silent: it is tried when nothing is to be said.
    const bool is_untried = source.error.empty();
    if (!source.is_open && !(is_untried && Open(source))) continue;
    try {
      source.voice->Say(sentence, [this] { return MustStop(); });
      end = SpeechQueue::End::kSaid;
      break;
    } catch (const Error& error) {
      source.is_open = false;
      source.error = error.what();
    }
  }
  Publish();
  return end;
}

bool Speaker::IsClosed() {
  const MutexLock lock(mutex_);
  return closed_;
}

bool Speaker::MustStop() {
  const MutexLock lock(mutex_);
  return stop_ || closed_;
}

void Speaker::Publish() {
  State state;
  state.is_known = true;
  for (const Source& source : sources_) {
    if (source.is_open) {
      state.voice = source.voice->name();
      break;
    }
    state.silent.push_back(source.voice->name() + ": " + source.error);
  }
  const MutexLock lock(mutex_);
  voices_ = std::move(state);
}

}  // namespace livemap::vehicle
