// Mutual TLS against a real mosquitto, with certificates made on the spot by the openssl program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mqtt_protocol.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>

#include "common/error.h"
#include "test/transport/broker_process.h"
#include "test/transport/tls_broker.h"
#include "test/transport/waiting.h"
#include "transport/mqtt_client.h"

namespace livemap::transport {
namespace {

using ::testing::HasSubstr;

class MqttTlsTest : public ::testing::Test {
 protected:
  MqttTlsTest() { broker_.Start(); }

  std::string File(const std::string& name) const { return certificates_.File(name); }

  MqttConfig Options(const std::string& name, const std::string& authority) const {
    MqttConfig options;
    options.port = broker_.port();
    options.client_id = name;
    options.reconnect_min_s = 0.05;
    options.reconnect_max_s = 0.5;
    options.tls = certificates_.Tls(name, authority);
    return options;
  }

  const TestCertificates certificates_;
  TlsBroker broker_{certificates_};
};

/// One attempt may end by a reset before the broker's alert is read; the client tries again.
bool Says(const MqttClient& client, const std::string& words) {
  return client.statistics().last_error.find(words) != std::string::npos;
}

TEST_F(MqttTlsTest, ConnectsWithACertificateThatTheBrokersAuthoritySigned) {
  MqttClient car(Options("car-1", "ca"), {}, {});
  EXPECT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  car.Publish("livemap/v1/test/notice", {1, 2, 3}, 1, 0);
  EXPECT_TRUE(Eventually([&] { return car.statistics().published == 1; }));
}

TEST_F(MqttTlsTest, IsNotLetInWithAnotherAuthoritysCertificate) {
  const MqttClient stranger(Options("stranger", "ca"), {}, {});
  EXPECT_TRUE(Eventually([&] { return Says(stranger, "TLS: tlsv1 alert unknown ca"); }));
  EXPECT_EQ(stranger.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, DoesNotTrustABrokerOfAnotherAuthority) {
  const MqttClient car(Options("car-1", "other_ca"), {}, {});
  EXPECT_TRUE(Eventually([&] { return Says(car, "TLS: certificate verify failed"); }));
  EXPECT_EQ(car.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, DoesNotTrustABrokerUnderAnotherName) {
  MqttConfig options = Options("car-1", "ca");
  options.host = "localhost";  // The certificate is for 127.0.0.1.
  const MqttClient car(options, {}, {});
  EXPECT_TRUE(Eventually([&] { return car.statistics().connection_failures >= 2; }));
  EXPECT_EQ(car.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, NamesTheFileThatCannotBeRead) {
  for (auto [name, member] : {std::pair{"ca_file", &MqttTlsConfig::ca_file},
                              {"certificate_file", &MqttTlsConfig::certificate_file},
                              {"key_file", &MqttTlsConfig::key_file}}) {
    for (const std::string& path :
         {std::string("/nowhere.pem"), std::string("/tmp"), std::string()}) {
      MqttConfig options = Options("car-1", "ca");
      (*options.tls).*member = path;
      try {
        const MqttClient car(options, {}, {});
        ADD_FAILURE() << name << " '" << path << "' was accepted";
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr(std::string(name) + " is '" + path + "'"));
      }
    }
  }
}

TEST_F(MqttTlsTest, NamesAFileThatWentAwayAfterTheStartAndGoesOnWhenItIsBack) {
  const MqttConfig options = Options("car-1", "ca");
  const MqttClient car(options, {}, {});
  ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  const std::string& key = options.tls->key_file;
  std::filesystem::rename(key, key + ".away");
  broker_.Kill();
  broker_.Start();
  EXPECT_TRUE(Eventually([&] {
    return Says(car, "cannot read " + key + ", the bridge's key_file: No such file");
  })) << car.statistics().last_error;
  std::filesystem::rename(key + ".away", key);
  EXPECT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
}

TEST_F(MqttTlsTest, NamesATornFileAndGoesOnWhenItIsWhole) {
  const MqttConfig options = Options("car-1", "ca");
  {
    // The broker listens before it has read its own files, of which one is torn here.
    const MqttClient car(options, {}, {});
    ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  }
  for (const auto& [name, path] : {std::pair{"ca_file", options.tls->ca_file},
                                   {"certificate_file", options.tls->certificate_file},
                                   {"key_file", options.tls->key_file}}) {
    const std::string whole = ReadFile(path, 1 << 20);
    for (const std::string& torn :
         {whole.substr(0, whole.size() / 2), std::string(whole.size(), '\0'), std::string()}) {
      std::ofstream(path, std::ios::binary) << torn;
      const MqttClient car(options, {}, {});
      ASSERT_TRUE(Eventually([&, file = path, member = std::string(name)] {
        return Says(car, file + ", the bridge's " + member + ", is torn or no PEM file");
      })) << car.statistics().last_error;
      std::ofstream(path, std::ios::binary) << whole;
      ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
    }
  }
}

TEST_F(MqttTlsTest, DoesNotConnectWithTheKeyOfAnotherCertificate) {
  MqttConfig options = Options("car-1", "ca");
  options.tls->key_file = File("stranger.key");  // Of another certificate.
  const MqttClient car(options, {}, {});
  EXPECT_TRUE(Eventually([&] { return Says(car, "TLS: key values mismatch"); }))
      << car.statistics().last_error;
  EXPECT_EQ(car.statistics().connections, 0U);
}

TEST_F(MqttTlsTest, ConnectsToABrokerWithTheFingerprint) {
  MqttConfig options = Options("car-1", "ca");
  options.fingerprint = certificates_.FingerprintOf("broker");
  MqttClient car(options, {}, {});
  EXPECT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  car.Publish("livemap/v1/test/notice", {1, 2, 3}, 1, 0);
  EXPECT_TRUE(Eventually([&] { return car.statistics().published == 1; }));
  // Also after a loss.
  broker_.Kill();
  broker_.Start();
  EXPECT_TRUE(Eventually([&] { return car.statistics().connections == 2; }))
      << car.statistics().last_error;
}

TEST_F(MqttTlsTest, RefusesABrokerWithAnotherFingerprintAndNamesBoth) {
  MqttConfig options = Options("car-1", "ca");
  options.fingerprint = certificates_.FingerprintOf("car-1");  // Of the same authority.
  std::vector<std::string> losses;
  std::mutex mutex;
  MqttCallbacks callbacks;
  callbacks.on_connection = [&](bool, const std::string& reason) {
    const std::lock_guard<std::mutex> lock(mutex);
    losses.push_back(reason);
  };
  const MqttClient car(options, {}, callbacks);
  ASSERT_TRUE(Eventually([&] { return car.statistics().connection_failures >= 2; }));
  EXPECT_EQ(car.statistics().connections, 0U);
  const std::string sentence = "the broker 127.0.0.1:" + std::to_string(broker_.port()) +
                               " shows a certificate with the fingerprint " +
                               certificates_.FingerprintOf("broker") + ", accepted is " +
                               options.fingerprint;
  EXPECT_EQ(car.statistics().last_error, sentence);
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_FALSE(losses.empty());
  EXPECT_EQ(losses.front(), sentence);
  EXPECT_EQ(broker_.Log().find("car-1"), std::string::npos) << "nothing was told to the broker";
}

TEST_F(MqttTlsTest, TakesTheSecondAddressWhenTheFirstHasAnotherFingerprint) {
  MqttConfig options = Options("car-1", "ca");
  options.fingerprint = std::string(64, '0');
  options.fallbacks = {{"127.0.0.1", broker_.port(), certificates_.FingerprintOf("broker")}};
  std::vector<std::string> events;
  std::mutex mutex;
  MqttCallbacks callbacks;
  callbacks.on_connection = [&](bool connected, const std::string& reason) {
    const std::lock_guard<std::mutex> lock(mutex);
    events.push_back(connected ? "connected" : reason);
  };
  const MqttClient car(options, {}, callbacks);
  ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  EXPECT_EQ(car.statistics().broker, options.fallbacks.front());
  // That the first is not what it should be is told all the same.
  EXPECT_THAT(car.statistics().last_error, HasSubstr("accepted is " + options.fingerprint));
  ASSERT_TRUE(Eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return events.size() == 2;
  }));
  EXPECT_THAT(events[0], HasSubstr("accepted is " + options.fingerprint));
  EXPECT_EQ(events[1], "connected");
}

TEST_F(MqttTlsTest, TakesTheSecondAddressWhenTheFirstHasNoCertificateForItsName) {
  MqttConfig options = Options("car-1", "ca");
  options.host = "localhost";  // The certificate is for 127.0.0.1.
  options.fallbacks = {{"127.0.0.1", broker_.port()}};
  const MqttClient car(options, {}, {});
  ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  EXPECT_EQ(car.statistics().broker.host, "127.0.0.1");
}

TEST_F(MqttTlsTest, AFingerprintReplacesNoOtherCheck) {
  MqttConfig other_name = Options("car-1", "ca");
  other_name.host = "localhost";  // The certificate is for 127.0.0.1.
  MqttConfig other_authority = Options("car-1", "other_ca");
  for (MqttConfig* const options : {&other_name, &other_authority}) {
    options->fingerprint = certificates_.FingerprintOf("broker");
    const MqttClient car(*options, {}, {});
    EXPECT_TRUE(Eventually([&] { return Says(car, "TLS: certificate verify failed"); }))
        << car.statistics().last_error;
    EXPECT_EQ(car.statistics().connections, 0U);
  }
}

TEST_F(MqttTlsTest, AFingerprintThatCannotBeComparedIsNamed) {
  MqttConfig without_tls = Options("car-1", "ca");
  without_tls.tls.reset();
  without_tls.fingerprint = certificates_.FingerprintOf("broker");
  MqttConfig in_capitals = Options("car-1", "ca");
  in_capitals.fallbacks = {{"zone.example.org", 8883, std::string(64, 'A')}};
  const std::string port = std::to_string(broker_.port());
  for (const auto& [options, words] :
       {std::pair{without_tls, "fingerprint of the broker 127.0.0.1:" + port + " is '" +
                                   without_tls.fingerprint +
                                   "', accepted is none where ca_file, certificate_file"},
        {in_capitals, "fingerprint of the broker zone.example.org:8883 is '" +
                          std::string(64, 'A') + "', accepted is 64 hex digits"}}) {
    try {
      const MqttClient car(options, {}, {});
      ADD_FAILURE() << "accepted, not refused by: " << words;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  }
}

/// A zone as `livemap zone` makes it, with its broker.
class ZoneIdentityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Run("init " + zone_ + " --zone test --port " + std::to_string(port_));
    for (const std::string name : {"car-1", "car-2"}) {
      Run("enroll " + name + " --dir " + zone_);
      // To the vehicle's PC.
      std::filesystem::rename(zone_ + "/vehicles/" + name, directory_.path() + "/" + name);
    }
    broker_.Start({"mosquitto", "-c", zone_ + "/mosquitto.conf"}, port_,
                  directory_.path() + "/broker.log");
  }

