#include "orders/order_text.h"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/text.h"
#include "common/utc_text.h"
#include "protocol/text_rules.h"

namespace livemap::orders {
namespace {

std::string PositionText(const Order& order) {
  std::array<char, 64> text;
  std::snprintf(text.data(), text.size(), "%.6f, %.6f", order.content.position.latitude_deg,
                order.content.position.longitude_deg);
  return text.data();
}

}  // namespace

std::string OneLine(std::string_view text, std::size_t max_bytes) {
  std::string line;
  while (!text.empty() && line.size() <= max_bytes) {
    std::string_view rest = text;
    const bool is_whole = protocol::TakeCodePoint(rest).has_value();
    const std::size_t size = is_whole ? text.size() - rest.size() : 1;
    const std::string_view character = text.substr(0, size);
    line += is_whole && protocol::IsPrintableText(character, size) ? std::string(character) : "?";
    text.remove_prefix(size);
  }
  return protocol::Trimmed(CutUtf8(std::move(line), max_bytes));
}

std::string ReferenceOf(const Order& order) { return "LM-" + order.uuid.ToString(); }

std::string TitleOf(const Order& order) {
  const OrderContent& content = order.content;
  return content.label + ": " + (content.place.empty() ? PositionText(order) : content.place);
}

std::string DescriptionOf(const Order& order) {
  const OrderContent& content = order.content;
  std::array<char, 32> confidence;
  std::snprintf(confidence.data(), confidence.size(), "%.0f %%", 100 * content.confidence);
  return TitleOf(order) + "\nPosition (latitude, longitude): " + PositionText(order) +
         "\nSeen by vehicles, confidence " + confidence.data() + ", confirmed " +
         Rfc3339Seconds(content.confirmed_ns) + "\nReference: " + ReferenceOf(order) + "\n";
}

std::string JsonOf(const Order& order) {
  const OrderContent& content = order.content;
  nlohmann::ordered_json json{{"order", order.uuid.ToString()},
                              {"reference", ReferenceOf(order)},
                              {"hazard", content.hazard.ToString()},
                              {"class", content.class_name},
                              {"label", content.label},
                              {"latitude", content.position.latitude_deg},
                              {"longitude", content.position.longitude_deg},
                              {"place", nullptr},
                              {"confidence", content.confidence},
                              {"confirmed", Rfc3339Seconds(content.confirmed_ns)},
                              {"official", nullptr},
                              {"reason", content.reason}};
  if (!content.place.empty()) json["place"] = content.place;
  if (!content.official.empty()) json["official"] = content.official;
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace livemap::orders
