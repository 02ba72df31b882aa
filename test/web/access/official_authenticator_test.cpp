#include "web/access/official_authenticator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

using Verdict = OfficialAuthenticator::Verdict;
using testing::HasSubstr;
using testing::ThrowsMessage;

const std::string kToken = "0123456789abcdef0123456789abcdef";
const std::string kOther = "fedcba9876543210fedcba9876543210";
const std::string kShort = "0123456789abcdef";

TEST(ParseTokenFile, ReadsNamesAndForgetsTokens) {
  const auto officials = ParseTokenFile(
      "# the city\n\nmiller " + kToken + "\nK\xc3\xb6nig " + kOther + "\r\n", "tokens");
  ASSERT_EQ(officials.size(), 2U);
  EXPECT_EQ(officials[0].name, "miller");
  EXPECT_EQ(officials[1].name, "K\xc3\xb6nig");
  EXPECT_EQ(officials[0].token_sha256.find(kToken), std::string::npos);
}

TEST(ParseTokenFile, NamesTheBadLineAndNeverShowsAToken) {
  const std::vector<std::string> refused{kToken,
                                         "miller short",
                                         "miller  " + kToken,
                                         "miller " + kToken + " x",
                                         "miller " + std::string(300, 'a'),
                                         "miller " + kToken + "\xc3\xa4",
                                         " " + kToken,
                                         std::string("mil\x01ler ") + kToken};
  for (const std::string& bad : refused) {
    try {
      ParseTokenFile("# comment\n" + bad, "tokens");
      FAIL() << bad << " was accepted";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("token file 'tokens', line 2, is not accepted"));
      EXPECT_THAT(error.what(), testing::Not(HasSubstr(kToken)));
    }
  }
}

TEST(ParseTokenFile, ATokenSpeaksForOthersWhereTheWordStandsBehindIt) {
  const auto officials =
      ParseTokenFile("miller " + kToken + "\nmetro " + kOther + " speaks-for-others", "tokens");
  ASSERT_EQ(officials.size(), 2U);
  EXPECT_FALSE(officials[0].speaks_for_others);
  EXPECT_TRUE(officials[1].speaks_for_others);
  for (const char* word :
       {"speaks", "speaks-for-others x", " speaks-for-others", "SPEAKS-FOR-OTHERS"}) {
    EXPECT_THROW(ParseTokenFile("metro " + kOther + ' ' + word, "tokens"), Error) << word;
  }
}

TEST(ParseTokenFile, RefusesNobodyAndTheSameTwice) {
  EXPECT_THAT([] { ParseTokenFile("# nobody\n", "tokens"); },
              ThrowsMessage<Error>(HasSubstr("names nobody")));
  EXPECT_THROW(ParseTokenFile("a " + kToken + "\nb " + kToken, "tokens"), Error);
  EXPECT_THROW(ParseTokenFile("a " + kToken + "\na " + kOther, "tokens"), Error);
}

TEST(ReadTokenFile, RefusesAFileThatEverybodyMayRead) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/tokens";
  std::ofstream(path) << "miller " << kToken << "\n";
  ASSERT_EQ(chmod(path.c_str(), 0644), 0);
  EXPECT_THAT([&] { ReadTokenFile(path); },
              ThrowsMessage<Error>(HasSubstr("may be read or written by everybody")));
  ASSERT_EQ(chmod(path.c_str(), 0640), 0);
  EXPECT_EQ(ReadTokenFile(path).size(), 1U);
  EXPECT_THAT([&] { ReadTokenFile(folder.path()); },
              ThrowsMessage<Error>(HasSubstr("is no regular file")));
  EXPECT_THAT([&] { ReadTokenFile(path + "x"); },
              ThrowsMessage<Error>(HasSubstr("cannot be read")));
}

TEST(ReadTokenFile, MarksAndLineEndsOfOtherSystemsDoNotCount) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/tokens";
  std::ofstream(path, std::ios::binary)
      << "\xef\xbb\xbfmiller " << kToken << " \r\nmeier " << kOther;
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  EXPECT_EQ(ReadTokenFile(path).size(), 2U);
  std::ofstream(path, std::ios::binary) << "\xff\xfem";
  EXPECT_THAT([&] { ReadTokenFile(path); }, ThrowsMessage<Error>(HasSubstr("UTF-16")));
}

