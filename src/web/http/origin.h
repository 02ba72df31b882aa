#pragma once

#include <string>
#include <vector>

namespace livemap::web {

/// Whether a page of `origin` (the Origin header) may open the live stream of the server that the
/// client called `host` (the Host header): its own pages may, those of `allowed` ("https://a:1")
/// may, and clients that are no browser, which send no Origin, may. `only_https`: the server speaks
/// HTTPS, so that a page of its host that came in plain text is not its own.
bool IsAllowedOrigin(const std::string& origin, const std::string& host,
                     const std::vector<std::string>& allowed, bool only_https = false);

}  // namespace livemap::web
