#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "transport/mqtt_client.h"

namespace livemap::transport {

/// Makes the TLS context of a client's connections, and looks at the certificate that a broker
/// shows, before anything is sent. The certificate must be of the authority, in time, for the
/// broker's host, and the one of the fingerprint where the broker's address has one. libmosquitto
/// makes no such context itself: its own has no place for the fingerprint, and its check of the
/// host fails with contexts of others (2.0.11). Not thread-safe.
///
/// Typical usage:
///
///     BrokerCertificate certificate;
///     mosquitto_void_option(handle, MOSQ_OPT_SSL_CTX, certificate.context());
///     std::string error = certificate.Expect(address, tls);
///     if (error.empty() && mosquitto_connect(handle, ...) == MOSQ_ERR_SUCCESS) ...
///     if (!certificate.refusal().empty()) Say(certificate.refusal());
class BrokerCertificate {
 public:
  /// Throws Error when OpenSSL makes no context.
  BrokerCertificate();
  BrokerCertificate(const BrokerCertificate&) = delete;
  BrokerCertificate& operator=(const BrokerCertificate&) = delete;

  /// The context for connections to the broker, which calls this object. Who uses it holds a
  /// reference of its own, and makes no connection after this object has gone.
  SSL_CTX* context() const { return context_.get(); }

  /// The next connection is to `broker`, with the files of `tls` as they are now. Returns OpenSSL's
  /// words where these cannot be used; empty: they can.
  std::string Expect(const MqttAddress& broker, const MqttTlsConfig& tls);

  /// One sentence with the two fingerprints where they differ; empty: they do not, or another check
  /// has failed before.
  const std::string& refusal() const { return refusal_; }

 private:
  static int Verify(X509_STORE_CTX* store, void* self);
  bool UseFiles(const MqttTlsConfig& tls);
  bool ExpectHost(const std::string& host);
  bool HasFingerprint(X509* certificate);

  struct Deleter {
    void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  };
  const std::unique_ptr<SSL_CTX, Deleter> context_;
  MqttAddress broker_;
  std::string refusal_;
};

}  // namespace livemap::transport
