#pragma once

#include <array>
#include <boost/asio/ssl/context.hpp>
#include <cstdint>
#include <memory>
#include <string>

#include "common/mutex.h"

namespace livemap::web {

/// The server's certificate as it is served now.
struct CertificateState {
  std::int64_t ends_ns = 0;  ///< Until when it is valid, UTC ns since 1970.
  std::uint64_t loads = 0;   ///< How often a pair was taken since the start, the first one too.
  std::string refusal;       ///< Why the pair that is in the files now is not served; else empty.
};

/// A certificate with its private key, of which a new pair in the files takes the place while the
/// server runs. Connections that there are keep the pair that they began with. Thread-safe.
///
/// TLS 1.2 and 1.3 are spoken, with ephemeral keys and authenticated ciphers alone, without
/// renegotiation and compression.
///
/// Typical usage:
///   TlsCertificate certificate("fullchain.pem", "privkey.pem");
///   stream.StartTls(*certificate.context());
///   certificate.Reload(SystemNs());  // Every few seconds.
class TlsCertificate {
 public:
  using Context = boost::asio::ssl::context;

  /// `certificate_file`: PEM, the server's certificate and then those between it and the root.
  /// `key_file`: PEM, its private key without a password, which others than the owner and the group
  /// may neither read nor write. A certificate that has ended is taken: a server that starts anew
  /// must not fail for that. Throws Error that names the file and what is accepted.
  TlsCertificate(std::string certificate_file, std::string key_file);

  /// What new connections speak with.
  std::shared_ptr<Context> context() const;
  CertificateState state() const;
  /// Looks at the files, and takes what is in them when they have changed and lain still since the
  /// last call: so whoever replaces one after the other is not caught in between. A pair that
  /// cannot be used, or that is not valid at `now_ns`, leaves the one before in its place. Never
  /// throws.
  void Reload(std::int64_t now_ns);

 private:
  /// Tells one version of a file from another; all zero where there is none.
  using FileStamp = std::array<std::int64_t, 5>;
  struct Stamps {
    FileStamp certificate{};
    FileStamp key{};
    friend bool operator==(const Stamps& a, const Stamps& b) {
      return a.certificate == b.certificate && a.key == b.key;
    }
  };
  struct Pair {
    std::shared_ptr<Context> context;
    std::int64_t begins_ns = 0;
    std::int64_t ends_ns = 0;
  };

  static FileStamp StampOf(const std::string& path);
  Stamps StampsNow() const;
  Pair Load() const;

  const std::string certificate_file_;
  const std::string key_file_;
  mutable Mutex mutex_;
  std::shared_ptr<Context> context_ GUARDED_BY(mutex_);
  CertificateState state_ GUARDED_BY(mutex_);
  Stamps tried_ GUARDED_BY(mutex_);  ///< Taken or refused.
  Stamps seen_ GUARDED_BY(mutex_);   ///< At the last call.
};

}  // namespace livemap::web
