#include "orders/senders/open311_sender.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/utc_text.h"
#include "orders/order_text.h"
#include "orders/secret_file.h"

namespace livemap::orders {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxListBytes = 8 << 20;
constexpr std::size_t kMaxReferenceBytes = 128;
constexpr std::size_t kMaxReasonBytes = 120;
/// The server's clock may be off by so much.
constexpr std::int64_t kClockSlackNs = 3'600'000'000'000;

/// The objects of the list that every answer of the standard is; none for anything else.
std::optional<Json> ParseOpen311(const std::string& text) {
  Json json = Json::parse(text, nullptr, false);
  if (!json.is_array()) return std::nullopt;
  const bool has_others =
      std::any_of(json.begin(), json.end(), [](const Json& item) { return !item.is_object(); });
  return has_others ? std::nullopt : std::optional<Json>(std::move(json));
}

/// The member as one line: some servers give ids as numbers. Empty where it is neither.
std::string MemberText(const Json& object, const char* name) {
  const auto member = object.find(name);
  if (member == object.end()) return "";
  if (member->is_string()) {
    return OneLine(member->get_ref<const std::string&>(), kMaxReferenceBytes);
  }
  return member->is_number_integer() ? member->dump() : "";
}

std::string DegreesText(double degrees) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.7f", degrees);
  return text.data();
}

/// What a refusal says: [{"code": 403, "description": "..."}].
std::string RefusalText(const HttpAnswer& answer) {
  if (answer.status == 0) return answer.error;
  std::string text = "the recipient answered " + std::to_string(answer.status);
  const auto json = ParseOpen311(answer.body);
  if (!json || json->empty()) return text;
  const std::string why = MemberText(json->front(), "description");
  return why.empty() ? text : text + ": " + OneLine(why, kMaxReasonBytes);
}

}  // namespace

Open311Sender::Open311Sender(Config config, NetworkClient::Config network, Clock now_ns)
    : config_(std::move(config)), client_(std::move(network)), now_ns_(std::move(now_ns)) {}

std::string Open311Sender::ServiceOf(const Order& order) const {
  const auto service = config_.services.find(order.content.class_name);
  return service == config_.services.end() ? config_.default_service : service->second;
}

/// A URL with a query, or without one yet.
std::string Open311Sender::WithJurisdiction(std::string url) const {
  if (config_.jurisdiction_id.empty()) return url;
  const char* const joint = url.find('?') == std::string::npos ? "?" : "&";
  return url + joint + "jurisdiction_id=" + NetworkClient::Escaped(config_.jurisdiction_id);
}

SendResult Open311Sender::Send(const Order& order) {
  SendResult result;
  const std::string service = ServiceOf(order);
  if (service.empty()) {
    result.error = "the recipient has no service_code for the class " + order.content.class_name;
    return result;
  }
  if (order.uncertain_ns != 0) {
    switch (FindPosted(order, service, result)) {
      case Found::kYes:
        return result;
      case Found::kUnknown:
        result.outcome = SendResult::Outcome::kUnknown;
        result.error = "whether an attempt before arrived cannot be found out yet: " + result.error;
        return result;
      case Found::kNo:
        break;
    }
  }
  return Post(order, service);
}

Open311Sender::Found Open311Sender::FindPosted(const Order& order, const std::string& service,
                                               SendResult& result) const {
  HttpCall call;
  call.max_answer_bytes = kMaxListBytes;
  call.url = WithJurisdiction(
      config_.url + "/requests.json?service_code=" + NetworkClient::Escaped(service) +
      "&start_date=" + NetworkClient::Escaped(Rfc3339Seconds(order.uncertain_ns - kClockSlackNs)) +
      "&end_date=" + NetworkClient::Escaped(Rfc3339Seconds(now_ns_() + kClockSlackNs)));
  const HttpAnswer answer = client_.Call(call);
  const auto list = answer.IsSuccess() ? ParseOpen311(answer.body) : std::nullopt;
  if (!list) {
    result.error = WithoutSecret(
        answer.IsSuccess() ? "its list of requests is none" : RefusalText(answer), config_.api_key);
    return Found::kUnknown;
  }
  const std::string reference = ReferenceOf(order);
  for (const Json& request : *list) {
    const auto description = request.find("description");
    if (description == request.end() || !description->is_string()) continue;
    if (description->get_ref<const std::string&>().find(reference) == std::string::npos) continue;
    result.outcome = SendResult::Outcome::kSent;
    result.reference = MemberText(request, "service_request_id");
    result.token = MemberText(request, "token");
    return Found::kYes;
  }
  if (list->size() < kMaxListed) return Found::kNo;
  result.error = "its list of requests may have been cut";
  return Found::kUnknown;
}

