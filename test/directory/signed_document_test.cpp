#include "directory/signed_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/directory/test_authority.h"

namespace livemap::directory {
namespace {

using testing::HasSubstr;

class SignedDocumentTest : public testing::Test {
 protected:
  SignedDocumentTest() : trusted_(Trust(authority_)) {}

  static TrustedAuthority Trust(const TestAuthority& authority) {
    const std::string path = testing::TempDir() + "/ca-" +
                             testing::UnitTest::GetInstance()->current_test_info()->name() + ".pem";
    std::ofstream(path) << authority.Pem();
    TrustedAuthority trusted = TrustedAuthority::Read(path);
    std::filesystem::remove(path);
    return trusted;
  }

  std::string Open(const std::string& bytes, std::optional<std::int64_t> now_ns = kMarchNs) const {
    return OpenSignedDocument(bytes, trusted_, kDirectorySigner, now_ns, 1 << 20, "zones.cms");
  }

  /// Why it is refused; "accepted" when it is not.
  std::string WhyNot(const std::string& bytes,
                     std::optional<std::int64_t> now_ns = kMarchNs) const {
    try {
      Open(bytes, now_ns);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }

  const TestAuthority authority_;
  const TrustedAuthority trusted_;
};

TEST_F(SignedDocumentTest, GivesWhatItsAuthoritySigned) {
  EXPECT_EQ(Open(authority_.Sign("a line\r\nwith \0 in it")),
            std::string("a line\r\nwith \0 in it"));
  const std::string zeros(100'000, '\0');
  EXPECT_EQ(Open(authority_.Sign(zeros)), zeros);
}

TEST_F(SignedDocumentTest, AnotherAuthoritysSignatureIsRefused) {
  const TestAuthority forger;
  EXPECT_THAT(WhyNot(forger.Sign("text")), HasSubstr("'zones.cms' is not signed by the authority"));
}

TEST_F(SignedDocumentTest, ACertificateForTlsIsNoSigners) {
  EXPECT_THAT(WhyNot(authority_.Sign("text", {"zone directory", "clientAuth"})),
              HasSubstr("is not signed by the authority"));
}

TEST_F(SignedDocumentTest, AnotherNameOfTheSameAuthorityIsRefused) {
  EXPECT_THAT(WhyNot(authority_.Sign("text", {"vehicle-1"})),
              HasSubstr("is signed by 'vehicle-1', accepted is 'zone directory'"));
}

TEST_F(SignedDocumentTest, ACertificateOutOfItsTimeIsRefusedUnlessTimeDoesNotCount) {
  const std::string bytes = authority_.Sign("text");
  constexpr std::int64_t kYearNs = 365LL * 86'400 * 1'000'000'000;
  EXPECT_THAT(WhyNot(bytes, kMarchNs + kYearNs), HasSubstr("not signed by the authority"));
  EXPECT_THAT(WhyNot(bytes, kMarchNs - kYearNs), HasSubstr("not signed by the authority"));
  EXPECT_EQ(Open(bytes, std::nullopt), "text");
}

TEST_F(SignedDocumentTest, AnyChangedByteIsNoticed) {
  const std::string bytes = authority_.Sign("the text that was signed");
  const std::size_t content = bytes.find("the text");
  ASSERT_NE(content, std::string::npos);
  std::string changed = bytes;
  changed[content] = 'T';
  EXPECT_THAT(WhyNot(changed), HasSubstr("not signed by the authority"));
  for (std::size_t i = 0; i < bytes.size(); i += 7) {
    changed = bytes;
    changed[i] = static_cast<char>(changed[i] ^ 0x20);
    const std::string why_not = WhyNot(changed);
    // A few bits carry no meaning, such as a parameter that is left out or null: what was signed
    // comes out, or nothing.
    if (why_not != "accepted") continue;
    EXPECT_EQ(Open(changed), "the text that was signed") << i;
  }
}

TEST_F(SignedDocumentTest, WhatIsNoDocumentIsRefused) {
  const std::string bytes = authority_.Sign("text");
  for (const std::string& other : {std::string(), std::string("{}"), std::string(5000, '\x30'),
                                   bytes.substr(0, bytes.size() - 1), bytes + "x"}) {
    EXPECT_THAT(WhyNot(other), HasSubstr("'zones.cms' is no signed document")) << other.size();
  }
}

TEST_F(SignedDocumentTest, ATooLongOneIsRefusedUnread) {
  EXPECT_THAT(WhyNot(std::string((1 << 20) + 1, 'x')),
              HasSubstr("'zones.cms' has 1048577 bytes, accepted are at most 1048576"));
}

TEST_F(SignedDocumentTest, AFileWithoutACertificateIsNoAuthority) {
  const std::string path = testing::TempDir() + "/no-authority.pem";
  std::ofstream(path) << "nothing\n";
  try {
    TrustedAuthority::Read(path);
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(path + "' holds no certificate in PEM"));
  }
}

}  // namespace
}  // namespace livemap::directory
