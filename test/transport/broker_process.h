#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace livemap::transport {

/// A TCP port on which nobody listens. Until this process ends no other test is given it, and the
/// system draws it for no connection.
int FreePort();

bool IsRoot();

/// A directory of its own that goes with the object.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A server program that ends with the object, and with this process however it ends.
class ChildProcess {
 public:
  ChildProcess() = default;
  ~ChildProcess() { Kill(); }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Starts `command`, found on PATH and in /usr/sbin, with its output in `log`, and waits until
  /// `port` answers; throws Error when it does not within `patience`.
  void Start(const std::vector<std::string>& command, int port, const std::string& log,
             std::chrono::seconds patience = std::chrono::seconds(60));
  /// Kills with SIGKILL and waits for the end.
  void Kill();

 private:
  pid_t pid_ = -1;
};

/// A real mosquitto on a free port of this machine, configured and started by
/// scripts/livemap_broker for one zone with the vehicles "car-1" and "car-2".
class BrokerProcess {
 public:
  explicit BrokerProcess(std::string zone = "test");
  void Start();
  /// Before the start: `user` has this password, as at all brokers of an authority.
  void SetPassword(const std::string& user, const std::string& password);
  void Kill() { process_.Kill(); }
  /// Forgets sessions and queued messages, as after a lost disk.
  void LoseState();

  int port() const { return port_; }
  /// The random password that the script gave to `user`.
  std::string Password(const std::string& user) const;

 private:
  const std::string zone_;
  const TemporaryDirectory directory_;
  const int port_ = FreePort();
  ChildProcess process_;
};

}  // namespace livemap::transport
