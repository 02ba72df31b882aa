#include "web/http/client_name.h"

#include <algorithm>
#include <optional>
#include <string_view>

namespace livemap::web {
namespace {

namespace ip = boost::asio::ip;

/// IPv4 that came by IPv6 is IPv4.
ip::address Unmapped(const ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return ip::make_address_v4(ip::v4_mapped, address.to_v6());
}

/// Of a stranger's text; none for anything but an address alone.
std::optional<ip::address> ForwardedAddress(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  constexpr std::size_t kMaxBytes = 45;  // The longest IPv6 address.
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return std::nullopt;
  text = text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
  // No scope, and nothing behind a NUL, at which the parser would stop.
  constexpr std::string_view kLetters = "0123456789abcdefABCDEF:.";
  if (text.size() > kMaxBytes || text.find_first_not_of(kLetters) != std::string_view::npos) {
    return std::nullopt;
  }
  boost::system::error_code failure;
  const ip::address address = ip::make_address(std::string(text), failure);
  return failure ? std::nullopt : std::optional(Unmapped(address));
}

}  // namespace

std::string ClientName(const ip::address& peer) {
  const ip::address address = Unmapped(peer);
  if (address.is_v4()) return address.to_string();
  auto bytes = address.to_v6().to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
  return ip::make_address_v6(bytes).to_string();
}

TrustedProxies::TrustedProxies(const std::vector<std::string>& addresses) {
  for (const std::string& text : addresses) {
    if (const auto address = ForwardedAddress(text)) names_.insert(address->to_string());
  }
}

std::string TrustedProxies::ClientOf(const ip::address& peer,
                                     const std::string& forwarded_for) const {
  ip::address sender = Unmapped(peer);
  std::string_view rest = forwarded_for;
  while (names_.count(sender.to_string()) != 0) {
    const std::size_t comma = rest.rfind(',');
    const auto before =
        ForwardedAddress(comma == std::string_view::npos ? rest : rest.substr(comma + 1));
    if (!before) return sender.to_string();
    sender = *before;
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(0, comma);
  }
  return ClientName(sender);
}

}  // namespace livemap::web
