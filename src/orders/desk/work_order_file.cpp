#include "orders/desk/work_order_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "orders/order_text.h"
#include "orders/secret_file.h"
#include "orders/senders/mail_message.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kMaxFileBytes = 1 << 20;
constexpr std::size_t kMaxRecipients = 16;
constexpr std::size_t kMaxRules = 200;
constexpr std::size_t kMaxAddresses = 50;
constexpr std::size_t kMaxTextBytes = 500;
constexpr std::size_t kMaxShownBytes = 80;

/// The keys of one map of the file; its errors name file, line and key.
class OrderMapReader {
 public:
  OrderMapReader(const YAML::Node& node, std::string file, const std::string& what)
      : node_(node), file_(std::move(file)) {
    if (!node_.IsMap()) Refuse(node_, what, "a map of keys");
  }

  /// A printable text without blanks at its ends; `value` stays where the key is missing.
  void Read(const char* key, std::string& value) {
    const YAML::Node node = Get(key);
    if (!node.IsDefined()) return;
    if (!node.IsScalar()) Refuse(node, key, "a single value");
    if (OneLine(node.Scalar(), kMaxTextBytes) != node.Scalar()) {
      Refuse(node, key, "one line of printable text");
    }
    value = node.Scalar();
  }

  void Require(const char* key, std::string& value) {
    Read(key, value);
    if (value.empty()) RefuseMissing(key);
  }

  void Read(const char* key, double min, double max, double& value) {
    const YAML::Node node = Get(key);
    if (!node.IsDefined()) return;
    double number = std::nan("");
    // Written so that NaN and what is no number are refused too.
    if (!node.IsScalar() || !YAML::convert<double>::decode(node, number) ||
        !(number >= min && number <= max)) {
      Refuse(node, key, "a number from " + OrderNumber(min) + " to " + OrderNumber(max));
    }
    value = number;
  }

  std::vector<std::string> ReadList(const char* key, std::size_t max_items) {
    const YAML::Node node = Get(key);
    std::vector<std::string> items;
    if (!node.IsDefined()) return items;
    if (!node.IsSequence() || node.size() > max_items) {
      Refuse(node, key, "a list of at most " + std::to_string(max_items) + " texts");
    }
    for (const auto& item : node) {
      if (!item.IsScalar() || item.Scalar().empty() ||
          OneLine(item.Scalar(), kMaxTextBytes) != item.Scalar()) {
        Refuse(item, key, "a list of texts");
      }
      items.push_back(item.Scalar());
    }
    return items;
  }

  /// A path relative to `folder`; empty where the key is missing.
  std::string ReadPath(const char* key, const std::string& folder) {
    std::string path;
    Read(key, path);
    return path.empty() ? path : (std::filesystem::path(folder) / path).string();
  }

  std::string RequireSecret(const char* key, const std::string& folder) {
    const std::string path = ReadPath(key, folder);
    if (path.empty()) RefuseMissing(key);
    return ReadSecretFile(path);
  }

  /// The key's node, which counts as known from now on.
  YAML::Node Get(const char* key) {
    known_.insert(key);
    return node_[key];
  }

  void RejectUnknown() const {
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>("");
      if (known_.count(key) != 0) continue;
      std::string accepted;
      for (const std::string& name : known_) accepted += (accepted.empty() ? "" : ", ") + name;
      throw Error(Place(entry.first) + "the key '" + OneLine(key, kMaxShownBytes) +
                  "' is unknown, accepted are " + accepted);
    }
  }

  [[noreturn]] void Refuse(const YAML::Node& node, const std::string& key,
                           const std::string& accepted) const {
    const std::string value = node.IsScalar() ? node.Scalar() : "no single value";
    throw Error(Place(node) + "'" + key + "' is '" + OneLine(value, kMaxShownBytes) +
                "', accepted is " + accepted);
  }
  [[noreturn]] void RefuseMissing(const char* key) const {
    throw Error(Place(node_) + "'" + key + "' is missing");
  }

  const std::string& file() const { return file_; }

 private:
  static std::string OrderNumber(double number) {
    std::string text = std::to_string(number);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text;
  }

  std::string Place(const YAML::Node& node) const {
    return "work orders '" + file_ + "', line " + std::to_string(node.Mark().line + 1) + ": ";
  }

  const YAML::Node node_;
  const std::string file_;
  std::set<std::string> known_;
};

/// SCHEME://HOST[:PORT][/PATH] in its parts.
struct UrlParts {
  std::string scheme;
  std::string host;
  bool has_port = false;
  std::string path;  ///< With its slash; empty: none.
};

