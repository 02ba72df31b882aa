#pragma once

#include <functional>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "transport/mqtt_client.h"

namespace livemap::nodelets {

/// The bridge's connections to brokers, one for each zone. Not thread-safe. It calls its events on
/// the network threads of the connections, and on_connection in Keep, too, where a connection
/// cannot be made.
///
/// Typical usage:
///
///     ZoneConnections connections(config.mqtt, subscriptions_of, events);
///     connections.Keep({{"centre", {{"centre.example.org", 8883}}}});
///     if (transport::MqttClient* client = connections.Find("centre")) client->Publish(...);
class ZoneConnections {
 public:
  /// A zone and where its broker is: the first address that answers is taken.
  struct Zone {
    std::string id;
    std::vector<transport::MqttAddress> brokers;  ///< At least one.
  };

  /// As transport::MqttCallbacks, with the id of the zone. Functions that are empty are not called.
  struct Events {
    std::function<void(const std::string& zone, const transport::MqttMessage&)> on_message;
    std::function<void(const transport::MqttPublishOutcome&)> on_published;
    std::function<void(const std::string& zone, bool connected, const std::string& reason)>
        on_connection;
    std::function<void(const std::string& zone, const std::vector<std::string>& topics)>
        on_followed;
  };

  /// What a connection to the zone with this id subscribes to.
  using SubscriptionsOf =
      std::function<std::vector<transport::MqttSubscription>(const std::string&)>;

  /// `config` is that of each connection but for the broker's address. Throws Error naming a bad
  /// option.
  ZoneConnections(transport::MqttConfig config, SubscriptionsOf subscriptions_of, Events events);

  /// Connects to `zones` and ends all other connections. Those that stand stay, unless their
  /// brokers have changed; then what waits there is lost. One that ends may do so
  /// after this returns. A zone whose connection cannot be made (a fingerprint without TLS, a key
  /// file that is gone) is told by on_connection, takes nothing from the others, and is tried again
  /// at the next call.
  void Keep(const std::vector<Zone>& zones);

  /// Every connection, also one that is made later, follows these topics, which `topics_of` names
  /// for the zone with this id, as MqttClient::Follow.
  void Follow(std::function<std::vector<std::string>(const std::string&)> topics_of, int qos);

  /// The connection to a zone; null: there is none.
  transport::MqttClient* Find(const std::string& zone) const;
  /// Ids of the zones for which messages wait to be sent or to be answered.
  std::vector<std::string> Waiting() const;
  /// Of each connection, by the zone's id.
  std::map<std::string, transport::MqttStatistics> Statistics() const;

 private:
  struct Connection {
    std::vector<transport::MqttAddress> brokers;
    std::unique_ptr<transport::MqttClient> client;  ///< Null: it could not be made.
    std::string fault;                              ///< Why not.
  };

  void Connect(const std::string& zone, Connection& connection) const;
  std::unique_ptr<transport::MqttClient> MakeClient(
      const std::string& zone, const std::vector<transport::MqttAddress>& brokers) const;

  const transport::MqttConfig config_;
  const SubscriptionsOf subscriptions_of_;
  const Events events_;
  std::function<std::vector<std::string>(const std::string&)> followed_of_;
  int followed_qos_ = 1;
  std::map<std::string, Connection> connections_;
  std::vector<std::future<void>> ending_;  ///< Last: what ends still calls events_.
};

}  // namespace livemap::nodelets
