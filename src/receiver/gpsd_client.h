#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "receiver/receiver_report.h"
#include "receiver/receiver_watch.h"
#include "transport/backoff.h"
#include "transport/event_fd.h"

namespace livemap::receiver {

/// How to reach gpsd.
struct GpsdConfig {
  std::string host = "127.0.0.1";
  int port = 2947;
  std::string device;            ///< Ask for this receiver alone; empty: for all.
  double connect_timeout_s = 5;  ///< For the connection, per address, and for gpsd's first word.
  double reconnect_min_s = 0.5;  ///< First wait after a loss; doubles up to the maximum.
  double reconnect_max_s = 10;
  double silence_s = 5;  ///< After so long without a word gpsd is asked whether it lives.
  std::uint64_t reconnect_jitter_seed = 0;
};

/// What the client calls, always on its thread. All must be given, and none may throw.
struct GpsdCallbacks {
  /// After gpsd said that it is one (true), and when the connection was lost or an attempt failed
  /// (false, with the reason).
  std::function<void(bool connected, const std::string& reason)> on_connection;
  /// All receivers that gpsd has; whenever that may have changed.
  std::function<void(const std::vector<GpsdDevice>& devices)> on_devices;
  std::function<void(const std::string& device, int used, int visible)> on_satellites;
  std::function<void(const ReceiverReport& report)> on_report;
};

/// A client of gpsd on libgps with a thread of its own, which alone touches the library. It
/// connects, asks for reports, and connects again with back-off for as long as it lives. A gpsd
/// that is stopped or behind a network that is gone is found out: asked whether it lives, it does
/// not answer.
class GpsdClient {
 public:
  /// Starts the thread. Throws Error when the reconnect delays are none.
  GpsdClient(const GpsdConfig& config, GpsdCallbacks callbacks);
  /// Joins the thread: at once, but for a host name that is being resolved, or a host that
  /// vanished between two connections.
  ~GpsdClient();
  GpsdClient(const GpsdClient&) = delete;
  GpsdClient& operator=(const GpsdClient&) = delete;

 private:
  class Session;

  void Run();
  std::string Converse();
  void WaitToReconnect();

  GpsdConfig config_;
  GpsdCallbacks callbacks_;
  transport::Backoff backoff_;
  transport::EventFd stop_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace livemap::receiver
