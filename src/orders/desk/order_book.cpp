#include "orders/desk/order_book.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/text.h"
#include "orders/order_text.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kMaxStoredBytes = 300;

const std::vector<std::string>& BookMigrations() {
  // Times are ns since 1970 (UTC), positions WGS84 degrees. attempt_ns: when the attempt began of
  // which nothing came yet, 0 where there is none.
  static const std::vector<std::string> kMigrations{
      "CREATE TABLE progress (id INTEGER PRIMARY KEY CHECK (id = 1), decision INTEGER NOT NULL, "
      "sequence INTEGER NOT NULL);"
      "CREATE TABLE orders (id INTEGER PRIMARY KEY, uuid TEXT NOT NULL UNIQUE, recipient TEXT NOT "
      "NULL, hazard TEXT NOT NULL, class_name TEXT NOT NULL, label TEXT NOT NULL, latitude REAL "
      "NOT NULL, longitude REAL NOT NULL, confidence REAL NOT NULL, place TEXT NOT NULL, official "
      "TEXT NOT NULL, reason TEXT NOT NULL, confirmed_ns INTEGER NOT NULL, state INTEGER NOT NULL, "
      "created_ns INTEGER NOT NULL, since_ns INTEGER NOT NULL, next_ns INTEGER NOT NULL, attempts "
      "INTEGER NOT NULL, attempt_ns INTEGER NOT NULL, uncertain_ns INTEGER NOT NULL, sent_ns "
      "INTEGER NOT NULL, closed_ns INTEGER NOT NULL, closed_by TEXT NOT NULL, to_verify INTEGER "
      "NOT NULL, reference TEXT NOT NULL, token TEXT NOT NULL, error TEXT NOT NULL);"
      "CREATE INDEX orders_due ON orders (recipient, state, next_ns);"
      "CREATE INDEX orders_by_hazard ON orders (hazard);"
      "CREATE INDEX orders_by_state ON orders (state, created_ns);"
      "CREATE INDEX orders_to_verify ON orders (to_verify) WHERE to_verify <> 0;"};
  return kMigrations;
}

constexpr char kOrderColumns[] =
    "SELECT id, uuid, recipient, hazard, class_name, label, latitude, longitude, confidence, "
    "place, "
    "official, reason, confirmed_ns, state, created_ns, since_ns, next_ns, attempts, CASE WHEN "
    "uncertain_ns <> 0 THEN uncertain_ns ELSE attempt_ns END, sent_ns, closed_ns, reference, "
    "token, error, closed_by FROM orders WHERE ";

/// None for a row that this program did not write.
std::optional<Order> OrderOf(const SqliteStatement& row) {
  const auto uuid = Uuid::Parse(row.Text(1));
  const auto hazard = Uuid::Parse(row.Text(3));
  const std::int64_t state = row.Int(13);
  if (!uuid || !hazard || state < 0 || state >= static_cast<std::int64_t>(kOrderStates)) {
    return std::nullopt;
  }
  Order order;
  order.id = static_cast<std::uint64_t>(row.Int(0));
  order.uuid = *uuid;
  order.recipient = row.Text(2);
  order.content.hazard = *hazard;
  order.content.class_name = row.Text(4);
  order.content.label = row.Text(5);
  order.content.position = {row.Real(6), row.Real(7)};
  order.content.confidence = row.Real(8);
  order.content.place = row.Text(9);
  order.content.official = row.Text(10);
  order.content.reason = row.Text(11);
  order.content.confirmed_ns = row.Int(12);
  order.state = static_cast<OrderState>(state);
  order.created_ns = row.Int(14);
  order.since_ns = row.Int(15);
  order.next_ns = row.Int(16);
  order.attempts = static_cast<std::uint32_t>(row.Int(17));
  order.uncertain_ns = row.Int(18);
  order.sent_ns = row.Int(19);
  order.closed_ns = row.Int(20);
  order.reference = row.Text(21);
  order.token = row.Text(22);
  order.error = row.Text(23);
  order.closed_by = row.Text(24);
  return order;
}

