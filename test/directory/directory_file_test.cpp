#include "directory/directory_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "test/directory/test_authority.h"
#include "test/support/temporary_directory.h"

namespace livemap::directory {
namespace {

using testing::HasSubstr;
using testing::Optional;

class DirectoryFileTest : public testing::Test {
 protected:
  DirectoryFileTest() : path_(folder_.path() + "/zones.cms") {
    std::ofstream(folder_.path() + "/ca.pem") << authority_.Pem();
  }

  DirectoryFile Open() const {
    return {TrustedAuthority::Read(folder_.path() + "/ca.pem"), path_, [] { return kMarchNs; }};
  }
  std::string Signed(std::uint64_t version) const {
    return authority_.Sign(DirectoryText(version));
  }
  /// As a person does, `later_s` after the file before.
  void Write(const std::string& bytes, int later_s) const {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
    std::filesystem::last_write_time(
        path_, std::filesystem::last_write_time(path_) + std::chrono::seconds(later_s));
  }

  const TestAuthority authority_;
  const test::TemporaryDirectory folder_;
  const std::string path_;
};

TEST_F(DirectoryFileTest, WhatIsOfferedCountsAtOnceAndIsInTheFileForOthers) {
  DirectoryFile file = Open();
  const std::string bytes = Signed(2);
  EXPECT_EQ(file.Offer(bytes), std::nullopt);
  ASSERT_NE(file.directory(), nullptr);
  EXPECT_EQ(file.directory()->version(), 2U);
  EXPECT_EQ(file.bytes(), bytes);
  EXPECT_FALSE(file.ReadIfChanged()) << "it wrote that itself";
  DirectoryFile other = Open();
  EXPECT_TRUE(other.ReadIfChanged());
  EXPECT_EQ(other.directory()->version(), 2U);
}

TEST_F(DirectoryFileTest, AnOfferIsComparedWithWhatAPersonHasPutThereSince) {
  DirectoryFile file = Open();
  EXPECT_EQ(file.Offer(Signed(2)), std::nullopt);
  Write(Signed(5), 1);
  EXPECT_THAT(file.Offer(Signed(4)), Optional(HasSubstr("accepted is 5 or newer")));
  EXPECT_EQ(file.directory()->version(), 5U);
}

TEST_F(DirectoryFileTest, AnOlderFileThatAPersonPutThereLetsNoOlderOfferIn) {
  DirectoryFile file = Open();
  EXPECT_EQ(file.Offer(Signed(5)), std::nullopt);
  Write(Signed(2), 1);
  EXPECT_THAT(file.Offer(Signed(3)), Optional(HasSubstr("accepted is 5 or newer")));
  EXPECT_EQ(file.directory()->version(), 5U);
}

TEST_F(DirectoryFileTest, TheKnownOneAgainComesBackIntoAFileThatIsGoneOrDamaged) {
  DirectoryFile file = Open();
  const std::string bytes = Signed(2);
  EXPECT_EQ(file.Offer(bytes), std::nullopt);
  std::filesystem::remove(path_);
  EXPECT_EQ(file.Offer(bytes), std::nullopt);
  EXPECT_TRUE(std::filesystem::exists(path_));
  Write("half a file", 1);
  EXPECT_EQ(file.Offer(bytes), std::nullopt);
  EXPECT_EQ(file.damage(), "");
  DirectoryFile other = Open();
  EXPECT_TRUE(other.ReadIfChanged());
  EXPECT_EQ(other.bytes(), bytes);
}

}  // namespace
}  // namespace livemap::directory
