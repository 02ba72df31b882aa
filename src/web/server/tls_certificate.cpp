#include "web/server/tls_certificate.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "common/time.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

namespace ssl = boost::asio::ssl;

constexpr std::size_t kMaxPemBytes = 1 << 20;
/// Of TLS 1.2; those of 1.3 are all of this kind.
constexpr const char* kCiphers = "ECDHE+AESGCM:ECDHE+CHACHA20";
constexpr const char* kGroups = "X25519:P-256:P-384";

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using X509Pointer = std::unique_ptr<X509, decltype(&X509_free)>;
using KeyPointer = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

Bio BioOf(const std::string& text) {
  return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), &BIO_free};
}

/// Without it OpenSSL asks for a password on the terminal.
int NoPassword(char* /*buffer*/, int /*size*/, int /*writes*/, void* /*user*/) { return -1; }

/// What OpenSSL says of its last failure, in brackets; empty where it says nothing.
std::string OpenSslWords() {
  const unsigned long code = ERR_peek_last_error();
  const char* const reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  ERR_clear_error();
  return reason == nullptr ? "" : std::string(" (OpenSSL: ") + reason + ")";
}

void RefuseReadableKey(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    throw Error("web_key '" + path + "' cannot be read: " + std::strerror(errno));
  }
  if ((status.st_mode & (S_IROTH | S_IWOTH)) != 0) {
    throw Error("web_key '" + path +
                "' may be read or written by everybody, accepted is mode 0600 or 0640");
  }
}

X509Pointer ParseCertificate(const std::string& path, const std::string& pem) {
  X509Pointer certificate(PEM_read_bio_X509(BioOf(pem).get(), nullptr, &NoPassword, nullptr),
                          &X509_free);
  if (certificate) return certificate;
  throw Error("web_certificate '" + path +
              "' holds no certificate, accepted is a PEM file with the server's certificate and "
              "then those between it and the root" +
              OpenSslWords());
}

KeyPointer ParseKey(const std::string& path, const std::string& pem) {
  KeyPointer key(PEM_read_bio_PrivateKey(BioOf(pem).get(), nullptr, &NoPassword, nullptr),
                 &EVP_PKEY_free);
  if (key) return key;
  throw Error("web_key '" + path +
              "' holds no private key, accepted is a PEM file with a key that needs no password" +
              OpenSslWords());
}

std::int64_t TimeOf(const ASN1_TIME* time) {
  std::tm utc{};
  if (ASN1_TIME_to_tm(time, &utc) != 1) return 0;
  return Nanoseconds(static_cast<double>(timegm(&utc)));
}

/// HTTP/1.1 is what there is; without a common protocol none is named.
int SelectProtocol(SSL* /*connection*/, const unsigned char** out, unsigned char* out_size,
                   const unsigned char* in, unsigned int in_size, void* /*user*/) {
  static constexpr unsigned char kSpoken[] = {8, 'h', 't', 't', 'p', '/', '1', '.', '1'};
  unsigned char* selected = nullptr;
  const int found =
      SSL_select_next_proto(&selected, out_size, kSpoken, sizeof kSpoken, in, in_size);
  *out = selected;
  return found == OPENSSL_NPN_NEGOTIATED ? SSL_TLSEXT_ERR_OK : SSL_TLSEXT_ERR_NOACK;
}

void SetProtocols(SSL_CTX* context) {
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION |
                                   SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_PRIORITIZE_CHACHA);
  SSL_CTX_set_alpn_select_cb(context, &SelectProtocol, nullptr);
  if (SSL_CTX_set_cipher_list(context, kCiphers) != 1 ||
      SSL_CTX_set1_groups_list(context, kGroups) != 1) {
    throw Error("this machine's OpenSSL has none of the ciphers that the web server speaks" +
                OpenSslWords());
  }
}

}  // namespace

TlsCertificate::TlsCertificate(std::string certificate_file, std::string key_file)
    : certificate_file_(std::move(certificate_file)), key_file_(std::move(key_file)) {
  const Stamps stamps = StampsNow();
  Pair pair = Load();
  const MutexLock lock(mutex_);
  context_ = std::move(pair.context);
  state_.ends_ns = pair.ends_ns;
  state_.loads = 1;
  tried_ = seen_ = stamps;
}

std::shared_ptr<TlsCertificate::Context> TlsCertificate::context() const {
  const MutexLock lock(mutex_);
  return context_;
}

CertificateState TlsCertificate::state() const {
  const MutexLock lock(mutex_);
  return state_;
}

TlsCertificate::FileStamp TlsCertificate::StampOf(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return {};
  return {static_cast<std::int64_t>(status.st_ino), static_cast<std::int64_t>(status.st_size),
          static_cast<std::int64_t>(status.st_mode),
          static_cast<std::int64_t>(status.st_mtim.tv_sec),
          static_cast<std::int64_t>(status.st_mtim.tv_nsec)};
}

TlsCertificate::Stamps TlsCertificate::StampsNow() const {
  return {StampOf(certificate_file_), StampOf(key_file_)};
}

TlsCertificate::Pair TlsCertificate::Load() const {
  RefuseReadableKey(key_file_);
  const std::string chain_pem = ReadTextFile(certificate_file_, kMaxPemBytes);
  const std::string key_pem = ReadTextFile(key_file_, kMaxPemBytes);
  const X509Pointer certificate = ParseCertificate(certificate_file_, chain_pem);
  const KeyPointer key = ParseKey(key_file_, key_pem);
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    ERR_clear_error();
    throw Error("web_key '" + key_file_ + "' is not the key of web_certificate '" +
                certificate_file_ + "'");
  }
  Pair pair;
  pair.begins_ns = TimeOf(X509_get0_notBefore(certificate.get()));
  pair.ends_ns = TimeOf(X509_get0_notAfter(certificate.get()));
  pair.context = std::make_shared<Context>(Context::tls_server);
  SetProtocols(pair.context->native_handle());
  boost::system::error_code failure;
  pair.context->use_certificate_chain(boost::asio::buffer(chain_pem), failure);
  if (failure) {
    throw Error("web_certificate '" + certificate_file_ +
                "' is not accepted by this machine's OpenSSL: " + failure.message());
  }
  if (SSL_CTX_use_PrivateKey(pair.context->native_handle(), key.get()) != 1) {
    throw Error("web_key '" + key_file_ + "' is not accepted by this machine's OpenSSL" +
                OpenSslWords());
  }
  return pair;
}

void TlsCertificate::Reload(std::int64_t now_ns) {
  const Stamps now = StampsNow();
  {
    const MutexLock lock(mutex_);
    const bool lay_still = now == seen_;
    seen_ = now;
    if (now == tried_ || !lay_still) return;
    tried_ = now;
  }
  std::string refusal;
  Pair pair;
  try {
    pair = Load();
    if (pair.ends_ns <= now_ns || pair.begins_ns > now_ns) {
      throw Error("web_certificate '" + certificate_file_ + "' is valid from " +
                  Rfc3339(pair.begins_ns) + " to " + Rfc3339(pair.ends_ns) + ", not now");
    }
  } catch (const std::exception& error) {
    refusal = std::string(error.what()) + "; the certificate of before is kept";
  }
  const MutexLock lock(mutex_);
  state_.refusal = std::move(refusal);
  if (!state_.refusal.empty()) return;
  context_ = std::move(pair.context);
  state_.ends_ns = pair.ends_ns;
  ++state_.loads;
}

}  // namespace livemap::web
