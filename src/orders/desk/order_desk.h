#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "orders/desk/order_book.h"
#include "orders/desk/order_planner.h"
#include "orders/desk/work_order_file.h"
#include "orders/senders/order_sender.h"
#include "protocol/hazard_catalogue.h"
#include "zone/service/zone_service.h"

namespace livemap::orders {

/// The zone's work orders, from the decision that makes one to the end of the work: it makes them,
/// sends them, sends again what failed, asks what became of them, and has the hazards of closed
/// ones verified. One thread does all this of the zone, and one each of a recipient, so that one
/// that does not answer keeps no other waiting. Thread-safe.
class OrderDesk {
 public:
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.
  /// Takes one line about what went wrong, which holds no secret; any thread calls it.
  using Log = std::function<void(const std::string&)>;

  /// Opens or makes the book in `directory` and begins to work. Keeps references to `zone` and
  /// `catalogue`. Throws Error when the book cannot be used.
  OrderDesk(WorkOrderConfig config, const std::string& directory, zone::ZoneService& zone,
            const protocol::HazardCatalogue& catalogue, Clock now_ns, std::uint64_t seed, Log log);
  /// Breaks off what is being sent: it counts as perhaps arrived.
  ~OrderDesk();
  OrderDesk(const OrderDesk&) = delete;
  OrderDesk& operator=(const OrderDesk&) = delete;

  /// See OrderBook.
  std::vector<Order> List(const OrderFilter& filter) const { return book_.List(filter); }
  std::optional<Order> Find(const Uuid& uuid) const { return book_.Find(uuid); }
  OrderCounts Counts() const { return book_.Counts(); }
  bool Close(const Uuid& uuid, const std::string& by);
  bool Retry(const Uuid& uuid);
  /// Names of all recipients, in the order of the file of work orders.
  std::vector<std::string> RecipientNames() const;

  /// What came of all attempts since the start, by SendResult::Outcome.
  std::array<std::uint64_t, 3> attempts() const;

 private:
  /// How long a thread rests that found nothing to do.
  static constexpr double kRestS = 0.5;

  /// Calls `work` until the end; it says whether it found anything to do.
  template <typename Work>
  void WorkUntilStopped(const Work& work);
  bool WorkForZone();
  bool WorkFor(const Recipient& recipient, OrderSender& sender);
  void Send(const Order& order, OrderSender& sender, const Recipient& recipient);
  bool AskStatus(const Recipient& recipient, OrderSender& sender);
  std::int64_t NextAttemptNs(const Order& order, const SendResult& result) const;
  void Wake();
  void Rest(double seconds);

  const WorkOrderConfig config_;
  zone::ZoneService& zone_;
  const Clock now_ns_;
  const Log log_;
  OrderBook book_;
  OrderPlanner planner_;                               ///< The zone's thread alone.
  std::vector<std::unique_ptr<OrderSender>> senders_;  ///< As config_.recipients, a thread each.
  std::array<std::atomic<std::uint64_t>, 3> attempts_{};
  std::atomic<bool> stop_{false};
  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::uint64_t wakes_ GUARDED_BY(mutex_) = 0;
  std::vector<std::thread> threads_;
};

}  // namespace livemap::orders
