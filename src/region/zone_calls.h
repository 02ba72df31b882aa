#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "orders/senders/network_client.h"
#include "region/region.h"
#include "web/server/work_queue.h"

namespace livemap::region {

/// Asks a region's zones by HTTP in the name of its officials, on threads of its own, so that no
/// zone that hangs keeps the region's server waiting. Nothing is sent twice: a request that failed
/// is not repeated. Thread-safe.
///
/// Typical usage:
///   ZoneCalls calls(region);
///   const bool is_asked = calls.Ask(0, call, [](const orders::HttpAnswer& answer) { ... });
class ZoneCalls {
 public:
  /// So many requests to one zone are open at the same time, so that one that hangs leaves threads
  /// for the others. A page that opens a hazard sends four.
  static constexpr std::size_t kMaxOpenPerZone = 12;
  static constexpr int kThreads = 32;
  /// A zone that is one of many to be asked, or is down, has so long for its answer, s.
  static constexpr double kListTimeoutS = 5;

  using Done = std::function<void(const orders::HttpAnswer& answer)>;
  /// By zone: its answer, or none of one that is down, or that has too many requests open.
  using Answers = std::vector<std::optional<orders::HttpAnswer>>;

  /// Keeps the reference.
  explicit ZoneCalls(const Region& region);
  /// As Stop.
  ~ZoneCalls();
  ZoneCalls(const ZoneCalls&) = delete;
  ZoneCalls& operator=(const ZoneCalls&) = delete;

  /// Sends the request, whose `url` is a path of the zone's map, with the zone's token, and calls
  /// `done` from a thread of its own. The whole exchange takes Region::Config::timeout_s at most.
  /// False, and nothing is done, where too many requests to the zone are open.
  bool Ask(std::size_t zone, const orders::HttpCall& call, const Done& done);
  /// Sends the request to all zones that are up, and calls `done` once, when each of them has
  /// answered or had kListTimeoutS. `done` may be called before this returns.
  void AskAll(const orders::HttpCall& call, const std::function<void(Answers answers)>& done);
  /// Cuts off what is being asked. When it returns, nobody is being called and nobody will be.
  void Stop();

 private:
  double ShortS() const;
  bool AskFor(std::size_t zone, orders::HttpCall call, double timeout_s, const Done& done);

  const Region& region_;
  std::atomic<bool> stop_{false};
  std::vector<std::atomic<std::size_t>> open_;  ///< By zone.
  web::WorkQueue threads_;                      ///< Last: what it does uses all above it.
};

}  // namespace livemap::region
