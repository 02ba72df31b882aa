#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace livemap::directory {

/// By this common name, and no vehicle's, an authority signs its zone directory.
constexpr const char* kDirectorySigner = "zone directory";

/// The certificate of an authority, which decides whose signatures count.
class TrustedAuthority {
 public:
  /// Reads a file with one certificate in PEM, as ca.pem of an identity's folder. Throws Error that
  /// names the file when it holds none.
  static TrustedAuthority Read(const std::string& path);

  /// In DER.
  const std::string& certificate() const { return certificate_; }

 private:
  std::string certificate_;
};

/// What a signed document says. `bytes` are CMS SignedData in DER (RFC 5652) with the content in
/// it; `openssl cms -verify -inform DER` reads the same. The signature has to be of one signer,
/// whose certificate is in the document, is valid at `now_ns` (none: at any time), is for signing
/// messages, has the common name `signer`, and is signed by `authority`. A vehicle's own
/// certificate of the same authority does not do: it is for TLS.
///
/// Throws Error that names `name` and what is wrong with it. `bytes` may be anything; at most
/// `max_bytes` of them are looked at.
std::string OpenSignedDocument(const std::string& bytes, const TrustedAuthority& authority,
                               const std::string& signer, std::optional<std::int64_t> now_ns,
                               std::size_t max_bytes, const std::string& name);

}  // namespace livemap::directory
