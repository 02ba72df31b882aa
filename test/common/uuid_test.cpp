#include "common/uuid.h"

#include <gtest/gtest.h>

#include <set>

namespace livemap {
namespace {

TEST(Uuid, TextRoundTrips) {
  std::mt19937_64 generator(1);
  const Uuid uuid = Uuid::Random(generator);
  ASSERT_TRUE(Uuid::Parse(uuid.ToString()).has_value());
  EXPECT_EQ(*Uuid::Parse(uuid.ToString()), uuid);
}

TEST(Uuid, RandomCarriesVersion4AndTheRfcVariant) {
  std::mt19937_64 generator(2);
  for (int i = 0; i < 100; ++i) {
    const std::string text = Uuid::Random(generator).ToString();
    EXPECT_EQ(text[14], '4') << text;
    EXPECT_NE(std::string("89ab").find(text[19]), std::string::npos) << text;
  }
}

TEST(Uuid, SameSeedGivesTheSameUuidsAndNoneTwice) {
  std::mt19937_64 a(3), b(3);
  std::set<Uuid> seen;
  for (int i = 0; i < 1000; ++i) {
    const Uuid uuid = Uuid::Random(a);
    EXPECT_EQ(uuid, Uuid::Random(b));
    EXPECT_TRUE(seen.insert(uuid).second);
  }
}

TEST(Uuid, MalformedTextIsRefused) {
  for (const char* text :
       {"", "0", "00000000000000000000000000000000000g", "00000000-0000-0000-0000-00000000000g",
        "000000000-000-0000-0000-000000000000", "00000000-0000-0000-0000-0000000000000"}) {
    EXPECT_FALSE(Uuid::Parse(text).has_value()) << text;
  }
}

}  // namespace
}  // namespace livemap
