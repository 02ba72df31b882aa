#include "web/http/cookie.h"

#include <gtest/gtest.h>

namespace livemap::web {
namespace {

TEST(Cookies, AreFoundByTheirWholeName) {
  EXPECT_EQ(CookieValue("a=1; livemap_12=xyz; b=2", "livemap_12"), "xyz");
  EXPECT_EQ(CookieValue("livemap_12=", "livemap_12"), "");
  EXPECT_EQ(CookieValue("livemap_123=xyz", "livemap_12"), "");
  EXPECT_EQ(CookieValue("xlivemap_12=xyz;;; =;", "livemap_12"), "");
  EXPECT_EQ(CookieValue("", "livemap_12"), "");
}

}  // namespace
}  // namespace livemap::web
