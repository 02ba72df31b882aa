#include "web/http/client_name.h"

#include <gtest/gtest.h>

#include <string>

namespace livemap::web {
namespace {

using boost::asio::ip::make_address;

TEST(ClientName, AnIpv6ClientIsItsNetworkAndAMappedIpv4AddressIsIpv4) {
  EXPECT_EQ(ClientName(make_address("192.0.2.7")), "192.0.2.7");
  EXPECT_EQ(ClientName(make_address("::ffff:192.0.2.7")), "192.0.2.7");
  EXPECT_EQ(ClientName(make_address("2001:db8:1:2:3:4:5:6")), "2001:db8:1:2::");
}

class TrustedProxiesTest : public testing::Test {
 protected:
  std::string ClientOf(const std::string& peer, const std::string& forwarded_for) const {
    return proxies_.ClientOf(make_address(peer), forwarded_for);
  }
  const TrustedProxies proxies_{{"127.0.0.1", "2001:db8::1", "10.0.0.1"}};
};

TEST_F(TrustedProxiesTest, AListedProxyNamesItsClientAndNobodyElseDoes) {
  EXPECT_EQ(ClientOf("127.0.0.1", "192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(ClientOf("::ffff:127.0.0.1", "192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(ClientOf("2001:db8::1", "2001:db8:9:9:1::5"), "2001:db8:9:9::");
  EXPECT_EQ(ClientOf("192.0.2.99", "192.0.2.7"), "192.0.2.99");
  EXPECT_EQ(ClientOf("2001:db8::2", "192.0.2.7"), "2001:db8::") << "a neighbour is no proxy";
}

TEST_F(TrustedProxiesTest, WhatAClientWroteItselfNamesNobody) {
  EXPECT_EQ(ClientOf("127.0.0.1", "203.0.113.1, 192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(ClientOf("127.0.0.1", "203.0.113.1,192.0.2.7 , 10.0.0.1"), "192.0.2.7")
      << "one proxy behind the other";
  EXPECT_EQ(ClientOf("127.0.0.1", "10.0.0.1, 203.0.113.1, 192.0.2.7"), "192.0.2.7");
}

TEST_F(TrustedProxiesTest, ATextThatNamesNobodyCountsAgainstTheProxy) {
  const std::string long_text(100000, 'x');
  for (const std::string& text :
       {std::string(), std::string(" "), std::string(","), std::string("unknown"),
        std::string("192.0.2.7,"), std::string("192.0.2.7:80"), std::string("192.0.2.7, 300.1.1.1"),
        std::string("fe80::1%eth0"), std::string("192.0.2.7\0", 10), long_text}) {
    EXPECT_EQ(ClientOf("127.0.0.1", text), "127.0.0.1") << text.substr(0, 40);
  }
  EXPECT_EQ(ClientOf("127.0.0.1", "unknown, 10.0.0.1"), "10.0.0.1") << "of the farther proxy";
  EXPECT_EQ(ClientOf("2001:db8::1", ""), "2001:db8::1");
  EXPECT_EQ(proxies_.names().count("2001:db8::1"), 1U) << "a proxy is named by its whole address";
}

}  // namespace
}  // namespace livemap::web
