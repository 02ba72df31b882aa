#include "fleet_load/client_loop.h"

#include <mqtt_protocol.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <set>
#include <utility>
// The system's own structure: that of netinet has no counters of bytes.
#include <linux/tcp.h>

#include "common/clock.h"
#include "common/error.h"

namespace livemap::bench {
namespace {

constexpr int kMostEvents = 512;
constexpr std::int64_t kKeepAliveLookNs = 5'000'000'000;

}  // namespace

struct ClientLoop::Connection {
  ClientLoop* loop = nullptr;
  std::size_t number = 0;
  std::vector<transport::MqttSubscription> subscriptions;
  transport::MosquittoHandle handle;
  int socket = -1;
  std::size_t granted = 0;
  std::set<std::string> followed;
  std::map<int, std::string> asking;  ///< Of them, not answered yet, by packet id.
  std::set<std::string> heard;        ///< Of them, granted.
  std::uint64_t callbacks = 0;        ///< So far: whether a reading brought anything.
  bool is_lost = false;
  bool waits_to_write = false;
};

ClientLoop::ClientLoop(transport::MqttConfig common, Events events)
    : common_(std::move(common)), events_(std::move(events)), epoll_(epoll_create1(EPOLL_CLOEXEC)) {
  if (epoll_ < 0) throw Error(std::string("epoll cannot be used: ") + std::strerror(errno));
}

ClientLoop::~ClientLoop() {
  for (const auto& connection : connections_) {
    if (!connection->is_lost) {
      mosquitto_disconnect_v5(connection->handle.get(), MQTT_RC_NORMAL_DISCONNECTION, nullptr);
    }
  }
  close(epoll_);
}

std::size_t ClientLoop::Connect(const Client& client) {
  transport::MqttConfig config = common_;
  config.client_id = config.user = client.id;
  config.password = client.password;
  auto connection = std::make_unique<Connection>();
  connection->loop = this;
  connection->number = connections_.size();
  connection->subscriptions = client.subscriptions;
  const transport::MqttAddress broker{config.host, config.port, config.fingerprint};
  connection->handle = transport::MakeMosquittoHandle(config, nullptr, connection.get());
  mosquitto* const handle = connection->handle.get();
  mosquitto_connect_v5_callback_set(handle, &OnConnect);
  mosquitto_subscribe_v5_callback_set(handle, &OnSubscribe);
  mosquitto_message_v5_callback_set(handle, &OnMessage);
  const int code = transport::ConnectMosquitto(handle, config, broker, config.host);
  if (code != MOSQ_ERR_SUCCESS) {
    throw Error("client '" + client.id +
                "' cannot connect to the broker: " + transport::DescribeMosquittoError(code));
  }
  connection->socket = mosquitto_socket(handle);
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.ptr = connection.get();
  if (epoll_ctl(epoll_, EPOLL_CTL_ADD, connection->socket, &event) != 0) {
    throw Error(std::string("epoll cannot be used: ") + std::strerror(errno));
  }
  Flush(*connection);
  ++connected_;
  connections_.push_back(std::move(connection));
  return connections_.size() - 1;
}

bool ClientLoop::IsReady(std::size_t client) const {
  const Connection& connection = *connections_[client];
  return !connection.is_lost && connection.granted >= connection.subscriptions.size();
}

bool ClientLoop::Publish(std::size_t client, const std::string& topic,
                         const std::vector<std::uint8_t>& payload, int qos) {
  Connection& connection = *connections_[client];
  if (connection.is_lost) return false;
  const int code = mosquitto_publish_v5(connection.handle.get(), nullptr, topic.c_str(),
                                        static_cast<int>(payload.size()), payload.data(), qos,
                                        /*retain=*/false, nullptr);
  if (code != MOSQ_ERR_SUCCESS) {
    Lose(connection, transport::DescribeMosquittoError(code));
    return false;
  }
  Flush(connection);
  return true;
}

void ClientLoop::Follow(std::size_t client, const std::vector<std::string>& topics) {
  Connection& connection = *connections_[client];
  if (connection.is_lost) return;
  mosquitto* const handle = connection.handle.get();
  const std::set<std::string> wanted(topics.begin(), topics.end());
  for (auto topic = connection.followed.begin(); topic != connection.followed.end();) {
    if (wanted.count(*topic) != 0) {
      ++topic;
      continue;
    }
    mosquitto_unsubscribe_v5(handle, nullptr, topic->c_str(), nullptr);
    connection.heard.erase(*topic);
    topic = connection.followed.erase(topic);
  }
  for (const std::string& topic : wanted) {
    if (!connection.followed.insert(topic).second) continue;
    int id = 0;
    mosquitto_subscribe_v5(handle, &id, topic.c_str(), 1, 0, nullptr);
    connection.asking[id] = topic;
  }
  Flush(connection);
}

void ClientLoop::Poll(int timeout_ms) {
  std::array<epoll_event, kMostEvents> events{};
  const int count = epoll_wait(epoll_, events.data(), kMostEvents, timeout_ms);
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    Serve(*static_cast<Connection*>(event.data.ptr), event.events);
  }
  KeepAlive();
}

