#include "orders/desk/order_desk.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "common/clock.h"
#include "common/time.h"

namespace livemap::orders {
namespace {

constexpr char kBookFile[] = "/orders.sqlite3";
/// No recipient's word keeps an order waiting longer.
constexpr double kMaxRetryAfterS = 86400;

std::unique_ptr<OrderSender> MakeSender(const Recipient& recipient, const OrderDesk::Clock& now_ns,
                                        const std::atomic<bool>& stop) {
  NetworkClient::Config network;
  network.ca_file = recipient.ca_file;
  network.timeout_s = recipient.timeout_s;
  network.stop = &stop;
  return std::visit(
      [&](const auto& way) -> std::unique_ptr<OrderSender> {
        using Way = std::decay_t<decltype(way)>;
        if constexpr (std::is_same_v<Way, MailSender::Config>) {
          return std::make_unique<MailSender>(way, network);
        } else if constexpr (std::is_same_v<Way, WebhookSender::Config>) {
          return std::make_unique<WebhookSender>(way, network, now_ns);
        } else {
          return std::make_unique<Open311Sender>(way, network, now_ns);
        }
      },
      recipient.way);
}

}  // namespace

OrderDesk::OrderDesk(WorkOrderConfig config, const std::string& directory, zone::ZoneService& zone,
                     const protocol::HazardCatalogue& catalogue, Clock now_ns, std::uint64_t seed,
                     Log log)
    : config_(std::move(config)),
      zone_(zone),
      now_ns_(std::move(now_ns)),
      log_(std::move(log)),
      book_(directory + kBookFile, seed),
      planner_(config_.rules, zone, catalogue, book_) {
  for (const Recipient& recipient : config_.recipients) {
    senders_.push_back(MakeSender(recipient, now_ns_, stop_));
  }
  threads_.emplace_back([this] { WorkUntilStopped([this] { return WorkForZone(); }); });
  for (std::size_t i = 0; i < senders_.size(); ++i) {
    threads_.emplace_back([this, &recipient = config_.recipients[i], &sender = *senders_[i]] {
      WorkUntilStopped([&] { return WorkFor(recipient, sender); });
    });
  }
}

OrderDesk::~OrderDesk() {
  stop_ = true;
  Wake();
  for (std::thread& thread : threads_) thread.join();
}

template <typename Work>
void OrderDesk::WorkUntilStopped(const Work& work) {
  while (!stop_) {
    bool is_busy = false;
    try {
      is_busy = work();
    } catch (const std::exception& error) {
      log_(std::string("work orders: ") + error.what());
    }
    if (!is_busy) Rest(kRestS);
  }
}

/// Until somebody wakes the threads, or for so long.
void OrderDesk::Rest(double seconds) {
  const auto deadline = SteadyDeadline(seconds);
  const MutexLock lock(mutex_);
  const std::uint64_t before = wakes_;
  while (!stop_ && wakes_ == before) {
    if (!changed_.WaitUntil(mutex_, deadline)) return;
  }
}

void OrderDesk::Wake() {
  const MutexLock lock(mutex_);
  ++wakes_;
  changed_.NotifyAll();
}

bool OrderDesk::WorkForZone() {
  const bool planned = planner_.Plan(now_ns_());
  if (planned) Wake();
  const auto unverified = book_.FindUnverified();
  if (!unverified) return planned;
  // A kill in between verifies it once more, which asks some vehicles again.
  zone_.Verify(unverified->hazard, unverified->why);
  book_.NoteVerified(unverified->id);
  return true;
}

bool OrderDesk::WorkFor(const Recipient& recipient, OrderSender& sender) {
  const auto order = book_.FindDue(recipient.name, now_ns_());
  if (order) Send(*order, sender, recipient);
  const bool asked = sender.HasStatus() && !stop_ && AskStatus(recipient, sender);
  return order.has_value() || asked;
}

void OrderDesk::Send(const Order& order, OrderSender& sender, const Recipient& recipient) {
  book_.BeginAttempt(order.id, now_ns_());
  const SendResult result = sender.Send(order);
  // Broken off, it is looked at by the next start: perhaps it has arrived.
  if (stop_ && result.outcome != SendResult::Outcome::kSent) return;
  ++attempts_.at(static_cast<std::size_t>(result.outcome));
  const bool is_sent = result.outcome == SendResult::Outcome::kSent;
  const std::int64_t now_ns = now_ns_();
  const std::int64_t next_ns =
      is_sent ? now_ns + Nanoseconds(recipient.poll_s) : NextAttemptNs(order, result);
  book_.EndAttempt(order.id, result, now_ns, next_ns,
                   order.since_ns + Nanoseconds(config_.give_up_s));
  if (!is_sent) {
    log_("work order " + order.uuid.ToString() + " to " + recipient.name + ": " + result.error);
  }
}

std::int64_t OrderDesk::NextAttemptNs(const Order& order, const SendResult& result) const {
  const double doublings = std::min(order.attempts, 30U);
  const double wait_s = std::min(config_.retry_s * std::exp2(doublings), config_.longest_retry_s);
  return now_ns_() + Nanoseconds(std::max(wait_s, std::min(result.retry_after_s, kMaxRetryAfterS)));
}

bool OrderDesk::AskStatus(const Recipient& recipient, OrderSender& sender) {
  const auto order = book_.FindToAsk(recipient.name, now_ns_());
  if (!order) return false;
  const auto status = sender.AskStatus(*order);
  const std::int64_t now_ns = now_ns_();
  book_.NoteAsked(order->id, status ? status->reference : "",
                  now_ns + Nanoseconds(recipient.poll_s));
  if (status && status->is_closed && book_.Close(order->uuid, "its recipient", now_ns)) Wake();
  return true;
}

bool OrderDesk::Close(const Uuid& uuid, const std::string& by) {
  const bool is_closed = book_.Close(uuid, by, now_ns_());
  if (is_closed) Wake();
  return is_closed;
}

bool OrderDesk::Retry(const Uuid& uuid) {
  const bool is_found = book_.Retry(uuid, now_ns_());
  if (is_found) Wake();
  return is_found;
}

std::vector<std::string> OrderDesk::RecipientNames() const {
  std::vector<std::string> names;
  for (const Recipient& recipient : config_.recipients) names.push_back(recipient.name);
  return names;
}

std::array<std::uint64_t, 3> OrderDesk::attempts() const {
  return {attempts_[0], attempts_[1], attempts_[2]};
}

}  // namespace livemap::orders
