#include "vehicle/speech/speech_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <thread>

#include "common/clock.h"

namespace livemap::vehicle {
namespace {

constexpr int kLookAgainMs = 20;
constexpr std::string_view kFarewell = "QUIT\r\n";

double ServerNowS() { return static_cast<double>(SteadyNs()) * 1e-9; }

/// A local stream socket, closed at the end.
class LocalSocket {
 public:
  LocalSocket() : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {}
  ~LocalSocket() {
    if (fd_ >= 0) close(fd_);
  }
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  bool Connect(const std::string& path) const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof(address.sun_path)) return false;
    std::memcpy(address.sun_path, path.data(), path.size());
    return connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  }
  /// Whether all of it went into the socket.
  bool Send(std::string_view text) const {
    return send(fd_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  /// Whether anything has come within so many milliseconds; the end of the connection counts.
  bool Hears(int milliseconds) const {
    pollfd wanted{fd_, POLLIN, 0};
    return poll(&wanted, 1, milliseconds) == 1;
  }
  /// Whether what has come is more than the end.
  bool HasText() const {
    char byte = 0;
    return recv(fd_, &byte, 1, 0) == 1;
  }

 private:
  const int fd_;
};

}  // namespace

SpeechServer AskSpeechServer(const std::string& socket_path, double timeout_s,
                             const Voice::MustStop& must_stop) {
  const LocalSocket server;
  // A socket without room for one more caller (EAGAIN) belongs to a server that accepts none.
  if (!server.Connect(socket_path)) {
    return errno == EAGAIN ? SpeechServer::kSilent : SpeechServer::kAbsent;
  }
  if (!server.Send(kFarewell)) return SpeechServer::kSilent;
  const double end_s = ServerNowS() + timeout_s;
  while (ServerNowS() < end_s && !must_stop()) {
    if (!server.Hears(kLookAgainMs)) continue;
    return server.HasText() ? SpeechServer::kAnswers : SpeechServer::kSilent;
  }
  return SpeechServer::kSilent;
}

void StartSpeechServer(const std::string& socket_path, double timeout_s,
                       const Voice::MustStop& must_stop) {
  std::string program = "speech-dispatcher", spawn = "--spawn", method = "--communication-method",
              local = "unix_socket", flag = "--socket-path", path = socket_path;
  std::array<char*, 7> arguments{program.data(), spawn.data(), method.data(), local.data(),
                                 flag.data(),    path.data(),  nullptr};
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&quiet, stream, "/dev/null", O_RDWR, 0);
  }
  pid_t child = 0;
  const bool is_running =
      posix_spawnp(&child, program.c_str(), &quiet, nullptr, arguments.data(), environ) == 0;
  posix_spawn_file_actions_destroy(&quiet);
  if (!is_running) return;
  // It goes to the background when it listens; its first process ends then.
  const double end_s = ServerNowS() + timeout_s;
  while (waitpid(child, nullptr, WNOHANG) == 0) {
    if (ServerNowS() > end_s || must_stop()) {
      kill(child, SIGKILL);
      waitpid(child, nullptr, 0);
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(kLookAgainMs));
  }
}

}  // namespace livemap::vehicle