std::int64_t StateNumber(OrderState state) { return static_cast<std::int64_t>(state); }
std::int64_t RowNumber(std::uint64_t id) {
  return static_cast<std::int64_t>(std::min<std::uint64_t>(id, INT64_MAX));
}

/// Before SQLite makes it with the mode that the process happens to have.
const std::string& PrivateBookFile(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) {
    throw StoreError("work orders '" + path + "' cannot be opened: " + std::strerror(errno));
  }
  close(file);
  return path;
}

}  // namespace

OrderBook::OrderBook(const std::string& path, std::uint64_t uuid_seed)
    : database_(PrivateBookFile(path), true), generator_(uuid_seed) {
  const MutexLock lock(mutex_);
  database_.CheckPages();
  database_.Migrate(BookMigrations());
}

std::optional<OrderCursor> OrderBook::Cursor() const {
  const MutexLock lock(mutex_);
  SqliteStatement find = database_.Prepare("SELECT decision, sequence FROM progress");
  if (!find.Step()) return std::nullopt;
  return OrderCursor{static_cast<std::uint64_t>(find.Int(0)),
                     static_cast<std::uint64_t>(find.Int(1))};
}

void OrderBook::Plan(const std::vector<OrderStep>& steps, const OrderCursor& cursor,
                     std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  database_.Transaction([&] {
    mutex_.AssertHeld();
    for (const OrderStep& step : steps) {
      if (step.cancelled) {
        database_
            .Prepare(
                "UPDATE orders SET state = ? WHERE hazard = ? AND state = ? AND attempts = 0 "
                "AND (official <> '' OR NOT ?)")
            .Bind(1, StateNumber(OrderState::kCancelled))
            .Bind(2, step.cancelled->ToString())
            .Bind(3, StateNumber(OrderState::kWaiting))
            .Bind(4, std::int64_t{step.only_by_officials})
            .Execute();
      }
      for (const OrderStep::New& made : step.made) Add(made, now_ns);
    }
    database_
        .Prepare(
            "INSERT INTO progress (id, decision, sequence) VALUES (1, ?, ?) ON CONFLICT (id) "
            "DO UPDATE SET decision = excluded.decision, sequence = excluded.sequence")
        .Bind(1, RowNumber(cursor.decision))
        .Bind(2, RowNumber(cursor.sequence))
        .Execute();
  });
}

void OrderBook::Add(const OrderStep::New& made, std::int64_t now_ns) {
  const OrderContent& content = made.content;
  SqliteStatement find = database_.Prepare(
      "SELECT 1 FROM orders WHERE hazard = ? AND recipient = ? AND state NOT IN (?, ?)");
  find.Bind(1, content.hazard.ToString()).Bind(2, made.recipient);
  find.Bind(3, StateNumber(OrderState::kClosed)).Bind(4, StateNumber(OrderState::kCancelled));
  if (find.Step()) return;
  database_
      .Prepare(
          "INSERT INTO orders (uuid, recipient, hazard, class_name, label, latitude, "
          "longitude, confidence, place, official, reason, confirmed_ns, state, created_ns, "
          "since_ns, next_ns, attempts, attempt_ns, uncertain_ns, sent_ns, closed_ns, "
          "closed_by, to_verify, reference, token, error) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, "
          "?, ?, ?, ?, ?, ?, ?, 0, 0, 0, 0, 0, '', 0, '', '', '')")
      .Bind(1, Uuid::Random(generator_).ToString())
      .Bind(2, made.recipient)
      .Bind(3, content.hazard.ToString())
      .Bind(4, content.class_name)
      .Bind(5, content.label)
      .Bind(6, content.position.latitude_deg)
      .Bind(7, content.position.longitude_deg)
      .Bind(8, content.confidence)
      .Bind(9, content.place)
      .Bind(10, content.official)
      .Bind(11, content.reason)
      .Bind(12, content.confirmed_ns)
      .Bind(13, StateNumber(OrderState::kWaiting))
      .Bind(14, now_ns)
      .Bind(15, now_ns)
      .Bind(16, made.first_ns)
      .Execute();
}