void ClientLoop::Serve(Connection& connection, std::uint32_t events) {
  if (connection.is_lost) return;
  mosquitto* const handle = connection.handle.get();
  if ((events & ~std::uint32_t{EPOLLOUT}) != 0) {
    std::uint64_t before = 0;
    do {
      before = connection.callbacks;
      const int code = mosquitto_loop_read(handle, 1);
      if (code != MOSQ_ERR_SUCCESS) {
        return Lose(connection, transport::DescribeMosquittoError(code));
      }
    } while (connection.callbacks != before);
  }
  Flush(connection);
}

/// Writes what waits, and has epoll tell when the rest can be written.
void ClientLoop::Flush(Connection& connection) {
  mosquitto* const handle = connection.handle.get();
  if (mosquitto_want_write(handle)) {
    const int code = mosquitto_loop_write(handle, 1);
    if (code != MOSQ_ERR_SUCCESS) {
      return Lose(connection, transport::DescribeMosquittoError(code));
    }
  }
  const bool waits = mosquitto_want_write(handle);
  if (waits == connection.waits_to_write) return;
  connection.waits_to_write = waits;
  epoll_event event{};
  event.events = waits ? EPOLLIN | EPOLLOUT : EPOLLIN;
  event.data.ptr = &connection;
  epoll_ctl(epoll_, EPOLL_CTL_MOD, connection.socket, &event);
}

void ClientLoop::Lose(Connection& connection, const std::string& reason) {
  if (connection.is_lost) return;
  connection.is_lost = true;
  // The library may have closed it already, which ends its place in epoll, too.
  epoll_ctl(epoll_, EPOLL_CTL_DEL, connection.socket, nullptr);
  --connected_;
  if (events_.on_lost) events_.on_lost(connection.number, reason);
}

void ClientLoop::KeepAlive() {
  const std::int64_t now_ns = SteadyNs();
  if (connections_.empty() || (next_kept_ == 0 && now_ns - kept_ns_ < kKeepAliveLookNs)) return;
  if (next_kept_ == 0) kept_ns_ = now_ns;
  const std::size_t end = std::min(next_kept_ + 100, connections_.size());
  for (; next_kept_ < end; ++next_kept_) {
    Connection& connection = *connections_[next_kept_];
    if (connection.is_lost) continue;
    const int code = mosquitto_loop_misc(connection.handle.get());
    if (code != MOSQ_ERR_SUCCESS) Lose(connection, transport::DescribeMosquittoError(code));
  }
  if (next_kept_ == connections_.size()) next_kept_ = 0;
}

ClientLoop::Traffic ClientLoop::TrafficOf(std::size_t client) const {
  const Connection& connection = *connections_[client];
  tcp_info info{};
  socklen_t size = sizeof(info);
  if (connection.is_lost ||
      getsockopt(connection.socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) {
    return {};
  }
  return {info.tcpi_bytes_acked, info.tcpi_bytes_received};
}

void ClientLoop::OnConnect(mosquitto* handle, void* self, int reason, int /*flags*/,
                           const mosquitto_property* /*properties*/) {
  auto& connection = *static_cast<Connection*>(self);
  ++connection.callbacks;
  if (reason != MQTT_RC_SUCCESS) {
    return connection.loop->Lose(connection, transport::DescribeReason(reason));
  }
  for (const transport::MqttSubscription& subscription : connection.subscriptions) {
    mosquitto_subscribe_v5(handle, nullptr, subscription.filter.c_str(), subscription.qos, 0,
                           nullptr);
  }
}

void ClientLoop::OnSubscribe(mosquitto* /*handle*/, void* self, int id, int count,
                             const int* granted, const mosquitto_property* /*properties*/) {
  auto& connection = *static_cast<Connection*>(self);
  ++connection.callbacks;
  const auto asking = connection.asking.find(id);
  if (asking != connection.asking.end()) {
    const bool is_granted = count == 1 && granted[0] < MQTT_RC_UNSPECIFIED;
    if (is_granted && connection.followed.count(asking->second) != 0) {
      connection.heard.insert(asking->second);
    }
    connection.asking.erase(asking);
    if (connection.asking.empty() && connection.loop->events_.on_followed) {
      connection.loop->events_.on_followed(connection.number,
                                           {connection.heard.begin(), connection.heard.end()});
    }
    return;
  }
  for (int i = 0; i < count; ++i) {
    if (granted[i] < MQTT_RC_UNSPECIFIED) ++connection.granted;
  }
}

void ClientLoop::OnMessage(mosquitto* /*handle*/, void* self, const mosquitto_message* message,
                           const mosquitto_property* /*properties*/) {
  auto& connection = *static_cast<Connection*>(self);
  ++connection.callbacks;
  if (!connection.loop->events_.on_message) return;
  connection.loop->events_.on_message(connection.number,
                                      {message->topic,
                                       {static_cast<const std::uint8_t*>(message->payload),
                                        static_cast<std::size_t>(message->payloadlen)}});
}

}  // namespace livemap::bench
