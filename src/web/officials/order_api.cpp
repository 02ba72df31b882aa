#include "web/officials/order_api.h"

#include <utility>

#include "common/utc_text.h"
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

Json OrderJson(const orders::Order& order) {
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
          {"made", Rfc3339(order.created_ns)},
          {"attempts", order.attempts},
          {"may_have_arrived", waits && order.uncertain_ns != 0},
          {"last_error", OrderTextOrNull(order.error)},
          {"next_attempt", waits ? Json(Rfc3339(order.next_ns)) : Json()},
          {"sent", OrderTimeOrNull(order.sent_ns)},
          {"reference", OrderTextOrNull(order.reference)},
          {"closed", OrderTimeOrNull(order.closed_ns)}};
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
  const OrdersQuery query = ParseOrdersQuery(target);
  const auto orders = desk_->List(query.before, query.limit, query.state);
  Json answer;
  answer["orders"] = Json::array();
  for (const orders::Order& order : orders) answer["orders"].push_back(OrderJson(order));
  // As many as were asked for: there may be more.
  answer["next"] = orders.size() == query.limit ? Json(orders.back().id) : Json();
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
  const bool is_done = closes ? desk_->Close(*uuid, official) : desk_->Retry(*uuid);
  if (!is_done) {
    return MakeErrorAnswer(
        409, closes ? "the order is not sent, or closed already" : "the order is not given up");
  }
  return JsonAnswer(OrderJson(*desk_->Find(*uuid)));
}

}  // namespace livemap::web
