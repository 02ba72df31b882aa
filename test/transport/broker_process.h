#pragma once

#include <sys/types.h>

#include <string>

namespace livemap {

/// A real mosquitto on a free port of this machine, configured and started by
/// scripts/livemap_broker for zone "test" with the vehicles "car-1" and "car-2". Its directory and
/// process end with the object.
class BrokerProcess {
 public:
  explicit BrokerProcess(int max_message_bytes = 1 << 20);
  ~BrokerProcess();
  BrokerProcess(const BrokerProcess&) = delete;
  BrokerProcess& operator=(const BrokerProcess&) = delete;

  /// Starts and waits until the port answers; throws Error when it does not.
  void Start();
  /// Kills with SIGKILL and waits for the end.
  void Kill();
  /// Forgets sessions and queued messages, as after a lost disk.
  void LoseState();

  int port() const { return port_; }
  /// The random password that the script gave to `user`.
  std::string Password(const std::string& user) const;
  const std::string& directory() const { return directory_; }

 private:
  int max_message_bytes_;
  int port_;
  std::string directory_;
  pid_t pid_ = -1;
};

/// A TCP port that was free a moment ago.
int FreePort();

}  // namespace livemap
