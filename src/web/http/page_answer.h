#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "web/http/http_message.h"
#include "web/http/static_files.h"

namespace livemap::web {

/// The Content-Security-Policy of a page: only this server's own files run or load. Tiles are the
/// one exception, and only as images: `tile_source` is their source expression, or empty.
std::string PagePolicy(const std::string& tile_source);

/// Adds the headers that every answer has; `page_policy` where it has no policy of its own.
void AddSecurityHeaders(const std::string& page_policy, HttpResponse& answer);

/// Status 200 with the content, or 304 where the client already has this very content.
HttpResponse CacheableAnswer(std::shared_ptr<const std::vector<std::uint8_t>> content,
                             const std::string& content_type, const std::string& etag,
                             const char* cache_control, const HttpRequest& question);

/// The file of that name, or status 404.
HttpResponse FileAnswer(const StaticFiles& files, std::string_view name,
                        const HttpRequest& question);

}  // namespace livemap::web
