#pragma once

#include <string>
#include <string_view>

namespace livemap::web {

/// The value of the cookie of this name in a Cookie header (RFC 6265, section 4.2); empty where it
/// has none.
std::string CookieValue(std::string_view header, std::string_view name);

}  // namespace livemap::web
