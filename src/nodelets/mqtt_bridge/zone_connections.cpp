#include "nodelets/mqtt_bridge/zone_connections.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <utility>

#include "common/error.h"
#include "transport/mosquitto_handle.h"

namespace livemap::nodelets {

ZoneConnections::ZoneConnections(transport::MqttConfig config, SubscriptionsOf subscriptions_of,
                                 Events events)
    : config_(std::move(config)),
      subscriptions_of_(std::move(subscriptions_of)),
      events_(std::move(events)) {
  transport::CheckMqttOptions(config_);
}

void ZoneConnections::Keep(const std::vector<Zone>& zones) {
  const auto is_kept = [&zones](const auto& connection) {
    return std::any_of(zones.begin(), zones.end(), [&connection](const Zone& zone) {
      return zone.id == connection.first && zone.brokers == connection.second.brokers;
    });
  };
  for (auto connection = connections_.begin(); connection != connections_.end();) {
    if (is_kept(*connection)) {
      ++connection;
      continue;
    }
    // A client that looks up a name ends when that has ended, seconds later where nobody answers.
    ending_.push_back(
        std::async(std::launch::async,
                   [client = std::move(connection->second.client)]() mutable { client.reset(); }));
    connection = connections_.erase(connection);
  }
  ending_.erase(std::remove_if(ending_.begin(), ending_.end(),
                               [](const std::future<void>& end) {
                                 return end.wait_for(std::chrono::seconds(0)) ==
                                        std::future_status::ready;
                               }),
                ending_.end());
  for (const Zone& zone : zones) {
    Connection& connection = connections_[zone.id];
    connection.brokers = zone.brokers;
    if (!connection.client) Connect(zone.id, connection);
  }
}

void ZoneConnections::Connect(const std::string& zone, Connection& connection) const {
  try {
    connection.client = MakeClient(zone, connection.brokers);
    if (followed_of_) connection.client->Follow(followed_of_(zone), followed_qos_);
    connection.fault.clear();
  } catch (const Error& error) {
    if (connection.fault == error.what()) return;
    connection.fault = error.what();
    if (events_.on_connection) events_.on_connection(zone, false, connection.fault);
  }
}

std::unique_ptr<transport::MqttClient> ZoneConnections::MakeClient(
    const std::string& zone, const std::vector<transport::MqttAddress>& brokers) const {
  transport::MqttConfig config = config_;
  config.host = brokers.front().host;
  config.port = brokers.front().port;
  config.fingerprint = brokers.front().fingerprint;
  config.fallbacks.assign(brokers.begin() + 1, brokers.end());
  transport::MqttCallbacks callbacks;
  callbacks.on_published = events_.on_published;
  if (events_.on_message) {
    callbacks.on_message = [this, id = zone](const transport::MqttMessage& message) {
      events_.on_message(id, message);
    };
  }
  if (events_.on_connection) {
    callbacks.on_connection = [this, id = zone](bool connected, const std::string& reason) {
      events_.on_connection(id, connected, reason);
    };
  }
  if (events_.on_followed) {
    callbacks.on_followed = [this, id = zone](const std::vector<std::string>& topics) {
      events_.on_followed(id, topics);
    };
  }
  return std::make_unique<transport::MqttClient>(config, subscriptions_of_(zone),
                                                 std::move(callbacks));
}

void ZoneConnections::Follow(std::function<std::vector<std::string>(const std::string&)> topics_of,
                             int qos) {
  followed_of_ = std::move(topics_of);
  followed_qos_ = qos;
  for (const auto& [zone, connection] : connections_) {
    if (connection.client) connection.client->Follow(followed_of_(zone), qos);
  }
}

transport::MqttClient* ZoneConnections::Find(const std::string& zone) const {
  const auto found = connections_.find(zone);
  return found == connections_.end() ? nullptr : found->second.client.get();
}

std::vector<std::string> ZoneConnections::Waiting() const {
  std::vector<std::string> zones;
  for (const auto& [zone, connection] : connections_) {
    if (!connection.client) continue;
    const transport::MqttStatistics statistics = connection.client->statistics();
    if (statistics.queued + statistics.inflight > 0) zones.push_back(zone);
  }
  return zones;
}

std::map<std::string, transport::MqttStatistics> ZoneConnections::Statistics() const {
  std::map<std::string, transport::MqttStatistics> statistics;
  for (const auto& [zone, connection] : connections_) {
    if (connection.client) {
      statistics[zone] = connection.client->statistics();
      continue;
    }
    statistics[zone].broker = connection.brokers.front();
    statistics[zone].last_error = connection.fault;
  }
  return statistics;
}

}  // namespace livemap::nodelets
