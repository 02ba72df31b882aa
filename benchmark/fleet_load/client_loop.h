#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "transport/mosquitto_handle.h"
#include "transport/mqtt_client.h"

namespace livemap::bench {

/// Thousands of MQTT v5 clients in one thread, each with a connection, an id and a login of its
/// own: transport::MqttClient would take a thread for each. A client that loses its connection
/// stays away. Not thread-safe.
class ClientLoop {
 public:
  struct Client {
    std::string id;
    std::string password;
    std::vector<transport::MqttSubscription> subscriptions;
  };
  struct Events {
    std::function<void(std::size_t client, const transport::MqttMessage&)> on_message;
    std::function<void(std::size_t client, const std::string& reason)> on_lost;
    /// Of the topics of Follow, those that the broker has granted; whenever they are others.
    std::function<void(std::size_t client, const std::vector<std::string>& topics)> on_followed;
  };
  /// What went over a client's TCP connection.
  struct Traffic {
    std::uint64_t sent_bytes = 0;  ///< That the other end acknowledged.
    std::uint64_t received_bytes = 0;
  };

  /// `common` has what all clients share.
  ClientLoop(transport::MqttConfig common, Events events);
  ~ClientLoop();
  ClientLoop(const ClientLoop&) = delete;
  ClientLoop& operator=(const ClientLoop&) = delete;

  /// Connects; the login is answered later. Its number counts from 0. Throws Error when the broker
  /// cannot be reached or the process may open no more connections.
  std::size_t Connect(const Client& client);
  /// All its subscriptions are granted.
  bool IsReady(std::size_t client) const;
  /// False when the connection is lost.
  bool Publish(std::size_t client, const std::string& topic,
               const std::vector<std::uint8_t>& payload, int qos);
  /// As transport::MqttClient::Follow, with QoS 1.
  void Follow(std::size_t client, const std::vector<std::string>& topics);
  /// Waits up to `timeout_ms` for the network and does what there is to do.
  void Poll(int timeout_ms);
  Traffic TrafficOf(std::size_t client) const;

  std::size_t size() const { return connections_.size(); }
  std::size_t connected() const { return connected_; }

 private:
  struct Connection;
  static void OnConnect(mosquitto* handle, void* self, int reason, int flags,
                        const mosquitto_property* properties);
  static void OnSubscribe(mosquitto* handle, void* self, int id, int count, const int* granted,
                          const mosquitto_property* properties);
  static void OnMessage(mosquitto* handle, void* self, const mosquitto_message* message,
                        const mosquitto_property* properties);
  void Serve(Connection& connection, std::uint32_t events);
  void Flush(Connection& connection);
  void Lose(Connection& connection, const std::string& reason);
  void KeepAlive();

  const transport::MqttConfig common_;
  const Events events_;
  int epoll_ = -1;
  std::vector<std::unique_ptr<Connection>> connections_;
  std::size_t connected_ = 0;
  std::size_t next_kept_ = 0;  ///< Whose keep-alive is looked at next.
  std::int64_t kept_ns_ = 0;
};

}  // namespace livemap::bench
