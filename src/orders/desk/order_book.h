#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/sqlite.h"
#include "orders/order.h"
#include "orders/senders/order_sender.h"

namespace livemap::orders {

/// How far the zone's history has been read.
struct OrderCursor {
  std::uint64_t decision = 0;  ///< Id of the newest decision that was looked at.
  std::uint64_t sequence = 0;  ///< Of the newest event that was looked at.
};

/// What follows from one decision or event of the zone.
struct OrderStep {
  /// Orders to be made: content, recipient and when they are sent first.
  struct New {
    std::string recipient;
    OrderContent content;
    std::int64_t first_ns = 0;
  };
  std::vector<New> made;
  /// The hazard whose orders that nobody has tried to send are cancelled first; none: nobody's.
  std::optional<Uuid> cancelled;
  bool only_by_officials = false;  ///< Of those, only the ones that an official's decision made.
};

/// The zone's work orders: a database of its own, with synchronous=FULL, in which every
/// order stands from before its first attempt on. Each function is one transaction: a kill at any
/// moment leaves what was before or what is afterwards. Orders and how far the zone's history has
/// been read change together, so that each decision of the zone makes its orders once.
///
/// Thread-safe. Every function throws StoreError where the database fails.
class OrderBook {
 public:
  /// Opens or makes the file, which only its owner may read. `uuid_seed`: of the orders' uuids.
  OrderBook(const std::string& path, std::uint64_t uuid_seed);

  /// None in a new book.
  std::optional<OrderCursor> Cursor() const;
  /// Does the steps in their order, and remembers how far the history has been read. A hazard that
  /// has an order at a recipient already that is not closed or cancelled gets no further one there.
  void Plan(const std::vector<OrderStep>& steps, const OrderCursor& cursor, std::int64_t now_ns);

  /// The recipient's next order to be sent; none where none is due.
  std::optional<Order> FindDue(const std::string& recipient, std::int64_t now_ns) const;
  /// From now on it is not known whether the order has arrived.
  void BeginAttempt(std::uint64_t id, std::int64_t now_ns);
  /// What came of the attempt; `next_ns`: when it is sent again, or its status asked for. An order
  /// that is to be sent after `give_up_ns` is given up.
  void EndAttempt(std::uint64_t id, const SendResult& result, std::int64_t now_ns,
                  std::int64_t next_ns, std::int64_t give_up_ns);

  /// The recipient's next order whose status is to be asked for.
  std::optional<Order> FindToAsk(const std::string& recipient, std::int64_t now_ns) const;
  /// The recipient was asked; `reference`: what it calls the order by now, if not empty.
  void NoteAsked(std::uint64_t id, const std::string& reference, std::int64_t next_ns);
  /// The work is done by the word of `by`: the order's hazard is to be verified. False for an order
  /// that is neither sent nor given up.
  bool Close(const Uuid& uuid, const std::string& by, std::int64_t now_ns);
  /// Given up before, it is sent again now. False for an order that is not given up.
  bool Retry(const Uuid& uuid, std::int64_t now_ns);

  /// A closed order whose hazard is to be verified yet, and the words with which it was closed.
  struct Unverified {
    std::uint64_t id = 0;
    Uuid hazard;
    std::string why;
  };
  std::optional<Unverified> FindUnverified() const;
  void NoteVerified(std::uint64_t id);

  std::optional<Order> Find(const Uuid& uuid) const;
  /// The newest first.
  std::vector<Order> List(const OrderFilter& filter) const;
  OrderCounts Counts() const;

 private:
  void Add(const OrderStep::New& made, std::int64_t now_ns) REQUIRES(mutex_);
  std::optional<Order> FindDue(const std::string& recipient, std::int64_t now_ns,
                               const char* which) const EXCLUDES(mutex_);

  mutable Mutex mutex_;
  mutable SqliteDatabase database_ GUARDED_BY(mutex_);
  std::mt19937_64 generator_ GUARDED_BY(mutex_);
};

}  // namespace livemap::orders
