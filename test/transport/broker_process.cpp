#include "test/transport/broker_process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>
#include <utility>

#include "common/error.h"
#include "transport/event_fd.h"
#include "transport/tcp_probe.h"

namespace livemap::transport {

namespace {

bool CanListenOn(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool can =
      bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 && listen(fd, 1) == 0;
  close(fd);
  return can;
}

}  // namespace

int FreePort() {
  // As free_port of scripts/lib/listening_port.py, whose files these are.
  constexpr int kFirst = 20000;
  constexpr int kCount = 12000;
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("livemap_ports_" + std::to_string(getuid()));
  std::filesystem::create_directory(folder);
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
  std::random_device random;
  for (int tries = 0; tries < 1000; ++tries) {
    const int port = kFirst + static_cast<int>(random() % kCount);
    const int lock = open((folder / std::to_string(port)).c_str(),
                          O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    // The lock ends with this process.
    if (lock >= 0 && flock(lock, LOCK_EX | LOCK_NB) == 0 && CanListenOn(port)) return port;
    if (lock >= 0) close(lock);
  }
  throw Error("no free TCP port");
}

bool IsRoot() { return geteuid() == 0; }

TemporaryDirectory::TemporaryDirectory()
    : path_((std::filesystem::temp_directory_path() / "livemap_test_XXXXXX").string()) {
  if (mkdtemp(path_.data()) == nullptr) throw Error("cannot make directory '" + path_ + "'");
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

void ChildProcess::Start(const std::vector<std::string>& command, int port, const std::string& log,
                         std::chrono::seconds patience) {
  // Everything that allocates comes before the fork.
  std::vector<char*> arguments;
  for (const std::string& argument : command) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  const std::string elsewhere = "/usr/sbin/" + command.front();
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    execvp(arguments[0], arguments.data());
    execv(elsewhere.c_str(), arguments.data());
    _exit(127);
  }
  const EventFd never;
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!ProbeTcp("127.0.0.1", port, 1, never.fd()).error.empty()) {
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) {
      pid_ = -1;
      throw Error("'" + command.front() + "' ended at once; its words: " + ReadFile(log, 1 << 20));
    }
    if (std::chrono::steady_clock::now() > deadline) {
      throw Error("'" + command.front() + "' does not answer");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void ChildProcess::Kill() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

BrokerProcess::BrokerProcess(std::string zone) : zone_(std::move(zone)) {}

void BrokerProcess::SetPassword(const std::string& user, const std::string& password) {
  const std::string folder = directory_.path() + "/credentials";
  std::filesystem::create_directories(folder);
  std::ofstream(folder + "/" + user) << password << "\n";
}

void BrokerProcess::Start() {
  process_.Start({std::string(LIVEMAP_SOURCE_DIR) + "/scripts/livemap_broker", "--directory",
                  directory_.path(), "--port", std::to_string(port_), "--zone", zone_, "--vehicles",
                  "car-1,car-2"},
                 port_, directory_.path() + "/broker.log");
}

void BrokerProcess::LoseState() { std::filesystem::remove_all(directory_.path() + "/data"); }

std::string BrokerProcess::Password(const std::string& user) const {
  std::ifstream file(directory_.path() + "/credentials/" + user);
  std::string password;
  std::getline(file, password);
  return password;
}

}  // namespace livemap::transport
