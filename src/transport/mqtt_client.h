#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "transport/byte_view.h"

namespace livemap::transport {

/// Mutual TLS 1.3: the broker must show a certificate that `ca_file` signed, for the name in
/// MqttConfig::host; the client shows its own. PEM files, all three required.
struct MqttTlsConfig {
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
};

/// Where a broker listens.
struct MqttAddress {
  std::string host;
  int port = 1883;
  /// SHA-256 of the broker's certificate in DER, 64 lower-case hex digits; empty: any certificate
  /// that MqttTlsConfig accepts for this host. Needs TLS.
  std::string fingerprint = {};
  bool operator==(const MqttAddress& other) const {
    return host == other.host && port == other.port && fingerprint == other.fingerprint;
  }
};

/// How to reach a broker and how much to hold back. Every connection speaks MQTT v5.
struct MqttConfig {
  std::string host = "127.0.0.1";
  int port = 1883;
  std::string fingerprint;  ///< Of the broker at host and port, as MqttAddress::fingerprint.
  /// Other addresses of the broker: each attempt takes the first that answers, shows a certificate
  /// that is accepted and accepts the login, in this order after host and port. They are checked as
  /// those are.
  std::vector<MqttAddress> fallbacks;
  std::string client_id;  ///< Required. The broker may replace it by the user name.
  std::string user;       ///< Empty: no login.
  std::string password;
  bool clean_start = false;              ///< True: the broker forgets the last session at connect.
  std::uint32_t session_expiry_s = 600;  ///< The broker keeps the session this long after a loss.
  int keepalive_s = 15;                  ///< 5 to 65535; a dead connection is noticed after 1.5x.
  double connect_timeout_s = 5;          ///< For the TCP connection, per address.
  double reconnect_min_s = 0.5;          ///< First wait after a loss; doubles up to the maximum.
  double reconnect_max_s = 10;
  std::uint64_t reconnect_jitter_seed = 0;
  int max_inflight = 20;                     ///< QoS 1 messages sent and not yet answered.
  std::size_t queue_messages = 1000;         ///< Waiting messages, beyond which Publish refuses.
  std::size_t queue_bytes = 64 << 20;        ///< The same in bytes of payload and topic.
  std::uint32_t max_packet_bytes = 2 << 20;  ///< Told to the broker: it sends nothing larger.
  std::optional<MqttTlsConfig> tls;          ///< Empty: plain TCP.
};

struct MqttSubscription {
  std::string filter;
  int qos = 1;  ///< 0 or 1.
};

/// A received message; views live as long as the callback runs.
struct MqttMessage {
  std::string_view topic;
  ByteView payload;
};

/// How one published message ended.
struct MqttPublishOutcome {
  std::uint64_t tag = 0;  ///< What the caller gave to Publish.
  std::string topic;
  std::size_t bytes = 0;  ///< Payload and topic.
  int reason_code = 0;    ///< MQTT v5: below 128 accepted (16: nobody listens), from there refused.
  std::string reason;     ///< The code in words.
  bool accepted() const { return reason_code < 128; }
  /// The broker took it, and had nobody to give it to: no client subscribes to its topic, and no
  /// session of one that is away waits for it.
  bool has_no_listener() const { return reason_code == 16; }
};

/// What the client calls, always on its network thread. Nothing may block or throw for long: the
/// connection waits. Empty functions are not called.
struct MqttCallbacks {
  std::function<void(const MqttMessage&)> on_message;
  std::function<void(const MqttPublishOutcome&)> on_published;
  /// After the broker accepted the login (true, with HOST:PORT of where it is), and after the
  /// connection was lost (false, with the sentence that says why). A refused attempt is a `false`
  /// as well.
  std::function<void(bool connected, const std::string& where_or_why)> on_connection;
  /// Of the topics of MqttClient::Follow, those that the broker has granted on this connection,
  /// sorted: after each call of Follow, and whenever they are others than before.
  std::function<void(const std::vector<std::string>& topics)> on_followed;
};

enum class MqttPublishStatus {
  kQueued,     ///< on_published will tell how it ended.
  kQueueFull,  ///< Counted; try again later.
  kStopped     ///< The client is stopping.
};

/// A snapshot; counts since construction.
struct MqttStatistics {
  bool connected = false;
  std::uint64_t connections = 0;            ///< Logins that the broker accepted.
  std::uint64_t connection_failures = 0;    ///< Attempts that failed or were refused.
  std::uint64_t subscriptions_granted = 0;  ///< On the present connection.
  std::uint64_t subscriptions_refused = 0;  ///< In all.
  std::uint64_t published = 0;              ///< Accepted by the broker (QoS 0: sent).
  std::uint64_t publishes_refused = 0;      ///< Refused by the broker or unfit to be sent.
  std::uint64_t queue_overflows = 0;        ///< Refused by Publish because the queue was full.
  std::uint64_t sent_bytes = 0;             ///< Payload and topic of what went to the broker once.
  std::uint64_t received = 0;
  std::uint64_t received_bytes = 0;  ///< Payload and topic.
  std::size_t queued = 0;            ///< Now waiting to be sent.
  std::size_t inflight = 0;          ///< Now sent and not yet answered.
  MqttAddress broker;                ///< That answered last; at first host and port.
  std::string last_error;            ///< The last thing that went wrong, empty if nothing.
};

/// An MQTT v5 client on libmosquitto with one network thread of its own, which alone touches the
/// library. It connects, subscribes again after every connect, reconnects with back-off for as long
/// as it lives, and reports every answer of the broker. A QoS 1 message that was sent and not
/// answered is sent again after a reconnect (so: duplicates happen); what is queued waits for the
/// connection. Nothing survives the process. It does not hear of messages that a broker retained
/// before it subscribed.
class MqttClient {
 public:
  /// Checks the options and starts the network thread. Throws Error naming a bad option.
  MqttClient(const MqttConfig& options, std::vector<MqttSubscription> subscriptions,
             MqttCallbacks callbacks);
  /// Says goodbye to the broker and joins the thread: at once, or after connect_timeout_s at worst
  /// (a host name that must be resolved can add the resolver's own timeout).
  ~MqttClient();
  MqttClient(const MqttClient&) = delete;
  MqttClient& operator=(const MqttClient&) = delete;

  /// Hands a message to the network thread; from any thread, also from callbacks.
  /// Never blocks on the network. Throws Error when `qos` is neither 0 nor 1.
  MqttPublishStatus Publish(std::string topic, std::vector<std::uint8_t> payload, int qos,
                            std::uint64_t tag);

  /// Subscribes to these topics with this QoS beside the client's subscriptions, and no longer to
  /// those of the last call; on every connection from now on. From any thread, also from callbacks.
  /// What the broker sends of a topic that nobody asked for, as a session of an earlier process
  /// has, is handed on once, and not subscribed to any more. Throws Error when `qos` is neither 0
  /// nor 1.
  void Follow(std::vector<std::string> topics, int qos);

  bool connected() const;
  MqttStatistics statistics() const;

 private:
  class Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace livemap::transport
