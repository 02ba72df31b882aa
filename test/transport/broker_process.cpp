#include "broker_process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "transport/event_fd.h"
#include "transport/tcp_probe.h"

namespace livemap {

int FreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw Error("no free TCP port");
  }
  close(fd);
  return ntohs(address.sin_port);
}

BrokerProcess::BrokerProcess(int max_message_bytes)
    : max_message_bytes_(max_message_bytes), port_(FreePort()) {
  std::string name = (std::filesystem::temp_directory_path() / "livemap_broker_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw Error("cannot make directory '" + name + "'");
  directory_ = name;
}

BrokerProcess::~BrokerProcess() {
  Kill();
  std::error_code ignored;
  std::filesystem::remove_all(directory_, ignored);
}

void BrokerProcess::Start() {
  const std::string script = std::string(LIVEMAP_SOURCE_DIR) + "/scripts/livemap_broker";
  const std::string port = std::to_string(port_);
  const std::string bytes = std::to_string(max_message_bytes_);
  const std::string log = directory_ + "/broker.log";
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    execl(script.c_str(), script.c_str(), "--directory", directory_.c_str(), "--port", port.c_str(),
          "--zone", "test", "--vehicles", "car-1,car-2", "--max-message-bytes", bytes.c_str(),
          static_cast<char*>(nullptr));
    _exit(127);
  }
  const EventFd never;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!ProbeTcp("127.0.0.1", port_, 1, never.fd()).error.empty()) {
    if (waitpid(pid_, nullptr, WNOHANG) == pid_) {
      pid_ = -1;
      throw Error("the broker ended at once; its words: " + ReadFile(log, 1 << 20));
    }
    if (std::chrono::steady_clock::now() > deadline) throw Error("the broker does not answer");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void BrokerProcess::Kill() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void BrokerProcess::LoseState() { std::filesystem::remove_all(directory_ + "/data"); }

std::string BrokerProcess::Password(const std::string& user) const {
  std::ifstream file(directory_ + "/credentials/" + user);
  std::string password;
  std::getline(file, password);
  return password;
}

}  // namespace livemap
