#include "directory/directory_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/directory/test_authority.h"

namespace livemap::directory {
namespace {

using testing::HasSubstr;
using testing::Optional;

class DirectoryKeeperTest : public testing::Test {
 protected:
  DirectoryKeeperTest()
      : folder_(testing::TempDir() + "/" +
                testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ + "/ca.pem") << authority_.Pem();
  }
  ~DirectoryKeeperTest() override { std::filesystem::remove_all(folder_); }

  DirectoryKeeper Open() {
    return {TrustedAuthority::Read(folder_ + "/ca.pem"), Path(), [this] { return now_ns_; }};
  }
  std::string Path() const { return folder_ + "/zones.cms"; }
  std::string Signed(std::uint64_t version) const {
    return authority_.Sign(DirectoryText(version));
  }

  const TestAuthority authority_;
  const std::string folder_;
  std::int64_t now_ns_ = kMarchNs;
};

TEST_F(DirectoryKeeperTest, KeepsTheNewestOverARestart) {
  {
    DirectoryKeeper keeper = Open();
    EXPECT_EQ(keeper.directory(), nullptr);
    EXPECT_EQ(keeper.Offer(Signed(3)), std::nullopt);
    EXPECT_EQ(keeper.Offer(Signed(4)), std::nullopt);
    EXPECT_EQ(keeper.directory()->version(), 4U);
  }
  const DirectoryKeeper keeper = Open();
  EXPECT_EQ(keeper.damage(), "");
  ASSERT_NE(keeper.directory(), nullptr);
  EXPECT_EQ(keeper.directory()->version(), 4U);
}

TEST_F(DirectoryKeeperTest, AnOlderOneIsRefused) {
  DirectoryKeeper keeper = Open();
  EXPECT_EQ(keeper.Offer(Signed(4)), std::nullopt);
  EXPECT_THAT(keeper.Offer(Signed(3)),
              Optional(HasSubstr("has version 3, accepted is 4 or newer")));
  EXPECT_EQ(keeper.directory()->version(), 4U);
}

TEST_F(DirectoryKeeperTest, TheKeptOneAgainIsAcceptedAndAnotherOfItsVersionIsNot) {
  DirectoryKeeper keeper = Open();
  const std::string bytes = Signed(4);
  EXPECT_EQ(keeper.Offer(bytes), std::nullopt);
  EXPECT_EQ(keeper.Offer(bytes), std::nullopt);
  const std::string other = authority_.Sign(DirectoryText(4, "2026-02-02T00:00:00Z"));
  EXPECT_THAT(keeper.Offer(other), Optional(HasSubstr("says something else")));
}

TEST_F(DirectoryKeeperTest, AForgedOneIsRefused) {
  const TestAuthority forger;
  DirectoryKeeper keeper = Open();
  EXPECT_THAT(keeper.Offer(forger.Sign(DirectoryText(9))),
              Optional(HasSubstr("is not signed by the authority")));
  EXPECT_THAT(keeper.Offer(DirectoryText(9)), Optional(HasSubstr("is no signed document")));
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

TEST_F(DirectoryKeeperTest, AVehicleCannotSignOneThatClaimsANeighboursStreets) {
  DirectoryKeeper keeper = Open();
  EXPECT_THAT(keeper.Offer(authority_.Sign(DirectoryText(9), {"vehicle-1", "clientAuth"})),
              Optional(HasSubstr("is not signed by the authority")));
}

TEST_F(DirectoryKeeperTest, AnExpiredOneAndOneOfTheFutureAreRefused) {
  DirectoryKeeper keeper = Open();
  EXPECT_THAT(keeper.Offer(authority_.Sign(
                  DirectoryText(1, "2026-01-02T00:00:00Z", "2026-02-28T23:59:59Z"))),
              Optional(HasSubstr("expired at 2026-02-28T23:59:59Z")));
  EXPECT_THAT(keeper.Offer(authority_.Sign(
                  DirectoryText(1, "2026-03-01T01:00:01Z", "2026-05-01T00:00:00Z"))),
              Optional(HasSubstr("issued at 2026-03-01T01:00:01Z")));
}

TEST_F(DirectoryKeeperTest, WhatExpiresIsNoLongerGivenAndStillKeepsOlderOnesOut) {
  {
    DirectoryKeeper keeper = Open();
    EXPECT_EQ(keeper.Offer(authority_.Sign(
                  DirectoryText(7, "2026-02-01T00:00:00Z", "2026-03-02T00:00:00Z"),
                  {"zone directory", "emailProtection", 1'767'225'600, 1'772'409'600})),
              std::nullopt);
  }
  now_ns_ += 2LL * 86'400 * 1'000'000'000;
  DirectoryKeeper keeper = Open();
  EXPECT_EQ(keeper.damage(), "");
  EXPECT_EQ(keeper.directory(), nullptr);
  EXPECT_THAT(keeper.Offer(Signed(6)), Optional(HasSubstr("accepted is 7 or newer")));
  EXPECT_EQ(keeper.Offer(Signed(8)), std::nullopt);
}

TEST_F(DirectoryKeeperTest, ADamagedFileIsToldAndReplacedByTheNextDirectory) {
  std::ofstream(Path()) << "half a file";
  DirectoryKeeper keeper = Open();
  EXPECT_THAT(keeper.damage(), HasSubstr(Path() + "' is no signed document"));
  EXPECT_EQ(keeper.directory(), nullptr);
  EXPECT_EQ(keeper.Offer(Signed(1)), std::nullopt);
  EXPECT_EQ(Open().directory()->version(), 1U);
}

TEST_F(DirectoryKeeperTest, WhatCannotBeWrittenIsAnErrorAndChangesNothing) {
  DirectoryKeeper keeper(TrustedAuthority::Read(folder_ + "/ca.pem"), folder_ + "/no/zones.cms",
                         [this] { return now_ns_; });
  EXPECT_THROW(keeper.Offer(Signed(1)), Error);
  EXPECT_EQ(keeper.directory(), nullptr);
}

}  // namespace
}  // namespace livemap::directory
