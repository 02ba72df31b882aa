#include "test/transport/tls_broker.h"

#include <cstdlib>
#include <fstream>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"

namespace livemap::transport {
namespace {

constexpr char kMakeCertificates[] = R"(
set -e
cd "$1"
for ca in ca other_ca; do
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 \
    -subj "/CN=$ca" -keyout $ca.key -out $ca.pem
done
issue() {  # name, authority, subject alternative name
  openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj "/CN=$1" \
    -keyout $1.key -out $1.csr
  echo "subjectAltName=$3" > $1.ext
  openssl x509 -req -in $1.csr -CA $2.pem -CAkey $2.key -CAcreateserial -days 2 \
    -extfile $1.ext -out $1.pem
}
issue broker ca IP:127.0.0.1
issue other_broker ca IP:127.0.0.1
issue car-1 ca DNS:car-1
issue stranger other_ca DNS:car-1
)";

}  // namespace

TestCertificates::TestCertificates() {
  std::ofstream(File("make_certificates")) << kMakeCertificates;
  const std::string command = "bash " + File("make_certificates") + " " + directory_.path() +
                              " > " + File("openssl.log") + " 2>&1";
  if (std::system(command.c_str()) != 0) throw Error(ReadFile(File("openssl.log"), 1 << 20));
}

std::string TestCertificates::FingerprintOf(const std::string& name) const {
  const std::string command = "openssl x509 -in " + File(name + ".pem") +
                              " -outform DER | sha256sum > " + File("fingerprint");
  if (std::system(command.c_str()) != 0) throw Error("no fingerprint of " + name);
  return ReadFile(File("fingerprint"), 1 << 10).substr(0, 64);
}

MqttTlsConfig TestCertificates::Tls(const std::string& name, const std::string& authority) const {
  return {File(authority + ".pem"), File(name + ".pem"), File(name + ".key")};
}

TlsBroker::TlsBroker(const TestCertificates& certificates, std::string name)
    : certificates_(certificates), name_(std::move(name)) {}

void TlsBroker::Start() {
  const std::string configuration = certificates_.File(name_ + ".conf");
  std::ofstream(configuration) << "listener " << port_ << " 127.0.0.1\nallow_anonymous true\n"
                               << "require_certificate true\nuse_identity_as_username true\n"
                               << "tls_version tlsv1.3\ncafile " << certificates_.File("ca.pem")
                               << "\ncertfile " << certificates_.File(name_ + ".pem")
                               << "\nkeyfile " << certificates_.File(name_ + ".key")
                               << (IsRoot() ? "\nuser root\n" : "\n");
  process_.Start({"mosquitto", "-c", configuration}, port_, certificates_.File(name_ + ".log"));
}

std::string TlsBroker::Log() const { return ReadFile(certificates_.File(name_ + ".log"), 1 << 20); }

}  // namespace livemap::transport
