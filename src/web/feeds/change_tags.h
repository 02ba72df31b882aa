#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "web/http/http_message.h"
#include "web/http/site.h"

namespace livemap::web {

/// Entity tags (RFC 9110, section 8.8.3) of answers that are made anew each time from what the zone
/// knows. They are weak: two answers of one tag say the same of the road, at other times.
class ChangeTags {
 public:
  /// Tags of one start of the program say nothing to the next one.
  explicit ChangeTags(std::int64_t started_ns) : started_ns_(started_ns) {}

  /// The tag of the answer to a request at `now_ns`, while the zone's newest event is `sequence`.
  /// It lasts ten minutes, because the expected ends in an answer move.
  std::string TagOf(std::uint64_t sequence, std::int64_t now_ns, const std::string& server_address,
                    const HttpRequest& question, const Visibility& sees) const;

  /// Status 304 where the client has the answer of that tag, as it says.
  static std::optional<HttpResponse> Unchanged(const std::string& tag, const HttpRequest& question);
  /// The answer with its tag, which a cache asks for each time.
  static HttpResponse Tagged(HttpResponse answer, const std::string& tag);

 private:
  const std::int64_t started_ns_;
};

}  // namespace livemap::web