std::optional<Order> OrderBook::FindDue(const std::string& recipient, std::int64_t now_ns,
                                        const char* which) const {
  const MutexLock lock(mutex_);
  SqliteStatement find = database_.Prepare(std::string(kOrderColumns) + which +
                                           " AND recipient = ? AND next_ns <= ? ORDER BY next_ns");
  find.Bind(1, recipient).Bind(2, now_ns);
  while (find.Step()) {
    if (auto order = OrderOf(find)) return order;
  }
  return std::nullopt;
}

std::optional<Order> OrderBook::FindDue(const std::string& recipient, std::int64_t now_ns) const {
  return FindDue(recipient, now_ns, "state = 0");
}

std::optional<Order> OrderBook::FindToAsk(const std::string& recipient, std::int64_t now_ns) const {
  return FindDue(recipient, now_ns, "state = 1 AND (reference <> '' OR token <> '')");
}

void OrderBook::BeginAttempt(std::uint64_t id, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  database_
      .Prepare(
          "UPDATE orders SET uncertain_ns = CASE WHEN uncertain_ns <> 0 THEN uncertain_ns "
          "ELSE attempt_ns END, attempt_ns = ?, attempts = attempts + 1 WHERE id = ?")
      .Bind(1, now_ns)
      .Bind(2, RowNumber(id))
      .Execute();
}

void OrderBook::EndAttempt(std::uint64_t id, const SendResult& result, std::int64_t now_ns,
                           std::int64_t next_ns, std::int64_t give_up_ns) {
  const bool is_sent = result.outcome == SendResult::Outcome::kSent;
  const bool is_unknown = result.outcome == SendResult::Outcome::kUnknown;
  const OrderState state = is_sent                ? OrderState::kSent
                           : next_ns > give_up_ns ? OrderState::kFailed
                                                  : OrderState::kWaiting;
  const MutexLock lock(mutex_);
  database_
      .Prepare(
          "UPDATE orders SET state = ?, next_ns = ?, sent_ns = ?, reference = ?, token = ?, "
          "error = ?, uncertain_ns = CASE WHEN ? THEN 0 WHEN uncertain_ns = 0 AND ? THEN "
          "attempt_ns ELSE uncertain_ns END, attempt_ns = 0 WHERE id = ?")
      .Bind(1, StateNumber(state))
      .Bind(2, next_ns)
      .Bind(3, is_sent ? now_ns : std::int64_t{0})
      .Bind(4, OneLine(result.reference, kMaxStoredBytes))
      .Bind(5, OneLine(result.token, kMaxStoredBytes))
      .Bind(6, OneLine(result.error, kMaxStoredBytes))
      .Bind(7, std::int64_t{is_sent})
      .Bind(8, std::int64_t{is_unknown})
      .Bind(9, RowNumber(id))
      .Execute();
}

void OrderBook::NoteAsked(std::uint64_t id, const std::string& reference, std::int64_t next_ns) {
  const MutexLock lock(mutex_);
  database_
      .Prepare(
          "UPDATE orders SET next_ns = ?, reference = CASE WHEN ? <> '' THEN ? ELSE reference "
          "END WHERE id = ?")
      .Bind(1, next_ns)
      .Bind(2, reference)
      .Bind(3, reference)
      .Bind(4, RowNumber(id))
      .Execute();
}

