#include "web/http/page_answer.h"

#include <algorithm>
#include <utility>

namespace livemap::web {

std::string PagePolicy(const std::string& tile_source) {
  return "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:" +
         (tile_source.empty() ? "" : " " + tile_source) +
         "; connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
         "frame-ancestors 'none'";
}

void AddSecurityHeaders(const std::string& page_policy, HttpResponse& answer) {
  const bool has_policy =
      std::any_of(answer.headers.begin(), answer.headers.end(),
                  [](const auto& header) { return header.first == "Content-Security-Policy"; });
  if (!has_policy) answer.headers.emplace_back("Content-Security-Policy", page_policy);
  answer.headers.emplace_back("X-Content-Type-Options", "nosniff");
  answer.headers.emplace_back("X-Frame-Options", "DENY");
  answer.headers.emplace_back("Referrer-Policy", "strict-origin-when-cross-origin");
  answer.headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
  answer.headers.emplace_back("Cross-Origin-Opener-Policy", "same-origin");
}

HttpResponse CacheableAnswer(std::shared_ptr<const std::vector<std::uint8_t>> content,
                             const std::string& content_type, const std::string& etag,
                             const char* cache_control, const HttpRequest& question) {
  HttpResponse answer;
  answer.headers.emplace_back("ETag", etag);
  answer.headers.emplace_back("Cache-Control", cache_control);
  answer.content_type = content_type;
  if (question.if_none_match.find(etag) != std::string::npos) {
    answer.status = 304;
  } else {
    answer.kept = std::move(content);
  }
  return answer;
}

HttpResponse FileAnswer(const StaticFiles& files, std::string_view name,
                        const HttpRequest& question) {
  const auto file = files.Find(name);
  if (!file) return MakeErrorAnswer(404, "there is nothing at this address");
  return CacheableAnswer(file->content, file->content_type, file->etag, "no-cache", question);
}

}  // namespace livemap::web
