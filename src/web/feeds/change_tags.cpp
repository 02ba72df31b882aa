#include "web/feeds/change_tags.h"

#include <algorithm>
#include <utility>

#include "common/sha256.h"

namespace livemap::web {
namespace {

void SetTag(const std::string& tag, HttpResponse& answer) {
  auto& headers = answer.headers;
  headers.erase(std::remove_if(headers.begin(), headers.end(),
                               [](const auto& header) { return header.first == "Cache-Control"; }),
                headers.end());
  headers.emplace_back("ETag", tag);
  headers.emplace_back("Cache-Control", "no-cache");
  // What somebody may see is another answer.
  headers.emplace_back("Vary", "Authorization, Cookie");
}

}  // namespace

std::string ChangeTags::TagOf(std::uint64_t sequence, std::int64_t now_ns,
                              const std::string& server_address, const HttpRequest& question,
                              const Visibility& sees) const {
  constexpr std::int64_t kLastsNs = 600'000'000'000;
  const std::string said = std::to_string(started_ns_) + ' ' + std::to_string(now_ns / kLastsNs) +
                           (sees.candidates ? " all " : " told ") + server_address + ' ' +
                           question.target;
  constexpr std::size_t kDigits = 16;
  return "W/\"" + std::to_string(sequence) + '-' + Sha256Hex(said).substr(0, kDigits) + '"';
}

std::optional<HttpResponse> ChangeTags::Unchanged(const std::string& tag,
                                                  const HttpRequest& question) {
  // Weak comparison: a proxy may have dropped or added the "W/".
  if (question.if_none_match.find(tag.substr(2)) == std::string::npos) return std::nullopt;
  HttpResponse answer;
  answer.status = 304;
  SetTag(tag, answer);
  return answer;
}

HttpResponse ChangeTags::Tagged(HttpResponse answer, const std::string& tag) {
  SetTag(tag, answer);
  return answer;
}

}  // namespace livemap::web
