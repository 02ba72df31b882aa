#pragma once

#include <boost/asio/ip/address.hpp>
#include <set>
#include <string>
#include <vector>

namespace livemap::web {

/// Whom connections, work, pictures and wrong tokens are counted against: an IPv4 address; of an
/// IPv6 one the /64 network, of which a single customer has every address.
std::string ClientName(const boost::asio::ip::address& address);

/// The proxies that are believed when they say whose request they pass on.
///
/// A proxy adds the address that it was asked from at the end of X-Forwarded-For; what stands
/// before that may be anybody's invention. So the text is read from its end, as far as the
/// addresses there are listed proxies, and the first other address is the client. Where it says
/// nothing that can be believed, the proxy itself is. Requests that come from elsewhere are their
/// sender's, whatever their text says.
///
/// Typical usage:
///   const TrustedProxies proxies({"127.0.0.1"});
///   // "198.51.100.7" where the peer is 127.0.0.1:
///   proxies.ClientOf(peer, "203.0.113.9, 198.51.100.7");
class TrustedProxies {
 public:
  /// IPv4 and IPv6 addresses (Validate); what is none is no proxy.
  explicit TrustedProxies(const std::vector<std::string>& addresses);

  /// Their names as clients, each its whole address.
  const std::set<std::string>& names() const { return names_; }
  /// The name of the client whose request came over a connection from `peer` with this text in
  /// X-Forwarded-For; with an empty text the name of the peer itself.
  std::string ClientOf(const boost::asio::ip::address& peer,
                       const std::string& forwarded_for = "") const;

 private:
  std::set<std::string> names_;
};

}  // namespace livemap::web
