#include "orders/senders/mail_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"
#include "orders/order_text.h"
#include "orders/secret_file.h"
#include "orders/senders/webhook_sender.h"

namespace livemap::orders {
namespace {

using testing::HasSubstr;
using testing::Not;

Order MailedOrder() {
  Order order;
  order.uuid = *Uuid::Parse("11111111-2222-4333-8444-555555555555");
  order.created_ns = 1'767'225'600'000'000'000;
  order.content.label = "Pothole";
  order.content.position = {40.44, -79.94};
  order.content.place = "Forbes Ave, near S Craig St, eastbound";
  return order;
}

TEST(MailMessageTest, IsTheSameByteByByteWhenItIsSentAgain) {
  const Order order = MailedOrder();
  const std::string message = MailMessage(order, "map@city.example", {"roads@city.example"});
  EXPECT_EQ(message, MailMessage(order, "map@city.example", {"roads@city.example"}));
  EXPECT_THAT(message, HasSubstr("Date: Thu, 1 Jan 2026 00:00:00 +0000\r\n"));
  EXPECT_THAT(message,
              HasSubstr("Message-ID: <11111111-2222-4333-8444-555555555555@city.example>\r\n"));
}

TEST(MailMessageTest, NoTextOfAStrangerBecomesAHeader) {
  Order order = MailedOrder();
  order.content.place = "Forbes Ave\r\nBcc: everybody@city.example\r\n\r\n.\r\nQUIT";
  order.content.label = "Pot\nX-Evil: yes";
  order.content.reason = "\r\n.\r\nMAIL FROM:<x@y.example>";
  const std::string message = MailMessage(order, "map@city.example", {"roads@city.example"});
  EXPECT_THAT(message, Not(HasSubstr("Bcc")));
  EXPECT_THAT(message, Not(HasSubstr("X-Evil")));
  EXPECT_THAT(message, Not(HasSubstr("MAIL FROM")));
  EXPECT_THAT(message, Not(HasSubstr("\r\n.\r\n")));
}

TEST(MailMessageTest, RefusesAnAddressThatCarriesAHeaderOrASecondAddress) {
  for (const char* address :
       {"a@b.example\r\nBcc: c@d.example", "a@b.example, c@d.example", "<a@b.example>", "a b@c.d",
        "a@b@c.example", "@b.example", "a@", "\"a\"@b.example", "a@b.example>", "a;b@c.example"}) {
    EXPECT_FALSE(IsMailAddress(address)) << address;
    EXPECT_THROW(MailMessage(MailedOrder(), "map@city.example", {address}), Error) << address;
  }
  EXPECT_TRUE(IsMailAddress("road-team+night@city.example"));
}

TEST(MailMessageTest, EveryLineIsShortAndOfAscii) {
  Order order = MailedOrder();
  for (int i = 0; i < 40; ++i) order.content.place += "Straße ";
  const std::string message = MailMessage(order, "map@city.example", {"roads@city.example"});
  std::size_t length = 0;
  for (const char c : message) {
    EXPECT_LT(static_cast<unsigned char>(c), 0x80);
    length = c == '\n' ? 0 : length + 1;
    ASSERT_LT(length, 100U);
  }
}

TEST(OrderTextTest, MakesOneLineOfAnyText) {
  EXPECT_EQ(OneLine("a\r\nb\t\x7f\xff", 100), "a??b???");
  EXPECT_EQ(OneLine("\xc3\xa4\xc3\xb6\xc3\xbc", 5), "\xc3\xa4\xc3\xb6");
  EXPECT_EQ(OneLine("  a ", 100), "a");
}

TEST(OrderTextTest, ThePublicDescriptionNamesNoPerson) {
  Order order = MailedOrder();
  order.content.official = "miller";
  order.content.reason = "seen by miller";
  EXPECT_THAT(DescriptionOf(order), Not(HasSubstr("miller")));
  EXPECT_THAT(DescriptionOf(order), HasSubstr(ReferenceOf(order)));
  EXPECT_THAT(JsonOf(order), HasSubstr("\"official\":\"miller\""));
}

TEST(WebhookSenderTest, SignsAsRfc4231Says) {
  // Test case 2 of RFC 4231.
  EXPECT_EQ(HmacSha256Hex("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

TEST(SecretFileTest, AnErrorThatRepeatsTheSecretHoldsItNoMore) {
  EXPECT_EQ(WithoutSecret("key abc is no key, abc", "abc"), "key *** is no key, ***");
  EXPECT_EQ(WithoutSecret("all well", ""), "all well");
}

}  // namespace
}  // namespace livemap::orders
