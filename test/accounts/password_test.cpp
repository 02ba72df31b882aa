#include "accounts/password.h"

#include <argon2.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace livemap::accounts {
namespace {

TEST(Password, LongPrintableTextIsAcceptedInAnyScript) {
  EXPECT_TRUE(IsAcceptablePassword("correct horse battery"));
  EXPECT_TRUE(IsAcceptablePassword("пароль-города"));
  EXPECT_TRUE(IsAcceptablePassword(std::string(kMaxPasswordBytes, 'a')));
  EXPECT_FALSE(IsAcceptablePassword("eleven byte"));
  EXPECT_FALSE(IsAcceptablePassword(std::string(kMaxPasswordBytes + 1, 'a')));
  EXPECT_FALSE(IsAcceptablePassword("a line\nand another"));
  EXPECT_FALSE(IsAcceptablePassword("not UTF-8 at all \xff"));
}

TEST(Password, IsKnownByItsHashAlone) {
  const std::string hash = HashPassword("correct horse battery");
  EXPECT_THAT(hash, testing::StartsWith("$argon2id$v=19$m=65536,t=3,p=4$"));
  EXPECT_TRUE(IsPasswordOf("correct horse battery", hash));
  EXPECT_FALSE(IsPasswordOf("correct horse batterz", hash));
  EXPECT_NE(HashPassword("correct horse battery"), hash) << "two hashes have one salt";
}

TEST(Password, AHashThatAsksForOtherMemoryIsNotComputed) {
  EXPECT_FALSE(IsPasswordOf("password", "$argon2id$v=19$m=4194304,t=3,p=4$c29tZXNhbHQ$AAAA"));
  EXPECT_FALSE(IsPasswordOf("password", ""));
  EXPECT_FALSE(IsPasswordOf("password", "$argon2id$v=19$m=65536,t=3,p=4$"));
}

TEST(Password, NobodysHashIsComputedAndFitsNothing) {
  EXPECT_EQ(argon2id_verify(kNobodysHash, "password", 8), ARGON2_VERIFY_MISMATCH);
}

TEST(Password, RandomHexHasTwoDigitsForAByte) {
  EXPECT_THAT(RandomHex(16), testing::MatchesRegex("[0-9a-f]{32}"));
  EXPECT_NE(RandomHex(16), RandomHex(16));
}

}  // namespace
}  // namespace livemap::accounts
