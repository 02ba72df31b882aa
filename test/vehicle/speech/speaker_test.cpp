#include "vehicle/speech/speaker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "common/error.h"
#include "test/support/temporary_directory.h"
#include "vehicle/speech/tone_voice.h"

namespace livemap::vehicle {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// What voices of a test have said; outlives them.
struct Heard {
  Mutex mutex;
  std::vector<std::string> sentences GUARDED_BY(mutex);
  bool holds GUARDED_BY(mutex) = false;  ///< Sentences do not end until it is false.

  std::vector<std::string> Get() {
    const MutexLock lock(mutex);
    return sentences;
  }
  void Hold(bool on) {
    const MutexLock lock(mutex);
    holds = on;
  }
  bool Holds() {
    const MutexLock lock(mutex);
    return holds;
  }
  void Add(const std::string& sentence) {
    const MutexLock lock(mutex);
    sentences.push_back(sentence);
  }
};

class TestVoice : public Voice {
 public:
  TestVoice(std::string name, Heard& heard, bool is_silent)
      : name_(std::move(name)), heard_(heard), is_silent_(is_silent) {}
  std::string name() const override { return name_; }
  void Open(const MustStop&) override {}
  void Say(const std::string& sentence, const MustStop& must_stop) override {
    if (is_silent_) throw Error("no sound device");
    heard_.Add(name_ + " begins " + sentence);
    while (heard_.Holds() && !must_stop()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    heard_.Add(name_ + (must_stop() ? " stops" : " ends"));
  }

 private:
  const std::string name_;
  Heard& heard_;
  const bool is_silent_;
};

SpokenLanguage TestLanguage() {
  return SpokenLanguage::Parse(
      "language = en\nahead = {hazard} {distance}\nleft = {hazard} {distance}\n"
      "right = {hazard} {distance}\nnear = {hazard}\nclass other = Hazard\nclass deer = Deer\n",
      "test", protocol::HazardCatalogue());
}

HazardAlert SpeakerAlert(int number, HazardAlert::State state = HazardAlert::State::kApproach) {
  HazardAlert alert;
  alert.id.bytes[0] = static_cast<std::uint8_t>(number);
  alert.class_name = number == 1 ? "deer" : "pothole";
  alert.state = state;
  alert.distance_m = 2000;
  alert.time_s = 100;
  return alert;
}

template <typename Condition>
bool Eventually(Condition condition) {
  for (int i = 0; i < 5000 && !condition(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return condition();
}

std::vector<std::unique_ptr<Voice>> TestVoices(Heard& heard, bool speech_is_silent,
                                               bool tone_is_silent) {
  std::vector<std::unique_ptr<Voice>> voices;
  voices.push_back(std::make_unique<TestVoice>("speech", heard, speech_is_silent));
  voices.push_back(std::make_unique<TestVoice>("tone", heard, tone_is_silent));
  return voices;
}

/// A voice whose server hangs: it never asks whether it must stop.
class HangingVoice : public Voice {
 public:
  std::string name() const override { return "speech"; }
  void Open(const MustStop&) override {
    MutexLock lock(mutex_);
    while (!aborted_) changed_.Wait(mutex_);
    throw Error("the server is gone");
  }
  void Say(const std::string&, const MustStop&) override {}
  void Abort() override {
    const MutexLock lock(mutex_);
    aborted_ = true;
    changed_.NotifyAll();
  }

 private:
  Mutex mutex_;
  ConditionVariable changed_;
  bool aborted_ GUARDED_BY(mutex_) = false;
};

TEST(Speaker, EndsThoughAVoiceHangs) {
  std::vector<std::unique_ptr<Voice>> voices;
  voices.push_back(std::make_unique<HangingVoice>());
  Speaker speaker({}, TestLanguage(), std::move(voices));
  speaker.Take(SpeakerAlert(1));
}

TEST(Speaker, ASentenceEndsBeforeTheNextBegins) {
  Heard heard;
  Speaker speaker({}, TestLanguage(), TestVoices(heard, false, false));
  heard.Hold(true);
  speaker.Take(SpeakerAlert(1));
  ASSERT_TRUE(Eventually([&] { return heard.Get().size() == 1; }));
  speaker.Take(SpeakerAlert(2));
  heard.Hold(false);
  ASSERT_TRUE(Eventually([&] { return speaker.state().counters.said == 2; }));
  EXPECT_THAT(heard.Get(), ElementsAre("speech begins Deer 2000", "speech ends",
                                       StartsWith("speech begins Hazard"), "speech ends"));
}

TEST(Speaker, ACancelStopsTheSentenceAtOnce) {
  Heard heard;
  Speaker speaker({}, TestLanguage(), TestVoices(heard, false, false));
  heard.Hold(true);
  speaker.Take(SpeakerAlert(1));
  ASSERT_TRUE(Eventually([&] { return heard.Get().size() == 1; }));
  speaker.Take(SpeakerAlert(1, HazardAlert::State::kCancelled));
  ASSERT_TRUE(Eventually([&] { return speaker.state().counters.interrupted == 1; }));
  EXPECT_EQ(heard.Get().back(), "speech stops");
}

TEST(Speaker, TheToneTakesOverFromASilentVoice) {
  Heard heard;
  Speaker speaker({}, TestLanguage(), TestVoices(heard, true, false));
  speaker.Take(SpeakerAlert(1));
  ASSERT_TRUE(Eventually([&] { return speaker.state().counters.said == 1; }));
  EXPECT_THAT(heard.Get(), ElementsAre("tone begins Deer 2000", "tone ends"));
  EXPECT_EQ(speaker.state().voice, "tone");
  EXPECT_THAT(speaker.state().silent, ElementsAre("speech: no sound device"));
}

TEST(Speaker, WithoutAnySoundItSaysSoAndGoesOn) {
  Heard heard;
  Speaker speaker({}, TestLanguage(), TestVoices(heard, true, true));
  for (const int number : {1, 2}) speaker.Take(SpeakerAlert(number));
  ASSERT_TRUE(Eventually([&] { return speaker.state().counters.failed == 2; }));
  EXPECT_EQ(speaker.state().voice, "");
  EXPECT_EQ(speaker.state().silent.size(), 2U);
}

TEST(Speaker, EndsWhileASentenceIsSaid) {
  Heard heard;
  heard.Hold(true);
  {
    Speaker speaker({}, TestLanguage(), TestVoices(heard, false, false));
    speaker.Take(SpeakerAlert(1));
    ASSERT_TRUE(Eventually([&] { return heard.Get().size() == 1; }));
  }
  EXPECT_EQ(heard.Get().back(), "speech stops");
}

std::string WritePlayer(const test::TemporaryDirectory& folder, const std::string& script) {
  const std::string path = folder.path() + "/player";
  std::ofstream(path) << "#!/bin/sh\n" << script << "\n";
  chmod(path.c_str(), 0755);
  return path;
}

std::string ToneFailure(const std::string& player) {
  try {
    ToneVoice(player).Open([] { return false; });
  } catch (const Error& error) {
    return error.what();
  }
  return "played";
}

TEST(ToneVoice, GivesThePlayerAWavFile) {
  const test::TemporaryDirectory folder;
  const std::string wav = folder.path() + "/wav";
  ToneVoice(WritePlayer(folder, "exec cat > " + wav)).Say("", [] { return false; });
  const std::string bytes = ReadFile(wav, 1 << 20);
  EXPECT_EQ(bytes.substr(0, 4), "RIFF");
  EXPECT_EQ(bytes.size(), 44U + 2 * static_cast<std::size_t>(0.45 * 22050));
}

TEST(ToneVoice, SaysWhyNothingIsHeard) {
  const test::TemporaryDirectory folder;
  EXPECT_THAT(ToneFailure(WritePlayer(folder, "exit 1")), HasSubstr("sound device"));
  EXPECT_THAT(ToneFailure(folder.path() + "/nothing"), HasSubstr("cannot be started"));
}

TEST(ToneVoice, StopsAtOnce) {
  const test::TemporaryDirectory folder;
  const auto start = std::chrono::steady_clock::now();
  ToneVoice(WritePlayer(folder, "exec sleep 4")).Say("", [] { return true; });
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
}

}  // namespace
}  // namespace livemap::vehicle
