// Mutual TLS against a real mosquitto, with certificates made on the spot by the openssl program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "base/error.h"
#include "broker_process.h"
#include "transport/mqtt_client.h"
#include "waiting.h"

namespace livemap {
namespace {

using ::testing::HasSubstr;

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
issue car-1 ca DNS:car-1
issue stranger other_ca DNS:car-1
)";

class MqttTlsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string script = directory_.path() + "/make_certificates";
    std::ofstream(script) << kMakeCertificates;
    const std::string command = "bash " + script + " " + directory_.path() + " > " +
                                directory_.path() + "/openssl.log 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0)
        << ReadFile(directory_.path() + "/openssl.log", 1 << 20);
    std::ofstream(directory_.path() + "/mosquitto.conf")
        << "listener " << port_ << " 127.0.0.1\nallow_anonymous true\nrequire_certificate true\n"
        << "use_identity_as_username true\ntls_version tlsv1.3\ncafile " << File("ca.pem")
        << "\ncertfile " << File("broker.pem") << "\nkeyfile " << File("broker.key")
        << (IsRoot() ? "\nuser root\n" : "\n");
    broker_.Start({"mosquitto", "-c", File("mosquitto.conf")}, port_, File("broker.log"));
  }

  std::string File(const std::string& name) const { return directory_.path() + "/" + name; }

  MqttOptions Options(const std::string& name, const std::string& authority) const {
    MqttOptions options;
    options.port = port_;
    options.client_id = name;
    options.reconnect_min_s = 0.05;
    options.reconnect_max_s = 0.5;
    options.tls = MqttTlsOptions{File(authority), File(name + ".pem"), File(name + ".key")};
    return options;
  }

  const TemporaryDirectory directory_;
  const int port_ = FreePort();
  ChildProcess broker_;
};

TEST_F(MqttTlsTest, ConnectsWithACertificateThatTheBrokersAuthoritySigned) {
  MqttClient car(Options("car-1", "ca.pem"), {}, {});
  EXPECT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  car.Publish("livemap/v1/test/notice", {1, 2, 3}, 1, 0);
  EXPECT_TRUE(Eventually([&] { return car.statistics().published == 1; }));
}

TEST_F(MqttTlsTest, IsNotLetInWithAnotherAuthoritysCertificate) {
  const MqttClient stranger(Options("stranger", "ca.pem"), {}, {});
  EXPECT_TRUE(Eventually([&] { return stranger.statistics().connection_failures >= 2; }));
  EXPECT_EQ(stranger.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, DoesNotTrustABrokerOfAnotherAuthority) {
  const MqttClient car(Options("car-1", "other_ca.pem"), {}, {});
  EXPECT_TRUE(Eventually([&] { return car.statistics().connection_failures >= 2; }));
  EXPECT_EQ(car.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, DoesNotTrustABrokerUnderAnotherName) {
  MqttOptions options = Options("car-1", "ca.pem");
  options.host = "localhost";  // The certificate is for 127.0.0.1.
  const MqttClient car(options, {}, {});
  EXPECT_TRUE(Eventually([&] { return car.statistics().connection_failures >= 2; }));
  EXPECT_EQ(car.statistics().connections, 0U);
}

}  // namespace
}  // namespace livemap
