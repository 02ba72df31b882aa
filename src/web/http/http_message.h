#pragma once

#include <string>
#include <utility>
#include <vector>

#include "web/json/json.h"

namespace livemap::web {

/// What the router needs to know of an HTTP request. Header values are empty where absent.
struct HttpRequest {
  std::string method;
  std::string target;  ///< As it stands in the request line.
  std::string if_none_match;
  std::string authorization;
  std::string content_type;
  std::string origin;
  std::string host;
  std::string client;  ///< Whom wrong tokens are counted against: an address or its network.
  std::string body;    ///< Of a POST; bounded by kMaxBodyBytes.
};

/// No request of this API needs more.
constexpr std::size_t kMaxBodyBytes = 4096;

/// An HTTP answer before it goes onto the wire. The content of an answer to HEAD is dropped there.
struct HttpResponse {
  int status = 200;
  std::string content_type;
  std::string content;
  std::vector<std::pair<std::string, std::string>> headers;
};

/// Status 200, not to be cached.
inline HttpResponse JsonAnswer(const Json& json, const char* type = "application/json") {
  HttpResponse answer;
  answer.content_type = type;
  answer.content = ToText(json);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

/// `{"error": sentence}`.
inline HttpResponse MakeErrorAnswer(int status, const std::string& sentence) {
  HttpResponse answer = JsonAnswer({{"error", sentence}});
  answer.status = status;
  return answer;
}

}  // namespace livemap::web
