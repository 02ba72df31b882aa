#include "orders/desk/order_planner.h"

#include <algorithm>
#include <utility>

#include "common/time.h"
#include "orders/order_text.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kReadAtOnce = 200;
constexpr std::size_t kMaxPlaceBytes = 300;
constexpr std::uint64_t kMaxReadAgain = 100'000;  // Events: some 10 ms.

/// "Forbes Ave, near S Craig St, eastbound"; empty where no street is known.
std::string PlaceText(const streets::StreetWords& words) {
  if (words.street.empty()) return "";
  std::string text = words.street;
  if (!words.near.empty()) text += ", near " + words.near;
  if (!words.direction.empty()) text += ", " + words.direction;
  return OneLine(text, kMaxPlaceBytes);
}

}  // namespace

OrderPlanner::OrderPlanner(std::vector<OrderRule> rules, const zone::ZoneService& zone,
                           const protocol::HazardCatalogue& catalogue, OrderBook& book)
    : rules_(std::move(rules)), zone_(zone), catalogue_(catalogue), book_(book) {
  const auto newest = zone_.Decisions(UINT64_MAX, 1);
  const OrderCursor now{newest.empty() ? 0 : newest.front().id, zone_.Sequence()};
  const auto read = book_.Cursor();
  const bool is_ahead = read && (read->decision > now.decision || read->sequence > now.sequence);
  if (!read || is_ahead) book_.Plan({}, now, 0);
  cursor_ = kept_ = read && !is_ahead ? *read : now;
}

bool OrderPlanner::Plan(std::int64_t now_ns) {
  // Before the events are read: what is committed by then is among them.
  const std::uint64_t sequence = zone_.Sequence();
  const auto decisions = zone_.DecisionsAfter(cursor_.decision, kReadAtOnce);
  const auto events = zone_.TurnsAfter(cursor_.sequence, kReadAtOnce);
  OrderCursor cursor = cursor_;
  std::vector<OrderStep> steps;
  for (const zone::DecisionRecord& decision : decisions) {
    steps.push_back(StepOf(decision));
    cursor.decision = decision.id;
  }
  for (const zone::StoredEvent& event : events) {
    steps.push_back(StepOf(event));
    cursor.sequence = event.sequence;
  }
  if (events.size() < kReadAtOnce) cursor.sequence = std::max(cursor.sequence, sequence);
  // Where nothing follows, the history is read again after a restart: that costs less than a commit
  // each second.
  const bool is_far = cursor.sequence > kept_.sequence + kMaxReadAgain;
  if (!steps.empty() || is_far) {
    book_.Plan(steps, cursor, now_ns);
    kept_ = cursor;
  }
  cursor_ = cursor;
  return !steps.empty();
}

OrderStep OrderPlanner::StepOf(const zone::DecisionRecord& decision) const {
  OrderStep step;
  const auto hazard = Uuid::Parse(decision.subject);
  if (!hazard) return step;  // A vehicle.
  if (decision.kind == zone::DecisionKind::kUndo) {
    step.cancelled = hazard;
    step.only_by_officials = true;
  }
  if (decision.kind != zone::DecisionKind::kConfirmHazard || decision.undone_by != 0) return step;
  OrderContent content;
  content.official = decision.official;
  content.reason = decision.reason;
  content.confirmed_ns = decision.at_ns;
  Add(OrderRule::When::kConfirmed, *hazard, content, step);
  return step;
}

OrderStep OrderPlanner::StepOf(const zone::StoredEvent& event) const {
  OrderStep step;
  if (!zone::IsOnMap(event.to)) {
    // Unless it is there again by now.
    const auto hazard = zone_.Find(event.hazard);
    if (!hazard || !zone::IsOnMap(hazard->state)) step.cancelled = event.hazard;
    return step;
  }
  OrderContent content;
  content.confirmed_ns = event.at_ns;
  Add(OrderRule::When::kActive, event.hazard, content, step);
  return step;
}

/// As the hazard is now: one that has left the map since makes no order.
void OrderPlanner::Add(OrderRule::When when, const Uuid& uuid, const OrderContent& known,
                       OrderStep& step) const {
  const auto hazard = zone_.Find(uuid);
  if (!hazard || !zone::IsTold(hazard->state)) return;
  OrderContent content = known;
  content.hazard = uuid;
  content.class_name = hazard->class_name;
  content.label = catalogue_.Get(hazard->class_name).label;
  content.position = hazard->position;
  content.confidence = static_cast<double>(hazard->confidence);
  content.place = PlaceText(zone_.WordsOf(*hazard));
  for (const OrderRule& rule : rules_) {
    if (rule.when != when || !rule.Matches(*hazard)) continue;
    step.made.push_back(
        {rule.recipient, content, content.confirmed_ns + Nanoseconds(rule.delay_s)});
  }
}

}  // namespace livemap::orders
