#pragma once

#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

namespace livemap::web {

/// A certificate for 127.0.0.1 and localhost that signs itself, with its key, as PEM files of a
/// folder: what a test's server speaks TLS with, and what its clients trust.
class TlsFiles {
 public:
  explicit TlsFiles(const std::string& folder, const std::string& name = "server")
      : certificate_(folder + "/" + name + ".pem"), key_(folder + "/" + name + ".key") {}

  const std::string& certificate() const { return certificate_; }
  const std::string& key() const { return key_; }

  /// Writes a new pair, valid from `begin_s` to `end_s` seconds from now. A password, where one is
  /// given, locks the key.
  void Write(long begin_s = -3600, long end_s = 30 * 86400, const char* password = nullptr) const {
    const Key key(EVP_EC_gen("P-256"), &EVP_PKEY_free);
    const Certificate certificate(X509_new(), &X509_free);
    X509_set_version(certificate.get(), 2);
    ASN1_INTEGER_set_int64(X509_get_serialNumber(certificate.get()), ++Serial());
    X509_gmtime_adj(X509_getm_notBefore(certificate.get()), begin_s);
    X509_gmtime_adj(X509_getm_notAfter(certificate.get()), end_s);
    X509_set_pubkey(certificate.get(), key.get());
    X509_NAME* const name = X509_get_subject_name(certificate.get());
    X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC,
                               reinterpret_cast<const unsigned char*>("livemap test"), -1, -1, 0);
    X509_set_issuer_name(certificate.get(), name);
    AddExtension(certificate.get(), NID_subject_alt_name, "IP:127.0.0.1,DNS:localhost");
    AddExtension(certificate.get(), NID_basic_constraints, "critical,CA:TRUE");
    if (X509_sign(certificate.get(), key.get(), EVP_sha256()) == 0) {
      throw std::runtime_error("a test's certificate cannot be signed");
    }
    WriteFile(key_, [&](std::FILE* file) {
      return PEM_write_PrivateKey(file, key.get(),
                                  password == nullptr ? nullptr : EVP_aes_128_cbc(), nullptr, 0,
                                  nullptr, const_cast<char*>(password));
    });
    chmod(key_.c_str(), 0600);
    WriteFile(certificate_,
              [&](std::FILE* file) { return PEM_write_X509(file, certificate.get()); });
  }

  /// Of the certificate that was written last by anybody.
  static long& Serial() {
    static long serial = 0;
    return serial;
  }

 private:
  using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
  using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;

  static void AddExtension(X509* certificate, int kind, const char* value) {
    X509V3_CTX context;
    X509V3_set_ctx_nodb(&context);
    X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
    const std::unique_ptr<X509_EXTENSION, decltype(&X509_EXTENSION_free)> extension(
        X509V3_EXT_conf_nid(nullptr, &context, kind, value), &X509_EXTENSION_free);
    X509_add_ext(certificate, extension.get(), -1);
  }

  /// Beside the file, then renamed: nobody reads half of it.
  template <typename Write>
  static void WriteFile(const std::string& path, const Write& write) {
    std::FILE* const file = std::fopen((path + ".new").c_str(), "w");
    if (file == nullptr) throw std::runtime_error("'" + path + "' cannot be written");
    const bool is_written = write(file) == 1;
    std::fclose(file);
    if (!is_written) throw std::runtime_error("'" + path + "' cannot be written");
    std::filesystem::rename(path + ".new", path);
  }

  std::string certificate_;
  std::string key_;
};

}  // namespace livemap::web
