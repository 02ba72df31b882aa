#pragma once

#include <openssl/evp.h>
#include <openssl/x509.h>

#include <cstdint>
#include <memory>
#include <string>

namespace livemap::directory {

/// An authority as scripts/lib/certificate_authority.py makes it, and what it signs.
class TestAuthority {
 public:
  TestAuthority();
  ~TestAuthority();

  /// What a certificate that it issues says.
  struct Subject {
    std::string name = "zone directory";
    std::string purpose = "emailProtection";
    std::int64_t from_s = 1'767'225'600;   ///< 2026-01-01.
    std::int64_t until_s = 1'798'761'600;  ///< 2027-01-01.
  };

  /// CMS SignedData with `content` in it, by a new key with a certificate for `subject`.
  std::string Sign(const std::string& content, const Subject& subject) const;
  std::string Sign(const std::string& content) const { return Sign(content, Subject{}); }

  /// Its certificate, as ca.pem.
  std::string Pem() const;

 private:
  EVP_PKEY* key_;
  X509* certificate_;
};

/// A directory of one square zone around 40.44 N, 79.95 W.
std::string DirectoryText(std::uint64_t version, const std::string& issued = "2026-02-01T00:00:00Z",
                          const std::string& expires = "2026-05-01T00:00:00Z");

/// 2026-03-01.
constexpr std::int64_t kMarchNs = 1'772'323'200'000'000'000;

}  // namespace livemap::directory
