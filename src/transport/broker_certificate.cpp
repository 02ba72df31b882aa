#include "transport/broker_certificate.h"

#include <openssl/err.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>

#include "common/error.h"
#include "common/sha256.h"

namespace livemap::transport {

BrokerCertificate::BrokerCertificate() : context_(SSL_CTX_new(TLS_client_method())) {
  if (!context_ || SSL_CTX_set_min_proto_version(context_.get(), TLS1_3_VERSION) != 1) {
    throw Error("OpenSSL makes no context for TLS 1.3 connections to brokers");
  }
  SSL_CTX_set_mode(context_.get(), SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, nullptr);
  SSL_CTX_set_cert_verify_callback(context_.get(), &BrokerCertificate::Verify, this);
}

std::string BrokerCertificate::Expect(const MqttAddress& broker, const MqttTlsConfig& tls) {
  broker_ = broker;
  refusal_.clear();
  ERR_clear_error();
  if (UseFiles(tls) && ExpectHost(broker.host)) return "";
  const char* const words = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  return words != nullptr ? words : "the certificates cannot be used";
}

bool BrokerCertificate::UseFiles(const MqttTlsConfig& tls) {
  // A new one each time: an authority that the file no longer has is trusted no longer.
  X509_STORE* const trusted = X509_STORE_new();
  if (trusted == nullptr) return false;
  SSL_CTX_set_cert_store(context_.get(), trusted);  // Owns it from here on.
  return X509_STORE_load_file(trusted, tls.ca_file.c_str()) == 1 &&
         SSL_CTX_use_certificate_chain_file(context_.get(), tls.certificate_file.c_str()) == 1 &&
         SSL_CTX_use_PrivateKey_file(context_.get(), tls.key_file.c_str(), SSL_FILETYPE_PEM) == 1 &&
         SSL_CTX_check_private_key(context_.get()) == 1;
}

bool BrokerCertificate::ExpectHost(const std::string& host) {
  X509_VERIFY_PARAM* const expected = SSL_CTX_get0_param(context_.get());
  // The last broker's name and address count no more.
  if (X509_VERIFY_PARAM_set1_host(expected, nullptr, 0) != 1 ||
      X509_VERIFY_PARAM_set1_ip(expected, nullptr, 0) != 1) {
    return false;
  }
  if (X509_VERIFY_PARAM_set1_ip_asc(expected, host.c_str()) == 1) return true;
  ERR_clear_error();  // It is no address, so it is a name.
  X509_VERIFY_PARAM_set_hostflags(expected, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
  return X509_VERIFY_PARAM_set1_host(expected, host.data(), host.size()) == 1;
}

int BrokerCertificate::Verify(X509_STORE_CTX* store, void* self) {
  auto& certificate = *static_cast<BrokerCertificate*>(self);
  if (X509_verify_cert(store) != 1) return 0;
  if (!certificate.HasFingerprint(X509_STORE_CTX_get0_cert(store))) {
    X509_STORE_CTX_set_error(store, X509_V_ERR_APPLICATION_VERIFICATION);
    return 0;
  }
  return 1;
}

bool BrokerCertificate::HasFingerprint(X509* certificate) {
  if (broker_.fingerprint.empty()) return true;
  unsigned char* der = nullptr;
  const int size = i2d_X509(certificate, &der);
  const std::string shown = size > 0 ? Sha256Hex(der, static_cast<std::size_t>(size)) : "none";
  OPENSSL_free(der);
  if (shown == broker_.fingerprint) return true;
  refusal_ = "the broker " + broker_.host + ":" + std::to_string(broker_.port) +
             " shows a certificate with the fingerprint " + shown + ", accepted is " +
             broker_.fingerprint;
  return false;
}

}  // namespace livemap::transport