/// None for what is no such URL; one with a user or a fragment is none.
std::optional<UrlParts> SplitUrl(const std::string& url) {
  const std::size_t colon = url.find("://");
  const bool is_printable = std::all_of(url.begin(), url.end(),
                                        [](char c) { return c > ' ' && c < '\x7f' && c != '\\'; });
  if (colon == std::string::npos || !is_printable) return std::nullopt;
  const std::size_t begin = colon + 3;
  const std::size_t end = std::min(url.find('/', begin), url.size());
  const std::string authority = url.substr(begin, end - begin);
  if (authority.find_first_of("@?#") != std::string::npos) return std::nullopt;
  if (url.find('#') != std::string::npos) return std::nullopt;
  UrlParts parts;
  parts.scheme = url.substr(0, colon);
  parts.path = url.substr(end);
  const std::size_t bracket = authority.find(']');
  const std::size_t port = authority.find(':', bracket == std::string::npos ? 0 : bracket);
  parts.host = authority.substr(0, port);
  parts.has_port = port != std::string::npos;
  if (parts.host.empty()) return std::nullopt;
  return parts;
}

std::string ReadHttpUrl(OrderMapReader& reader, const char* key) {
  std::string url;
  reader.Require(key, url);
  const auto parts = SplitUrl(url);
  const bool is_safe = parts && (parts->scheme == "https" ||
                                 (parts->scheme == "http" && IsThisMachine(parts->host)));
  if (!is_safe) {
    reader.Refuse(reader.Get(key), key,
                  "https://HOST[:PORT]/PATH; http:// to this machine itself only");
  }
  return url;
}

MailSender::Config ReadMail(OrderMapReader& reader, const std::string& folder) {
  MailSender::Config mail;
  reader.Require("server", mail.server);
  std::string tls = "required";
  reader.Read("tls", tls);
  const auto parts = SplitUrl(mail.server);
  const bool is_server = parts && (parts->scheme == "smtp" || parts->scheme == "smtps") &&
                         parts->has_port && parts->path.empty();
  if (!is_server) {
    reader.Refuse(reader.Get("server"), "server", "smtp://HOST:PORT or smtps://HOST:PORT");
  }
  if (tls != "required" && tls != "none")
    reader.Refuse(reader.Get("tls"), "tls", "required or none");
  mail.needs_tls = tls == "required";
  if (!mail.needs_tls && !IsThisMachine(parts->host)) {
    reader.Refuse(reader.Get("tls"), "tls", "required, unless the server is this machine itself");
  }
  reader.Read("user", mail.user);
  if (!mail.user.empty()) mail.password = reader.RequireSecret("password_file", folder);
  reader.Get("password_file");
  reader.Require("from", mail.from);
  if (!IsMailAddress(mail.from)) reader.Refuse(reader.Get("from"), "from", "NAME@DOMAIN");
  mail.to = reader.ReadList("to", kMaxAddresses);
  if (mail.to.empty()) reader.RefuseMissing("to");
  for (const auto& address : reader.Get("to")) {
    if (!IsMailAddress(address.Scalar())) reader.Refuse(address, "to", "a list of NAME@DOMAIN");
  }
  return mail;
}

Open311Sender::Config ReadOpen311(OrderMapReader& reader, const std::string& folder) {
  Open311Sender::Config open311;
  open311.url = ReadHttpUrl(reader, "url");
  while (open311.url.back() == '/') open311.url.pop_back();
  if (open311.url.find('?') != std::string::npos) {
    reader.Refuse(reader.Get("url"), "url", "the endpoint's address without a query");
  }
  reader.Read("jurisdiction_id", open311.jurisdiction_id);
  open311.api_key = reader.RequireSecret("api_key_file", folder);
  reader.Read("default_service", open311.default_service);
  const YAML::Node services = reader.Get("services");
  if (services.IsDefined()) {
    OrderMapReader codes(services, reader.file(), "services");
    for (const auto& entry : services) {
      const auto class_name = entry.first.as<std::string>("");
      codes.Require(class_name.c_str(), open311.services[class_name]);
    }
  }
  if (open311.services.empty() && open311.default_service.empty()) {
    reader.RefuseMissing("services");
  }
  return open311;
}

