// Connections to several zones, each with a real mosquitto of its own.
#include "nodelets/mqtt_bridge/zone_connections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <set>
#include <utility>

#include "common/error.h"
#include "test/transport/broker_process.h"
#include "test/transport/tls_broker.h"
#include "test/transport/waiting.h"

namespace livemap::nodelets {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using transport::BrokerProcess;
using transport::Eventually;
using transport::MqttAddress;

constexpr char kPassword[] = "password-of-the-vehicle";

std::vector<std::uint8_t> BytesOf(const std::string& text) { return {text.begin(), text.end()}; }

class ZoneConnectionsTest : public ::testing::Test {
 protected:
  ZoneConnectionsTest() {
    StartFor(west_);
    StartFor(east_);
  }

  /// A vehicle has one password for all brokers of an authority.
  static void StartFor(BrokerProcess& broker) {
    broker.SetPassword("car-1", kPassword);
    broker.Start();
  }

  static transport::MqttConfig Config() {
    transport::MqttConfig config;
    config.client_id = "car-1";
    config.user = "car-1";
    config.password = kPassword;
    config.reconnect_min_s = 0.05;
    config.reconnect_max_s = 0.2;
    return config;
  }

  static std::vector<transport::MqttSubscription> SubscriptionsOf(const std::string& zone) {
    return {{"livemap/v1/" + zone + "/notice", 1}};
  }

  ZoneConnections::Events Events() {
    ZoneConnections::Events events;
    events.on_message = [this](const std::string& zone, const transport::MqttMessage& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      messages_.emplace(zone, std::string(reinterpret_cast<const char*>(message.payload.data),
                                          message.payload.size));
    };
    events.on_published = [this](const transport::MqttPublishOutcome& outcome) {
      const std::lock_guard<std::mutex> lock(mutex_);
      outcomes_.push_back(outcome);
    };
    events.on_connection = [this](const std::string& zone, bool connected,
                                  const std::string& reason) {
      const std::lock_guard<std::mutex> lock(mutex_);
      connected ? void(++logins_[zone]) : losses_[zone].push_back(reason);
    };
    return events;
  }

  static ZoneConnections::Zone At(const std::string& id, const BrokerProcess& broker) {
    return {id, {{"127.0.0.1", broker.port()}}};
  }

  bool IsConnected(const std::string& zone) const {
    const transport::MqttClient* const client = connections_.Find(zone);
    return client != nullptr && client->connected();
  }
  bool HasSubscribed(const std::string& zone) const {
    return connections_.Statistics().at(zone).subscriptions_granted == 1;
  }

  /// What the broker's zone tells all vehicles.
  static void Announce(const BrokerProcess& broker, const std::string& zone,
                       const std::string& payload) {
    transport::MqttConfig config;
    config.port = broker.port();
    config.client_id = "zone";
    config.user = "zone";
    config.password = broker.Password("zone");
    transport::MqttClient client(config, {}, {});
    client.Publish("livemap/v1/" + zone + "/notice", BytesOf(payload), 1, 0);
    ASSERT_TRUE(Eventually([&client] { return client.statistics().published == 1; }));
  }

  std::set<std::pair<std::string, std::string>> messages() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  std::vector<transport::MqttPublishOutcome> outcomes() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return outcomes_;
  }
  std::map<std::string, int> logins() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return logins_;
  }
  std::map<std::string, std::vector<std::string>> losses() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return losses_;
  }

  BrokerProcess west_{"west"};
  BrokerProcess east_{"east"};
  mutable std::mutex mutex_;
  std::set<std::pair<std::string, std::string>> messages_;  ///< Zone, payload.
  std::vector<transport::MqttPublishOutcome> outcomes_;
  std::map<std::string, int> logins_;                                  ///< By zone.
  std::map<std::string, std::vector<std::string>> losses_;             ///< Reasons by zone.
  ZoneConnections connections_{Config(), &SubscriptionsOf, Events()};  ///< Last: it calls events.
};

TEST_F(ZoneConnectionsTest, ConnectsToTheZonesKeptAndEndsTheOthers) {
  EXPECT_EQ(connections_.Find("west"), nullptr);
  connections_.Keep({At("west", west_), At("east", east_)});
  EXPECT_TRUE(Eventually([this] { return IsConnected("west") && IsConnected("east"); }));
  connections_.Keep({At("east", east_)});
  EXPECT_EQ(connections_.Find("west"), nullptr);
  EXPECT_TRUE(IsConnected("east"));
  connections_.Keep({});
  EXPECT_EQ(connections_.Find("east"), nullptr);
  EXPECT_THAT(connections_.Statistics(), IsEmpty());
}