class OfficialGateTest : public testing::Test {
 protected:
  Verdict Try(const std::string& token, double now_s = 0, const std::string& client = "10.0.0.1") {
    return gate_.Check("Bearer " + token, client, now_s).verdict;
  }

  OfficialAuthenticator gate_{
      ParseTokenFile("miller " + kToken + "\nsmith " + kOther + "\nbrown " + kShort, "tokens")};
};

TEST_F(OfficialGateTest, KnowsWhoseTokenItIs) {
  EXPECT_EQ(gate_.Check("Bearer " + kToken, "a", 0).official, "miller");
  EXPECT_EQ(gate_.Check("bearer " + kOther, "a", 0).official, "smith");
}

TEST_F(OfficialGateTest, RefusesOtherTokensAndForms) {
  EXPECT_EQ(Try(kToken.substr(1)), Verdict::kWrongToken);
  EXPECT_EQ(Try(kToken + "0"), Verdict::kWrongToken);
  EXPECT_EQ(Try(std::string(1000000, 'x')), Verdict::kWrongToken);
  for (const std::string header : {"", "Bearer", "Bearer ", "Basic bWlsbGVyOg==", "Token"}) {
    EXPECT_EQ(gate_.Check(header, "a", 0).verdict, Verdict::kNoToken) << header;
  }
  EXPECT_EQ(gate_.Check(kToken, "a", 0).verdict, Verdict::kNoToken);
}

TEST_F(OfficialGateTest, WithoutOfficialsItStaysClosed) {
  OfficialAuthenticator nobody({});
  EXPECT_EQ(nobody.Check("Bearer " + kToken, "a", 0).verdict, Verdict::kClosed);
  EXPECT_FALSE(nobody.is_open());
}

TEST_F(OfficialGateTest, AfterTooManyWrongTokensNoShortOneIsLookedAtForAWhile) {
  for (int i = 0; i < OfficialAuthenticator::kMaxWrong; ++i)
    EXPECT_EQ(Try("wrong"), Verdict::kWrongToken);
  EXPECT_EQ(Try("wrong"), Verdict::kTooManyWrong);
  EXPECT_EQ(Try(kShort), Verdict::kTooManyWrong);
  EXPECT_FALSE(gate_.IsRight("Bearer " + kShort, "10.0.0.1", 0));
  EXPECT_EQ(Try(kShort, 0, "10.0.0.2"), Verdict::kAllowed) << "another client is kept out too";
  EXPECT_EQ(Try(kShort, OfficialAuthenticator::kSecondsPerWrong + 1), Verdict::kAllowed);
  EXPECT_EQ(Try("wrong", OfficialAuthenticator::kSecondsPerWrong + 1), Verdict::kWrongToken);
  EXPECT_EQ(Try("wrong", OfficialAuthenticator::kSecondsPerWrong + 1), Verdict::kTooManyWrong);
}

TEST_F(OfficialGateTest, ALongTokenPassesHoweverManyWrongOnesItsAddressSends) {
  for (int i = 0; i <= OfficialAuthenticator::kMaxWrong; ++i) Try("wrong");
  EXPECT_EQ(gate_.Check("Bearer " + kToken, "10.0.0.1", 0).official, "miller");
  EXPECT_TRUE(gate_.IsRight("Bearer " + kToken, "10.0.0.1", 0));
  EXPECT_EQ(Try(kOther.substr(1) + "x"), Verdict::kTooManyWrong);
  EXPECT_FALSE(gate_.IsRight("Bearer " + kOther.substr(1) + "x", "10.0.0.1", 0));
}

TEST_F(OfficialGateTest, ManyClientsDoNotFillTheMemoryNorFreeTheOneThatGoesOn) {
  for (int i = 0; i < OfficialAuthenticator::kMaxWrong; ++i) Try("wrong", 0, "guesser");
  for (int i = 0; i < 4000; ++i) Try("wrong", 0, std::to_string(i));
  EXPECT_EQ(Try("wrong", 0, "guesser"), Verdict::kTooManyWrong);
  for (int i = 0; i < 20000; ++i) Try("wrong", 0, std::to_string(i));
  EXPECT_EQ(Try(kToken, 0, "new"), Verdict::kAllowed);
}

}  // namespace
}  // namespace livemap::web