Recipient ReadRecipient(const YAML::Node& node, const std::string& file,
                        const std::string& folder) {
  OrderMapReader reader(node, file, "recipients");
  Recipient recipient;
  reader.Require("name", recipient.name);
  if (recipient.name.size() > 64) reader.Refuse(reader.Get("name"), "name", "at most 64 bytes");
  std::string kind;
  reader.Require("kind", kind);
  if (kind == "mail") {
    recipient.way = ReadMail(reader, folder);
  } else if (kind == "webhook") {
    WebhookSender::Config webhook;
    webhook.url = ReadHttpUrl(reader, "url");
    webhook.secret = reader.RequireSecret("secret_file", folder);
    recipient.way = webhook;
  } else if (kind == "open311") {
    recipient.way = ReadOpen311(reader, folder);
    reader.Read("poll_s", 1, 86400, recipient.poll_s);
  } else {
    reader.Refuse(reader.Get("kind"), "kind", "mail, webhook or open311");
  }
  recipient.ca_file = reader.ReadPath("ca_file", folder);
  reader.Read("timeout_s", 1, 300, recipient.timeout_s);
  reader.RejectUnknown();
  return recipient;
}

geo::GeoPolygon ReadArea(const YAML::Node& node, const OrderMapReader& reader) {
  std::vector<geo::GeoPoint> corners;
  for (const auto& corner : node) {
    geo::GeoPoint point;
    const bool is_pair = corner.IsSequence() && corner.size() == 2 &&
                         YAML::convert<double>::decode(corner[0], point.longitude_deg) &&
                         YAML::convert<double>::decode(corner[1], point.latitude_deg);
    if (!is_pair) reader.Refuse(corner, "area", "a list of corners [LONGITUDE, LATITUDE]");
    corners.push_back(point);
  }
  try {
    return geo::GeoPolygon(std::move(corners));
  } catch (const Error& error) {
    throw Error("work orders '" + reader.file() + "', line " +
                std::to_string(node.Mark().line + 1) + ": " + error.what());
  }
}

OrderRule ReadOrderRule(const YAML::Node& node, const std::string& file,
                        const std::vector<Recipient>& recipients) {
  OrderMapReader reader(node, file, "rules");
  OrderRule rule;
  reader.Require("recipient", rule.recipient);
  const bool is_known =
      std::any_of(recipients.begin(), recipients.end(),
                  [&](const Recipient& recipient) { return recipient.name == rule.recipient; });
  if (!is_known) {
    reader.Refuse(reader.Get("recipient"), "recipient", "the name of one of the recipients");
  }
  const std::vector<std::string> classes = reader.ReadList("classes", kMaxRules);
  rule.classes.insert(classes.begin(), classes.end());
  const YAML::Node area = reader.Get("area");
  if (area.IsDefined()) rule.area = ReadArea(area, reader);
  reader.Read("min_confidence", 0, 1, rule.min_confidence);
  std::string when = "confirmed";
  reader.Read("when", when);
  if (when != "confirmed" && when != "active") {
    reader.Refuse(reader.Get("when"), "when", "confirmed or active");
  }
  if (when == "active") rule.when = OrderRule::When::kActive;
  reader.Read("delay_s", 0, 86400, rule.delay_s);
  reader.RejectUnknown();
  return rule;
}

/// The list of the key, which must have an entry.
YAML::Node RequireSequence(OrderMapReader& reader, const char* key, std::size_t max_items) {
  const YAML::Node node = reader.Get(key);
  if (!node.IsDefined()) reader.RefuseMissing(key);
  if (!node.IsSequence() || node.size() == 0 || node.size() > max_items) {
    reader.Refuse(node, key, "a list of 1 to " + std::to_string(max_items) + " entries");
  }
  return node;
}

}  // namespace

WorkOrderConfig ReadWorkOrderFile(const std::string& path) {
  return ParseWorkOrders(ReadTextFile(path, kMaxFileBytes), path,
                         std::filesystem::absolute(path).parent_path().string());
}

WorkOrderConfig ParseWorkOrders(const std::string& text, const std::string& name,
                                const std::string& folder) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw Error("work orders '" + name + "' is no YAML: " + error.what());
  }
  WorkOrderConfig config;
  OrderMapReader reader(root, name, "the file");
  for (const auto& node : RequireSequence(reader, "recipients", kMaxRecipients)) {
    Recipient recipient = ReadRecipient(node, name, folder);
    for (const Recipient& other : config.recipients) {
      if (other.name == recipient.name) reader.Refuse(node["name"], "name", "a name once");
    }
    config.recipients.push_back(std::move(recipient));
  }
  for (const auto& node : RequireSequence(reader, "rules", kMaxRules)) {
    config.rules.push_back(ReadOrderRule(node, name, config.recipients));
  }
  reader.Read("retry_s", 0.1, 3600, config.retry_s);
  reader.Read("longest_retry_s", 0.1, 86400, config.longest_retry_s);
  reader.Read("give_up_s", 60, 1e9, config.give_up_s);
  reader.RejectUnknown();
  return config;
}

}  // namespace livemap::orders
