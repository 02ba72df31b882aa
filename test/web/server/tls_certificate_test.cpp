#include "web/server/tls_certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "common/clock.h"
#include "common/error.h"
#include "test/web/server/tls_files.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kDayNs = 86'400'000'000'000;

void Overwrite(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
  chmod(path.c_str(), 0600);
}

class TlsCertificateTest : public testing::Test {
 protected:
  /// The sentence that refuses the files.
  std::string Refusal() const {
    try {
      const TlsCertificate certificate(files_.certificate(), files_.key());
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }
  /// As a server does that finds new files and sees that they lie still.
  static void ReloadTwice(TlsCertificate& certificate) {
    certificate.Reload(SystemNs());
    certificate.Reload(SystemNs());
  }

  TemporaryFolder folder_;
  const TlsFiles files_{folder_.path()};
};

TEST_F(TlsCertificateTest, KnowsWhenItEnds) {
  files_.Write(-3600, 30 * 86400);
  const TlsCertificate certificate(files_.certificate(), files_.key());
  const std::int64_t left_ns = certificate.state().ends_ns - SystemNs();
  EXPECT_GT(left_ns, 29 * kDayNs);
  EXPECT_LE(left_ns, 30 * kDayNs);
  EXPECT_NE(certificate.context(), nullptr);
}

TEST_F(TlsCertificateTest, OneThatHasEndedStillStartsAServer) {
  files_.Write(-2 * 86400, -86400);
  const TlsCertificate certificate(files_.certificate(), files_.key());
  EXPECT_LT(certificate.state().ends_ns, SystemNs());
}

TEST_F(TlsCertificateTest, RefusesFilesThatAreNotThere) {
  EXPECT_THAT(Refusal(), HasSubstr("server.key"));
  files_.Write();
  std::filesystem::remove(files_.certificate());
  EXPECT_THAT(Refusal(), HasSubstr("server.pem"));
}

TEST_F(TlsCertificateTest, RefusesAKeyThatEverybodyMayRead) {
  files_.Write();
  chmod(files_.key().c_str(), 0644);
  EXPECT_THAT(Refusal(), HasSubstr("may be read or written by everybody"));
  chmod(files_.key().c_str(), 0640);
  EXPECT_EQ(Refusal(), "nothing was refused");
}

TEST_F(TlsCertificateTest, RefusesAKeyWithAPasswordAndAsksNobodyForIt) {
  files_.Write(-3600, 86400, "secret");
  EXPECT_THAT(Refusal(), HasSubstr("accepted is a PEM file with a key that needs no password"));
}

TEST_F(TlsCertificateTest, RefusesAnotherCertificatesKey) {
  files_.Write();
  const TlsFiles other(folder_.path(), "other");
  other.Write();
  std::filesystem::rename(other.key(), files_.key());
  EXPECT_THAT(Refusal(), HasSubstr("is not the key of web_certificate"));
}

TEST_F(TlsCertificateTest, RefusesWhatIsNoPem) {
  files_.Write();
  Overwrite(files_.certificate(), "nonsense");
  EXPECT_THAT(Refusal(), HasSubstr("holds no certificate"));
  files_.Write();
  Overwrite(files_.key(), "nonsense");
  EXPECT_THAT(Refusal(), HasSubstr("holds no private key"));
}

TEST_F(TlsCertificateTest, TakesANewPairOnceItsFilesLieStill) {
  files_.Write();
  TlsCertificate certificate(files_.certificate(), files_.key());
  const auto first = certificate.context();
  ReloadTwice(certificate);
  EXPECT_EQ(certificate.context(), first) << "nothing has changed";
  files_.Write(-3600, 60 * 86400);
  certificate.Reload(SystemNs());
  EXPECT_EQ(certificate.context(), first) << "the files may still be written";
  certificate.Reload(SystemNs());
  EXPECT_NE(certificate.context(), first);
  EXPECT_EQ(certificate.state().loads, 2U);
  EXPECT_EQ(certificate.state().refusal, "");
  EXPECT_GT(certificate.state().ends_ns - SystemNs(), 59 * kDayNs);
}

TEST_F(TlsCertificateTest, KeepsThePairOfBeforeWhereTheNewOneCannotBeUsed) {
  files_.Write();
  TlsCertificate certificate(files_.certificate(), files_.key());
  const auto first = certificate.context();
  Overwrite(files_.certificate(), "nonsense");
  ReloadTwice(certificate);
  EXPECT_EQ(certificate.context(), first);
  EXPECT_THAT(certificate.state().refusal, HasSubstr("holds no certificate"));
  EXPECT_THAT(certificate.state().refusal, HasSubstr("the certificate of before is kept"));
  files_.Write(-2 * 86400, -86400);
  ReloadTwice(certificate);
  EXPECT_EQ(certificate.context(), first);
  EXPECT_THAT(certificate.state().refusal, HasSubstr(", not now"));
  files_.Write(86400, 2 * 86400);
  ReloadTwice(certificate);
  EXPECT_EQ(certificate.context(), first) << "it is not valid yet";
  std::filesystem::remove(files_.key());
  ReloadTwice(certificate);
  EXPECT_EQ(certificate.context(), first);
  EXPECT_THAT(certificate.state().refusal, HasSubstr("cannot be read"));
  files_.Write();
  ReloadTwice(certificate);
  EXPECT_NE(certificate.context(), first);
  EXPECT_EQ(certificate.state().refusal, "");
}

}  // namespace
}  // namespace livemap::web
