#pragma once

#include <cstdint>
#include <functional>
#include <memory>
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
  std::string cookie;
  std::string csrf_token;    ///< Of the X-CSRF-Token header.
  std::string on_behalf_of;  ///< Of the X-LiveMap-On-Behalf-Of header: for whom a program asks.
  std::string origin;
  std::string host;
  std::string client;  ///< Whom wrong tokens are counted against: an address or its network.
  std::string body;    ///< Of a POST; bounded by kMaxBodyBytes.
};

/// No request of this API needs more.
constexpr std::size_t kMaxBodyBytes = 4096;

/// Makes the content of a long answer bit by bit: each call reads once from the zone, appends what
/// it found, which may be nothing, and says whether more follow. So a call is short whatever was
/// asked for. Nothing is made before the client has taken what was made before. Called by one
/// thread at a time; what it throws cuts the answer off.
using ContentPieces = std::function<bool(std::string& piece)>;

/// A piece is full, and written, as soon as it has so many bytes.
constexpr std::size_t kPieceBytes = 32 << 10;

/// An HTTP answer before it goes onto the wire. The content of an answer to HEAD is dropped there.
/// The content is in one of three places.
struct HttpResponse {
  int status = 200;
  std::string content_type;
  std::string content;
  std::shared_ptr<const std::vector<std::uint8_t>> kept;  ///< Content that others hold, too.
  ContentPieces pieces;                                   ///< Content that is not made yet.
  bool by_official = false;                               ///< The request had a valid token.
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

/// Status 200, not to be cached, made piece by piece.
inline HttpResponse PiecesAnswer(ContentPieces pieces, const char* type) {
  HttpResponse answer;
  answer.content_type = type;
  answer.pieces = std::move(pieces);
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

/// `{"error": sentence}`.
inline HttpResponse MakeErrorAnswer(int status, const std::string& sentence) {
  HttpResponse answer = JsonAnswer({{"error", sentence}});
  answer.status = status;
  return answer;
}

/// Status 503: the client may ask again after `retry_after_s` seconds.
inline HttpResponse MakeBusyAnswer(const std::string& sentence, int retry_after_s = 1) {
  HttpResponse answer = MakeErrorAnswer(503, sentence);
  answer.headers.emplace_back("Retry-After", std::to_string(retry_after_s));
  return answer;
}

}  // namespace livemap::web