bool OrderBook::Close(const Uuid& uuid, const std::string& by, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  SqliteStatement close = database_.Prepare(
      "UPDATE orders SET state = ?, closed_ns = ?, closed_by = ?, to_verify = 1 WHERE uuid = ? AND "
      "state IN (?, ?) RETURNING id");
  close.Bind(1, StateNumber(OrderState::kClosed)).Bind(2, now_ns).Bind(3, by);
  close.Bind(4, uuid.ToString()).Bind(5, StateNumber(OrderState::kSent));
  close.Bind(6, StateNumber(OrderState::kFailed));
  const bool is_closed = close.Step();
  if (is_closed) close.Execute();
  return is_closed;
}

bool OrderBook::Retry(const Uuid& uuid, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  SqliteStatement retry = database_.Prepare(
      "UPDATE orders SET state = ?, since_ns = ?, next_ns = ? WHERE uuid = ? AND state = ? "
      "RETURNING id");
  retry.Bind(1, StateNumber(OrderState::kWaiting)).Bind(2, now_ns).Bind(3, now_ns);
  retry.Bind(4, uuid.ToString()).Bind(5, StateNumber(OrderState::kFailed));
  const bool is_found = retry.Step();
  if (is_found) retry.Execute();
  return is_found;
}

std::optional<OrderBook::Unverified> OrderBook::FindUnverified() const {
  const MutexLock lock(mutex_);
  SqliteStatement find = database_.Prepare(
      "SELECT id, hazard, recipient, closed_by FROM orders WHERE to_verify <> 0 ORDER BY id");
  while (find.Step()) {
    const auto hazard = Uuid::Parse(find.Text(1));
    if (!hazard) continue;
    return Unverified{static_cast<std::uint64_t>(find.Int(0)), *hazard,
                      "work order to " + find.Text(2) + " closed by " + find.Text(3)};
  }
  return std::nullopt;
}

void OrderBook::NoteVerified(std::uint64_t id) {
  const MutexLock lock(mutex_);
  database_.Prepare("UPDATE orders SET to_verify = 0 WHERE id = ?")
      .Bind(1, RowNumber(id))
      .Execute();
}

std::optional<Order> OrderBook::Find(const Uuid& uuid) const {
  const MutexLock lock(mutex_);
  SqliteStatement find = database_.Prepare(std::string(kOrderColumns) + "uuid = ?");
  find.Bind(1, uuid.ToString());
  return find.Step() ? OrderOf(find) : std::nullopt;
}

std::vector<Order> OrderBook::List(const OrderFilter& filter) const {
  const MutexLock lock(mutex_);
  std::string which = "id < ?";
  if (filter.state) which += " AND state = ?";
  if (!filter.recipient.empty()) which += " AND recipient = ?";
  if (filter.hazard) which += " AND hazard = ?";
  SqliteStatement find = database_.Prepare(kOrderColumns + which + " ORDER BY id DESC LIMIT ?");
  int at = 1;
  find.Bind(at++, RowNumber(filter.before));
  if (filter.state) find.Bind(at++, StateNumber(*filter.state));
  if (!filter.recipient.empty()) find.Bind(at++, filter.recipient);
  if (filter.hazard) find.Bind(at++, filter.hazard->ToString());
  find.Bind(at, RowNumber(filter.limit));
  std::vector<Order> orders;
  while (find.Step()) {
    if (auto order = OrderOf(find)) orders.push_back(*std::move(order));
  }
  return orders;
}

OrderCounts OrderBook::Counts() const {
  const MutexLock lock(mutex_);
  OrderCounts counts;
  SqliteStatement count =
      database_.Prepare("SELECT state, count(*), min(created_ns) FROM orders GROUP BY state");
  while (count.Step()) {
    const std::int64_t state = count.Int(0);
    if (state < 0 || state >= static_cast<std::int64_t>(kOrderStates)) continue;
    counts.by_state.at(static_cast<std::size_t>(state)) = static_cast<std::uint64_t>(count.Int(1));
    if (state == StateNumber(OrderState::kWaiting)) counts.oldest_waiting_ns = count.Int(2);
  }
  return counts;
}

}  // namespace livemap::orders
