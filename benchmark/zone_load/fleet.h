#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "transport/mqtt_client.h"
#include "zone_load/report_street.h"

namespace livemap::bench {

/// Vehicles that send reports to a zone over its broker, each with a login of its own, and one that
/// hears the zone's notices.
class Fleet {
 public:
  struct Config {
    std::string host = "127.0.0.1";
    int port = 1883;
    std::string zone;
    std::string credentials;  ///< Folder with a file per login, its password in the first line.
    std::uint32_t vehicles = 20;
    /// Reports per second of all together; 0: as fast as the zone answers.
    double rate = 0;
    std::uint32_t window = 50;     ///< Reports of one vehicle that may wait for their receipts.
    std::uint32_t first_step = 0;  ///< Where on its street every vehicle begins; even.
  };
  struct Result {
    double seconds = 0;
    std::uint32_t next_step = 0;  ///< From here on nothing was reported; even.
    std::uint64_t sent = 0;       ///< First sendings, without resends.
    std::uint64_t committed = 0;
    std::uint64_t refused = 0;
    std::uint64_t resent = 0;        ///< No receipt within kPatience.
    std::uint64_t behind = 0;        ///< Were due, by `rate`, while the window was full.
    std::vector<double> receipt_ms;  ///< From a report's first sending to its receipt.
    std::vector<double> notice_ms;   ///< From the confirming report's sending to the notice.
  };

  explicit Fleet(const Config& config);
  ~Fleet();
  Fleet(const Fleet&) = delete;
  Fleet& operator=(const Fleet&) = delete;

  /// Sends for `warm_up_s`, then for `seconds`, and counts what was answered in the latter.
  Result Run(double warm_up_s, double seconds);

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    std::uint32_t step = 0;
    Clock::time_point first_sent;
    Clock::time_point last_sent;
  };
  struct Vehicle {
    std::string id;
    Mutex mutex;
    std::unordered_map<Uuid, Waiting> waiting GUARDED_BY(mutex);
    std::mt19937_64 random GUARDED_BY(mutex);
    std::uint32_t next_step GUARDED_BY(mutex) = 0;
    std::unique_ptr<transport::MqttClient> client;  ///< Its thread uses what stands above.
  };

  std::unique_ptr<transport::MqttClient> Connect(
      const std::string& id, const std::string& topic,
      std::function<void(const transport::MqttMessage&)> on_message) const;
  bool SendNext(std::uint32_t index);
  void Send(Vehicle& vehicle, std::uint32_t index, const Uuid& uuid, std::uint32_t step);
  void OnReceipt(std::uint32_t index, const transport::MqttMessage& message);
  void OnNotice(const transport::MqttMessage& message);
  void Pace(Clock::time_point until);
  void WaitForZone();
  void ResendOverdue(Clock::duration patience);

  const Config config_;
  const ReportStreet street_;
  std::atomic<bool> sending_{true};
  std::atomic<bool> counting_{false};
  std::atomic<bool> answered_{false};  ///< At least one report.

  Mutex result_mutex_;  ///< Taken after a vehicle's.
  Result result_ GUARDED_BY(result_mutex_);
  /// By place, when sent.
  std::unordered_map<std::uint64_t, Clock::time_point> confirmed_ GUARDED_BY(result_mutex_);

  // The clients' threads use all that stands above, so they end before it.
  std::vector<std::unique_ptr<Vehicle>> vehicles_;
  std::unique_ptr<transport::MqttClient> listener_;
};

}  // namespace livemap::bench
