#include "vehicle/speech/tone_voice.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "common/error.h"

extern char** environ;

namespace livemap::vehicle {
namespace {

constexpr std::uint32_t kSamplesPerS = 22050;
constexpr double kToneHz = 880;
constexpr double kBeepS = 0.18;
constexpr double kPauseS = 0.09;
constexpr double kLoudness = 0.8;  // Of full scale.
constexpr double kEdgeS = 0.01;    // Rises and falls so long, or it would click.
constexpr double kPlayTimeoutS = 5;
constexpr std::chrono::milliseconds kPlayerLookAgain{10};

void AppendLittleEndian(std::string& bytes, std::uint32_t value, int size) {
  for (int i = 0; i < size; ++i) {
    bytes.push_back(static_cast<char>(value >> (8 * i) & 0xFFU));
  }
}

/// A WAV file of one channel with 16 bits.
template <typename LoudnessAt>
std::string MakeWav(double length_s, LoudnessAt loudness_at) {
  const auto samples = static_cast<std::uint32_t>(length_s * kSamplesPerS);
  std::string wav = "RIFF";
  AppendLittleEndian(wav, 36 + 2 * samples, 4);
  wav += "WAVEfmt ";
  AppendLittleEndian(wav, 16, 4);
  AppendLittleEndian(wav, 1, 2);  // PCM.
  AppendLittleEndian(wav, 1, 2);  // Channels.
  AppendLittleEndian(wav, kSamplesPerS, 4);
  AppendLittleEndian(wav, 2 * kSamplesPerS, 4);
  AppendLittleEndian(wav, 2, 2);
  AppendLittleEndian(wav, 16, 2);
  wav += "data";
  AppendLittleEndian(wav, 2 * samples, 4);
  for (std::uint32_t i = 0; i < samples; ++i) {
    const double time_s = static_cast<double>(i) / kSamplesPerS;
    const double value = loudness_at(time_s) * std::sin(2 * M_PI * kToneHz * time_s);
    AppendLittleEndian(wav, static_cast<std::uint32_t>(std::lround(value * INT16_MAX)), 2);
  }
  return wav;
}

std::string BeepsWav() {
  return MakeWav(2 * kBeepS + kPauseS, [](double time_s) {
    const double in_beep_s = std::fmod(time_s, kBeepS + kPauseS);
    if (in_beep_s > kBeepS) return 0.0;
    return kLoudness * std::min({1.0, in_beep_s / kEdgeS, (kBeepS - in_beep_s) / kEdgeS});
  });
}

std::string SilenceWav() {
  return MakeWav(0.02, [](double) { return 0.0; });
}

/// The readable end of a pipe that holds `bytes`, which fit into one.
int PipeWith(const std::string& bytes) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw Error("no pipe for a tone: " + std::string(strerror(errno)));
  const bool fits =
      fcntl(ends[1], F_SETFL, O_NONBLOCK) == 0 &&
      write(ends[1], bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
  close(ends[1]);
  if (fits) return ends[0];
  close(ends[0]);
  throw Error("a tone of " + std::to_string(bytes.size()) + " bytes does not fit into a pipe");
}

pid_t StartPlayer(const std::string& player, int input) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::string program = player;
  std::string quiet = "-q";
  std::string from_input = "-";
  char* const arguments[] = {program.data(), quiet.data(), from_input.data(), nullptr};
  pid_t process = 0;
  const int failure = posix_spawnp(&process, player.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) {
    throw Error("the player '" + player + "' cannot be started: " + std::strerror(failure));
  }
  return process;
}

}  // namespace

ToneVoice::ToneVoice(std::string player) : player_(std::move(player)) {}

void ToneVoice::Open(const MustStop& must_stop) { Play(SilenceWav(), must_stop); }

void ToneVoice::Say(const std::string&, const MustStop& must_stop) { Play(BeepsWav(), must_stop); }

void ToneVoice::Play(const std::string& wav, const MustStop& must_stop) const {
  const int input = PipeWith(wav);
  pid_t process = 0;
  try {
    process = StartPlayer(player_, input);
  } catch (const Error&) {
    close(input);
    throw;
  }
  close(input);
  const auto deadline = SteadyDeadline(kPlayTimeoutS);
  int status = 0;
  while (waitpid(process, &status, WNOHANG) == 0) {
    const bool is_late = std::chrono::steady_clock::now() > deadline;
    if (is_late || must_stop()) {
      kill(process, SIGKILL);
      waitpid(process, &status, 0);
      if (is_late) throw Error("the player '" + player_ + "' does not end");
      return;
    }
    std::this_thread::sleep_for(kPlayerLookAgain);
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw Error("the player '" + player_ + "' plays nothing: is there a sound device?");
  }
}

}  // namespace livemap::vehicle