TEST_F(ZoneConnectionsTest, AConnectionThatStandsIsNotMadeAnew) {
  connections_.Keep({At("west", west_)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  const transport::MqttClient* const before = connections_.Find("west");
  connections_.Keep({At("east", east_), At("west", west_)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("east"); }));
  connections_.Keep({At("west", west_)});
  EXPECT_EQ(connections_.Find("west"), before);
  EXPECT_EQ(connections_.Statistics().at("west").connections, 1U);
  EXPECT_THAT(losses(), IsEmpty());
}

TEST_F(ZoneConnectionsTest, AZoneThatComesBackIsConnectedAgain) {
  for (int i = 0; i < 2; ++i) {
    connections_.Keep({At("west", west_)});
    ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
    connections_.Keep({});
  }
  EXPECT_THAT(logins(), ElementsAre(Pair("west", 2)));
}

TEST_F(ZoneConnectionsTest, TakesTheSecondBrokerWhenTheFirstDoesNotAnswer) {
  const MqttAddress silent{"127.0.0.1", transport::FreePort()};
  connections_.Keep({{"west", {silent, {"127.0.0.1", west_.port()}}}});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  EXPECT_EQ(connections_.Statistics().at("west").broker.port, west_.port());
}

TEST_F(ZoneConnectionsTest, GoesToTheSecondBrokerWhenTheFirstDies) {
  BrokerProcess other("west");
  StartFor(other);
  connections_.Keep({{"west", {{"127.0.0.1", west_.port()}, {"127.0.0.1", other.port()}}}});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  EXPECT_EQ(connections_.Statistics().at("west").broker.port, west_.port());
  west_.Kill();
  ASSERT_TRUE(Eventually([&] {
    return IsConnected("west") && connections_.Statistics().at("west").broker.port == other.port();
  }));
}

TEST_F(ZoneConnectionsTest, AZoneWhoseBrokersChangedIsConnectedAnew) {
  BrokerProcess other("west");
  StartFor(other);
  connections_.Keep({At("west", west_)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  connections_.Keep({At("west", other)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  EXPECT_EQ(connections_.Statistics().at("west").broker.port, other.port());
  EXPECT_THAT(logins(), ElementsAre(Pair("west", 2)));
}

TEST_F(ZoneConnectionsTest, MessagesCarryTheZoneOfTheirConnection) {
  connections_.Keep({At("west", west_), At("east", east_)});
  ASSERT_TRUE(Eventually([this] { return HasSubscribed("west") && HasSubscribed("east"); }));
  Announce(west_, "west", "hole in the west");
  Announce(east_, "east", "hole in the east");
  ASSERT_TRUE(Eventually([this] { return messages().size() == 2; }));
  EXPECT_THAT(messages(),
              ElementsAre(Pair("east", "hole in the east"), Pair("west", "hole in the west")));
}

TEST_F(ZoneConnectionsTest, ConnectionEventsCarryTheZoneOfTheirConnection) {
  connections_.Keep({At("west", west_), At("east", east_)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west") && IsConnected("east"); }));
  EXPECT_THAT(logins(), ElementsAre(Pair("east", 1), Pair("west", 1)));
  east_.Kill();
  ASSERT_TRUE(Eventually([this] { return losses().count("east") != 0; }));
  ASSERT_TRUE(Eventually([this] { return losses()["east"].size() > 1; }));
  EXPECT_THAT(losses()["east"].back(), HasSubstr(std::to_string(east_.port())));
  EXPECT_EQ(losses().count("west"), 0U);
  EXPECT_TRUE(IsConnected("west"));
}

TEST_F(ZoneConnectionsTest, AZoneForWhichMessagesWaitIsNamedUntilTheyAreAnswered) {
  BrokerProcess late("late");
  connections_.Keep({At("west", west_), At("late", late)});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  EXPECT_THAT(connections_.Waiting(), IsEmpty());
  connections_.Find("late")->Publish("livemap/v1/late/vehicle/car-1/report", BytesOf("hole"), 1, 7);
  EXPECT_THAT(connections_.Waiting(), ElementsAre("late"));
  StartFor(late);
  ASSERT_TRUE(Eventually([this] { return connections_.Waiting().empty(); }));
  ASSERT_TRUE(Eventually([this] { return outcomes().size() == 1; }));
  EXPECT_EQ(outcomes()[0].tag, 7U);
  EXPECT_TRUE(outcomes()[0].accepted()) << outcomes()[0].reason;
}

TEST_F(ZoneConnectionsTest, StatisticsAreThoseOfEachZone) {
  connections_.Keep({At("west", west_), {"gone", {{"127.0.0.1", transport::FreePort()}}}});
  ASSERT_TRUE(Eventually([this] { return IsConnected("west"); }));
  connections_.Find("west")->Publish("livemap/v1/west/vehicle/car-1/report", BytesOf("hole"), 1, 0);
  ASSERT_TRUE(Eventually([this] {
    const auto statistics = connections_.Statistics();
    return statistics.at("west").published == 1 && statistics.at("gone").connection_failures > 0;
  }));
  const auto statistics = connections_.Statistics();
  EXPECT_EQ(statistics.size(), 2U);
  EXPECT_TRUE(statistics.at("west").connected);
  EXPECT_FALSE(statistics.at("gone").connected);
  EXPECT_EQ(statistics.at("gone").published, 0U);
  EXPECT_NE(statistics.at("gone").last_error, "");
}

TEST_F(ZoneConnectionsTest, AFingerprintWithoutTlsKeepsTheZoneAwayAndNoOther) {
  const std::string fingerprint(64, 'a');
  const ZoneConnections::Zone marked{"marked", {{"127.0.0.1", east_.port(), fingerprint}}};
  for (int i = 0; i < 2; ++i) connections_.Keep({marked, At("west", west_)});
  EXPECT_TRUE(Eventually([this] { return IsConnected("west"); }));
  EXPECT_EQ(connections_.Find("marked"), nullptr);
  EXPECT_THAT(connections_.Waiting(), IsEmpty());
  const transport::MqttStatistics statistics = connections_.Statistics().at("marked");
  EXPECT_FALSE(statistics.connected);
  EXPECT_EQ(statistics.broker.port, east_.port());
  EXPECT_THAT(statistics.last_error,
              HasSubstr("'" + fingerprint + "', accepted is none where ca_file"));
  EXPECT_THAT(losses(), ElementsAre(Pair("marked", ElementsAre(statistics.last_error))));
  // A newer directory says something else.
  connections_.Keep({At("marked", east_), At("west", west_)});
  EXPECT_TRUE(Eventually([this] { return IsConnected("marked"); }));
}

TEST(ZoneConnectionsConfigTest, ABadOptionIsNamedAtTheStart) {
  transport::MqttConfig config;
  config.client_id = "car-1";
  config.keepalive_s = 1;
  try {
    const ZoneConnections connections(config, {}, {});
    ADD_FAILURE() << "it was accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("keepalive_s is '1'"));
  }
}

/// A vehicle and the brokers of two zones, with certificates of one authority.
class ZoneConnectionsTlsTest : public ::testing::Test {
 protected:
  ZoneConnectionsTlsTest() {
    west_.Start();
    east_.Start();
  }

  transport::MqttConfig Config() const {
    transport::MqttConfig config;
    config.client_id = "car-1";
    config.reconnect_min_s = 0.05;
    config.reconnect_max_s = 0.2;
    config.tls = certificates_.Tls("car-1");
    return config;
  }

  std::string FingerprintOf(const std::string& name) const {
    return certificates_.FingerprintOf(name);
  }

  const transport::TestCertificates certificates_;
  transport::TlsBroker west_{certificates_, "broker"};
  transport::TlsBroker east_{certificates_, "other_broker"};
};

TEST_F(ZoneConnectionsTlsTest, OneIdentityIsConnectedToTwoZonesAtOnce) {
  ZoneConnections connections(
      Config(), [](const std::string&) { return std::vector<transport::MqttSubscription>(); }, {});
  connections.Keep({{"west", {{"127.0.0.1", west_.port(), FingerprintOf("broker")}}},
                    {"east", {{"127.0.0.1", east_.port(), FingerprintOf("other_broker")}}}});
  for (const std::string zone : {"west", "east"}) {
    transport::MqttClient& client = *connections.Find(zone);
    EXPECT_TRUE(Eventually([&] { return client.connected(); })) << client.statistics().last_error;
    client.Publish("livemap/v1/" + zone + "/vehicle/car-1/report", BytesOf("hole"), 1, 0);
    EXPECT_TRUE(Eventually([&] { return client.statistics().published == 1; }));
  }
  for (const auto& [zone, statistics] : connections.Statistics()) {
    EXPECT_TRUE(statistics.connected) << zone;
    EXPECT_EQ(statistics.connections, 1U) << zone;
  }
}

TEST_F(ZoneConnectionsTlsTest, OneZonesBrokerIsNotTakenForAnothersOfTheSameAuthority) {
  ZoneConnections connections(
      Config(), [](const std::string&) { return std::vector<transport::MqttSubscription>(); }, {});
  // The second address is the zone's own broker.
  connections.Keep({{"east",
                     {{"127.0.0.1", west_.port(), FingerprintOf("other_broker")},
                      {"127.0.0.1", east_.port(), FingerprintOf("other_broker")}}}});
  transport::MqttClient& client = *connections.Find("east");
  ASSERT_TRUE(Eventually([&] { return client.connected(); })) << client.statistics().last_error;
  EXPECT_EQ(client.statistics().broker.port, east_.port());
}

}  // namespace
}  // namespace livemap::nodelets
