#pragma once

#include <string>

#include "test/transport/broker_process.h"
#include "transport/mqtt_client.h"

namespace livemap::transport {

/// Keys and certificates in a folder of their own, made by the openssl program: the authorities
/// "ca" and "other_ca"; of "ca" the certificates "broker" and "other_broker" for 127.0.0.1, and
/// "car-1"; of "other_ca" the certificate "stranger". NAME.pem is a certificate, NAME.key its key.
class TestCertificates {
 public:
  TestCertificates();

  std::string File(const std::string& name) const { return directory_.path() + "/" + name; }
  /// SHA-256 of the certificate NAME.pem in DER, as people compute it.
  std::string FingerprintOf(const std::string& name) const;
  /// What a client needs to show the certificate NAME, and to trust `authority`.
  MqttTlsConfig Tls(const std::string& name, const std::string& authority = "ca") const;

 private:
  const TemporaryDirectory directory_;
};

/// A real mosquitto on a free port of 127.0.0.1 that takes certificates of "ca" alone and lets each
/// of their owners do everything.
class TlsBroker {
 public:
  /// `name` is that of its certificate; `certificates` outlive it.
  explicit TlsBroker(const TestCertificates& certificates, std::string name = "broker");
  void Start();
  void Kill() { process_.Kill(); }

  int port() const { return port_; }
  /// What mosquitto has logged.
  std::string Log() const;

 private:
  const TestCertificates& certificates_;
  const std::string name_;
  const int port_ = FreePort();
  ChildProcess process_;
};

}  // namespace livemap::transport