HttpCall Open311Sender::PostOf(const Order& order, const std::string& service) const {
  const OrderContent& content = order.content;
  std::vector<std::pair<const char*, std::string>> fields{
      {"api_key", config_.api_key},
      {"service_code", service},
      {"lat", DegreesText(content.position.latitude_deg)},
      {"long", DegreesText(content.position.longitude_deg)},
      {"description", DescriptionOf(order)}};
  if (!content.place.empty()) fields.emplace_back("address_string", content.place);
  if (!config_.jurisdiction_id.empty()) {
    fields.emplace_back("jurisdiction_id", config_.jurisdiction_id);
  }
  HttpCall call;
  call.is_post = true;
  call.url = config_.url + "/requests.json";
  call.headers = {"Content-Type: application/x-www-form-urlencoded"};
  for (const auto& [name, value] : fields) {
    call.body +=
        (call.body.empty() ? "" : "&") + std::string(name) + "=" + NetworkClient::Escaped(value);
  }
  return call;
}

SendResult Open311Sender::Post(const Order& order, const std::string& service) const {
  const HttpAnswer answer = client_.Call(PostOf(order, service));
  SendResult result;
  result.retry_after_s = answer.retry_after_s;
  if (answer.IsSuccess()) {
    const auto json = ParseOpen311(answer.body);
    if (json && !json->empty()) {
      result.reference = MemberText(json->front(), "service_request_id");
      result.token = MemberText(json->front(), "token");
    }
    // Without an id it may be a stranger's page in between: the list says whether it was taken.
    const bool is_taken = !result.reference.empty() || !result.token.empty();
    result.outcome = is_taken ? SendResult::Outcome::kSent : SendResult::Outcome::kUnknown;
    if (!is_taken) result.error = "the recipient's answer names no request";
    return result;
  }
  const bool is_unknown = answer.status == 0 ? answer.was_sent : answer.status >= 500;
  result.outcome = is_unknown ? SendResult::Outcome::kUnknown : SendResult::Outcome::kRefused;
  result.error = WithoutSecret(RefusalText(answer), config_.api_key);
  return result;
}

/// The request's id; none while the server has given it none.
std::optional<std::string> Open311Sender::ResolveToken(const std::string& token) const {
  HttpCall call;
  call.url = WithJurisdiction(config_.url + "/tokens/" + NetworkClient::Escaped(token) + ".json");
  const HttpAnswer answer = client_.Call(call);
  const auto json = answer.IsSuccess() ? ParseOpen311(answer.body) : std::nullopt;
  if (!json || json->empty()) return std::nullopt;
  std::string id = MemberText(json->front(), "service_request_id");
  return id.empty() ? std::nullopt : std::optional<std::string>(std::move(id));
}

std::optional<OrderStatus> Open311Sender::AskStatus(const Order& order) {
  OrderStatus status;
  status.reference = order.reference;
  if (status.reference.empty()) {
    const auto id = order.token.empty() ? std::nullopt : ResolveToken(order.token);
    if (!id) return std::nullopt;
    status.reference = *id;
  }
  HttpCall call;
  call.url = WithJurisdiction(config_.url + "/requests/" +
                              NetworkClient::Escaped(status.reference) + ".json");
  const HttpAnswer answer = client_.Call(call);
  const auto json = answer.IsSuccess() ? ParseOpen311(answer.body) : std::nullopt;
  if (!json || json->empty()) return std::nullopt;
  const Json& request = json->front();
  if (MemberText(request, "service_request_id") != status.reference) return std::nullopt;
  status.is_closed = MemberText(request, "status") == "closed";
  return status;
}

}  // namespace livemap::orders