  void Run(const std::string& arguments) const {
    const std::string log = directory_.path() + "/zone.log";
    const std::string command = std::string("/usr/bin/python3 ") + LIVEMAP_SOURCE_DIR +
                                "/scripts/livemap_zone_identity " + arguments + " > " + log +
                                " 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << ReadFile(log, 1 << 20);
  }

  MqttConfig Options(const std::string& vehicle) const {
    const std::string folder = directory_.path() + "/" + vehicle;
    MqttConfig options;
    options.port = port_;
    options.client_id = vehicle;
    options.reconnect_min_s = 0.05;
    options.reconnect_max_s = 0.5;
    options.tls =
        MqttTlsConfig{folder + "/ca.pem", folder + "/certificate.pem", folder + "/key.pem"};
    return options;
  }

  static std::string Topic(const std::string& vehicle) {
    return "livemap/v1/test/vehicle/" + vehicle + "/report";
  }

  const TemporaryDirectory directory_;
  const std::string zone_ = directory_.path() + "/zone";
  const int port_ = FreePort();
  ChildProcess broker_;
};

TEST_F(ZoneIdentityTest, EveryRefusalOfAPublicationHasItsReason) {
  std::vector<MqttPublishOutcome> outcomes;
  std::mutex mutex;
  MqttCallbacks callbacks;
  callbacks.on_published = [&](const MqttPublishOutcome& outcome) {
    const std::lock_guard<std::mutex> lock(mutex);
    outcomes.push_back(outcome);
  };
  MqttClient car(Options("car-1"), {}, callbacks);
  ASSERT_TRUE(Eventually([&] { return car.connected(); })) << car.statistics().last_error;
  car.Publish(Topic("car-1"), {1}, 1, 0);
  car.Publish(Topic("car-2"), {1}, 1, 1);
  car.Publish(Topic("car-1"), std::vector<std::uint8_t>((1 << 20) + 1), 1, 2);
  ASSERT_TRUE(Eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return outcomes.size() == 3;
  }));
  std::map<std::uint64_t, int> reasons;
  for (const MqttPublishOutcome& outcome : outcomes) reasons[outcome.tag] = outcome.reason_code;
  EXPECT_EQ(reasons[0], MQTT_RC_NO_MATCHING_SUBSCRIBERS);
  EXPECT_EQ(reasons[1], MQTT_RC_NOT_AUTHORIZED);
  EXPECT_EQ(reasons[2], MQTT_RC_PACKET_TOO_LARGE);
}

TEST_F(ZoneIdentityTest, ARevokedVehicleIsThrownOutAndToldThatItIsRevoked) {
  const MqttClient car(Options("car-1"), {}, {});
  const MqttClient other(Options("car-2"), {}, {});
  ASSERT_TRUE(Eventually([&] { return car.connected() && other.connected(); }));
  Run("revoke car-1 --dir " + zone_);
  EXPECT_TRUE(Eventually([&] { return Says(car, "TLS: sslv3 alert certificate revoked"); }));
  EXPECT_EQ(car.statistics().connections, 1U);
  EXPECT_TRUE(other.connected());
  EXPECT_EQ(other.statistics().connections, 1U);
}

}  // namespace
}  // namespace livemap::transport
