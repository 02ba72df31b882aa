#include "web/officials/order_api.h"

#include <map>
#include <utility>
#include <vector>

#include "common/utc_text.h"
#include "orders/order_text.h"
#include "web/http/request_body.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::string_view kClose = "/close";
constexpr std::string_view kRetry = "/retry";

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

Json OrderTextOrNull(const std::string& text) { return text.empty() ? Json() : Json(text); }
Json OrderTimeOrNull(std::int64_t time_ns) {
  return time_ns == 0 ? Json() : Json(Rfc3339(time_ns));
}

/// Whose hazards they are, by the hazard.
std::map<Uuid, zone::Assignment> AssignmentsByHazard(const zone::ZoneService& zone) {
  std::map<Uuid, zone::Assignment> assignments;
  for (zone::Assignment& one : zone.Assignments()) assignments.emplace(one.hazard, std::move(one));
  return assignments;
}

/// `assignment`: of the order's hazard; null: it is nobody's.
Json OrderJson(const orders::Order& order, const zone::Assignment* assignment,
               std::int64_t now_ns) {
  const orders::OrderContent& content = order.content;
  const bool waits = order.state == orders::OrderState::kWaiting;
  return {{"number", order.id},
          {"id", order.uuid.ToString()},
          {"recipient", order.recipient},
          {"state", OrderStateName(order.state)},
          {"hazard", content.hazard.ToString()},
          {"class", content.class_name},
          {"position", {content.position.longitude_deg, content.position.latitude_deg}},
          {"place", OrderTextOrNull(content.place)},
          {"official", OrderTextOrNull(content.official)},
          {"team", assignment == nullptr ? Json() : Json(assignment->team)},
          {"due", assignment == nullptr || assignment->due_ns == 0
                      ? Json()
                      : Json(Rfc3339(assignment->due_ns).substr(0, 10))},
          {"overdue", assignment != nullptr && assignment->IsOverdue(now_ns)},
          {"made", Rfc3339(order.created_ns)},
          {"attempts", order.attempts},
          {"may_have_arrived", waits && order.uncertain_ns != 0},
          {"last_error", OrderTextOrNull(order.error)},
          {"next_attempt", waits ? Json(Rfc3339(order.next_ns)) : Json()},
          {"sent", OrderTimeOrNull(order.sent_ns)},
          {"reference", OrderTextOrNull(order.reference)},
          {"closed", OrderTimeOrNull(order.closed_ns)},
          {"closed_by", OrderTextOrNull(order.closed_by)}};
}

HttpResponse MethodNotAllowed(const char* accepted) {
  HttpResponse answer =
      MakeErrorAnswer(405, std::string("the method is not allowed, accepted is ") + accepted);
  answer.headers.emplace_back("Allow", accepted);
  return answer;
}

}  // namespace

bool OrderApi::IsAddress(std::string_view path) {
  return path.substr(0, kOrderAddress.size()) == kOrderAddress &&
         (path.size() == kOrderAddress.size() || path[kOrderAddress.size()] == '/');
}

HttpResponse OrderApi::Answer(const RequestTarget& target, const HttpRequest& question) {
  std::string official;
  if (auto refusal = access_.WhyNotOfficial(question, official)) return *std::move(refusal);
  const bool is_read = question.method == "GET" || question.method == "HEAD";
  const bool is_list = target.path == kOrderAddress;
  HttpResponse answer;
  if (desk_ == nullptr) {
    answer = MakeErrorAnswer(404, "the zone has no work orders");
  } else if (is_list) {
    answer = is_read ? List(target) : MethodNotAllowed("GET, HEAD");
  } else {
    answer = question.method == "POST" ? Change(target, official) : MethodNotAllowed("POST");
  }
  answer.by_official = true;
  return answer;
}

HttpResponse OrderApi::List(const RequestTarget& target) const {
  const orders::OrderFilter filter = ParseOrdersQuery(target);
  const auto orders = desk_->List(filter);
  const orders::OrderCounts counts = desk_->Counts();
  Json answer;
  answer["orders"] = OrdersJson(orders);
  // As many as were asked for: there may be more.
  answer["next"] = orders.size() == filter.limit ? Json(orders.back().id) : Json();
  Json& by_state = answer["counts"] = Json::object();
  for (std::size_t i = 0; i < orders::kOrderStates; ++i) {
    by_state[OrderStateName(static_cast<orders::OrderState>(i))] = counts.by_state.at(i);
  }
  answer["recipients"] = desk_->RecipientNames();
  return JsonAnswer(answer);
}

HttpResponse OrderApi::Change(const RequestTarget& target, const std::string& official) {
  RefuseQueryParameters(target);
  const std::string_view path = target.path;
  const bool closes = EndsWith(path, kClose);
  if (!closes && !EndsWith(path, kRetry)) {
    return MakeErrorAnswer(404, "there is nothing at this address");
  }
  const std::size_t begin = kOrderAddress.size() + 1;
  const std::size_t end = path.size() - (closes ? kClose : kRetry).size();
  const auto uuid =
      end > begin ? Uuid::Parse(std::string(path.substr(begin, end - begin))) : std::nullopt;
  if (!uuid) throw BadRequest("the order's id is no UUID");
  if (!desk_->Find(*uuid)) return MakeErrorAnswer(404, "the zone knows no order with this id");
  const auto kind = closes ? zone::DecisionKind::kCloseOrder : zone::DecisionKind::kRetryOrder;
  if (!Do(*uuid, kind, official)) {
    return MakeErrorAnswer(
        409, closes ? "the order is not sent, or closed already" : "the order is not given up");
  }
  return JsonAnswer(OrdersJson({*desk_->Find(*uuid)}).front());
}

bool OrderApi::Do(const Uuid& uuid, zone::DecisionKind kind, const std::string& official) {
  const MutexLock lock(change_mutex_);
  const auto order = desk_->Find(uuid);
  const bool closes = kind == zone::DecisionKind::kCloseOrder;
  const bool is_failed = order && order->state == orders::OrderState::kFailed;
  const bool is_sent = order && order->state == orders::OrderState::kSent;
  if (!is_failed && !(closes && is_sent)) return false;
  zone::DeskAction action;
  action.kind = kind;
  action.order = "to " + order->recipient + ", " + ReferenceOf(*order);
  // A kill in between leaves a decision that was not carried out, and the order as it was.
  zone_.Act(order->content.hazard, official, action);
  return closes ? desk_->Close(uuid, official) : desk_->Retry(uuid);
}

Json OrderApi::OrdersJson(const std::vector<orders::Order>& orders) const {
  const auto assignments = AssignmentsByHazard(zone_);
  const std::int64_t now_ns = zone_.NowNs();
  Json list = Json::array();
  for (const orders::Order& order : orders) {
    const auto assignment = assignments.find(order.content.hazard);
    const bool is_assigned = assignment != assignments.end();
    list.push_back(OrderJson(order, is_assigned ? &assignment->second : nullptr, now_ns));
  }
  return list;
}

}  // namespace livemap::web
