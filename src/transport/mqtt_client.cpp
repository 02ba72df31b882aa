#include "transport/mqtt_client.h"

#include <mqtt_protocol.h>
#include <poll.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "common/error.h"
#include "common/mutex.h"
#include "transport/backoff.h"
#include "transport/broker_certificate.h"
#include "transport/event_fd.h"
#include "transport/mosquitto_handle.h"
#include "transport/outgoing_queue.h"
#include "transport/tcp_probe.h"

namespace livemap::transport {
namespace {

// libmosquitto's keepalive clock needs to be looked at about this often.
constexpr int kPollMs = 500;
// A connection that lived this long ends the back-off: one that is thrown out at once (another
// client with our name, a message the broker will not have) must not hammer the broker.
constexpr std::chrono::seconds kSettled{5};
// LiveMap retains nothing, but not every broker can forbid it: what somebody left is not asked for.
constexpr int kSubscribeOptions = MQTT_SUB_OPT_SEND_RETAIN_NEVER;

void BlockSignalsInMqttThread() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
}

/// Waits up to `timeout_s` or until `fd` becomes readable.
void WaitMqttReadable(int fd, double timeout_s) {
  pollfd waited{fd, POLLIN, 0};
  poll(&waited, 1, static_cast<int>(std::ceil(timeout_s * 1000)));
}

int ReasonOfMqttError(int code) {
  if (code == MOSQ_ERR_OVERSIZE_PACKET || code == MOSQ_ERR_PAYLOAD_SIZE) {
    return MQTT_RC_PACKET_TOO_LARGE;
  }
  if (code == MOSQ_ERR_INVAL || code == MOSQ_ERR_MALFORMED_UTF8) return MQTT_RC_TOPIC_NAME_INVALID;
  return MQTT_RC_UNSPECIFIED;
}

}  // namespace

/// Everything behind the header. Members below `thread side` belong to the network thread.
class MqttClient::Connection {
 public:
  Connection(const MqttConfig& options, std::vector<MqttSubscription> subscriptions,
             MqttCallbacks callbacks)
      : options_(options),
        subscriptions_(std::move(subscriptions)),
        callbacks_(std::move(callbacks)),
        queue_(options.queue_messages, options.queue_bytes),
        backoff_(options.reconnect_min_s, options.reconnect_max_s, options.reconnect_jitter_seed) {
    CheckMqttOptions(options_);
    brokers_ = {{options_.host, options_.port, options_.fingerprint}};
    brokers_.insert(brokers_.end(), options_.fallbacks.begin(), options_.fallbacks.end());
    statistics_.broker = brokers_.front();
    handle_ = MakeMosquittoHandle(options_, certificate_.context(), this);
    mosquitto_connect_v5_callback_set(handle_.get(), &OnConnect);
    mosquitto_disconnect_v5_callback_set(handle_.get(), &OnDisconnect);
    mosquitto_publish_v5_callback_set(handle_.get(), &OnPublish);
    mosquitto_subscribe_v5_callback_set(handle_.get(), &OnSubscribe);
    mosquitto_message_v5_callback_set(handle_.get(), &OnMessage);
    // Only its log tells why a TLS connection was refused.
    if (options_.tls) mosquitto_log_callback_set(handle_.get(), &OnLog);
    thread_ = std::thread([this] { Run(); });
  }

  ~Connection() {
    stopping_ = true;
    stop_.Signal();
    thread_.join();
  }

  MqttPublishStatus Publish(OutgoingMessage message) {
    if (message.qos != 0 && message.qos != 1) {
      throw Error("MQTT QoS of a message on '" + message.topic + "' is " +
                  std::to_string(message.qos) + ", accepted are 0 and 1");
    }
    if (stopping_) return MqttPublishStatus::kStopped;
    if (!queue_.Push(std::move(message))) {
      const MutexLock lock(mutex_);
      ++statistics_.queue_overflows;
      return MqttPublishStatus::kQueueFull;
    }
    wake_.Signal();
    return MqttPublishStatus::kQueued;
  }

  void Follow(std::vector<std::string> topics, int qos) {
    if (qos != 0 && qos != 1) {
      throw Error("MQTT QoS of topics to be followed is " + std::to_string(qos) +
                  ", accepted are 0 and 1");
    }
    {
      const MutexLock lock(mutex_);
      followed_ = {topics.begin(), topics.end()};
      followed_qos_ = qos;
      follows_others_ = true;
    }
    wake_.Signal();
  }

  bool connected() const {
    const MutexLock lock(mutex_);
    return statistics_.connected;
  }

  MqttStatistics statistics() const {
    const MutexLock lock(mutex_);
    MqttStatistics snapshot = statistics_;
    snapshot.queued = queue_.size();
    return snapshot;
  }

 private:
  void Run() {
    BlockSignalsInMqttThread();
    while (!stopping_) {
      const auto started = std::chrono::steady_clock::now();
      Attempt();
      if (stopping_) break;
      if (logged_in_ && std::chrono::steady_clock::now() - started > kSettled) backoff_.Reset();
      EndConnection();
      WaitMqttReadable(stop_.fd(), backoff_.NextDelayS());
    }
    if (logged_in_) mosquitto_disconnect_v5(handle_.get(), MQTT_RC_NORMAL_DISCONNECTION, nullptr);
  }

  /// One connection from the probe to its loss; leaves the cause in loss_reason_.
  void Attempt() {
    loss_reason_.clear();
    // They may have gone since the start, as a revoked vehicle's do on the zone's own machine.
    if (options_.tls) loss_reason_ = UnreadableTlsFile(*options_.tls);
    if (!loss_reason_.empty()) return;
    std::string reasons;
    for (std::size_t i = 0; i < brokers_.size() && !stopping_; ++i) {
      loss_reason_.clear();
      const Reception reception = AttemptAt(brokers_[i]);
      if (reception == Reception::kLoggedIn) return;
      // Said now: if another address stands in for this one, nothing else tells of it.
      if (reception == Reception::kRefused && i + 1 < brokers_.size()) EndConnection();
      reasons += (reasons.empty() ? "" : "; ") + loss_reason_;
    }
    loss_reason_ = reasons;
  }

  enum class Reception {
    kSilent,   ///< Nobody listens there.
    kRefused,  ///< By the broker, or the broker's certificate by us; or the broker did not answer.
    kLoggedIn
  };

  /// Serves the connection to this address, if there is one, until it is lost.
  Reception AttemptAt(const MqttAddress& broker) {
    tls_error_.clear();
    if (options_.tls) {
      tls_error_ = certificate_.Expect(broker, *options_.tls);
      if (!tls_error_.empty()) {
        Explain("cannot connect to the broker: TLS: " + tls_error_);
        return Reception::kSilent;
      }
    }
    // The library's blocking connect cannot be interrupted and waits minutes for a silent host:
    // let it try only what has just answered.
    const TcpProbeResult probe =
        ProbeTcp(broker.host, broker.port, options_.connect_timeout_s, stop_.fd());
    if (!probe.error.empty()) {
      Explain(probe.error);
      return Reception::kSilent;
    }
    {
      const MutexLock lock(mutex_);
      statistics_.broker = broker;
    }
    const int code = ConnectMosquitto(handle_.get(), options_, broker, probe.numeric_address);
    if (code == MOSQ_ERR_SUCCESS) {
      Serve();
    } else {
      Explain("cannot connect to the broker: " + DescribeLoss(code));
    }
    // OpenSSL's words for it are those for every certificate.
    if (!certificate_.refusal().empty()) loss_reason_ = certificate_.refusal();
    return logged_in_ ? Reception::kLoggedIn : Reception::kRefused;
  }

  void Serve() {
    while (!stopping_) {
      if (logged_in_) SubscribeToFollowed();
      if (logged_in_) SendQueued();
      const int fd = mosquitto_socket(handle_.get());
      if (fd < 0) return;
      const short write = mosquitto_want_write(handle_.get()) ? POLLOUT : short{0};
      std::array<pollfd, 3> waited = {pollfd{fd, static_cast<short>(POLLIN | write), 0},
                                      pollfd{wake_.fd(), POLLIN, 0}, pollfd{stop_.fd(), POLLIN, 0}};
      poll(waited.data(), waited.size(), kPollMs);
      if (waited[1].revents != 0) wake_.Clear();
      int code = MOSQ_ERR_SUCCESS;
      if ((waited[0].revents & ~POLLOUT) != 0) code = mosquitto_loop_read(handle_.get(), 1);
      if (code == MOSQ_ERR_SUCCESS && (waited[0].revents & POLLOUT) != 0) {
        code = mosquitto_loop_write(handle_.get(), 1);
      }
      if (code == MOSQ_ERR_SUCCESS) code = mosquitto_loop_misc(handle_.get());
      if (code != MOSQ_ERR_SUCCESS) {
        Explain("the connection to the broker was lost: " + DescribeLoss(code));
        return;
      }
    }
  }

  /// Tells the broker what has changed in the topics of Follow.
  void SubscribeToFollowed() {
    std::set<std::string> wanted;
    int qos = 0;
    {
      const MutexLock lock(mutex_);
      if (!follows_others_) return;
      follows_others_ = false;
      wanted = followed_;
      qos = followed_qos_;
    }
    for (auto topic = asked_.begin(); topic != asked_.end();) {
      if (wanted.count(*topic) != 0) {
        ++topic;
        continue;
      }
      mosquitto_unsubscribe_v5(handle_.get(), nullptr, topic->c_str(), nullptr);
      topic = asked_.erase(topic);
    }
    for (const std::string& topic : wanted) {
      if (!asked_.insert(topic).second) continue;
      int id = 0;
      mosquitto_subscribe_v5(handle_.get(), &id, topic.c_str(), qos, kSubscribeOptions, nullptr);
      asking_[id] = topic;
    }
    // Also where nothing is new: who has just asked wants to know.
    TellFollowed(true);
  }

  /// Which of the asked ones are granted, if that has changed.
  void TellFollowed(bool always = false) {
    std::vector<std::string> granted;
    for (const std::string& topic : asked_) {
      if (granted_.count(topic) != 0) granted.push_back(topic);
    }
    granted_ = {granted.begin(), granted.end()};
    if (!always && granted == told_granted_) return;
    told_granted_ = std::move(granted);
    if (!callbacks_.on_followed) return;
    Guarded(this, [](Connection& connection) {
      connection.callbacks_.on_followed(connection.told_granted_);
    });
  }

  /// Of a session of before: neither this client's subscriptions nor its followed topics have it.
  bool IsUnasked(const char* topic) const {
    if (asked_.count(topic) != 0) return false;
    for (const MqttSubscription& subscription : subscriptions_) {
      bool matches = false;
      const int code = mosquitto_topic_matches_sub(subscription.filter.c_str(), topic, &matches);
      if (code != MOSQ_ERR_SUCCESS || matches) return false;
    }
    return true;
  }

  /// Keeps the library's own unbounded queue empty: at most max_inflight messages are with it, and
  /// none while the connection takes no more.
  void SendQueued() {
    while (inflight_.size() < static_cast<std::size_t>(options_.max_inflight) &&
           !mosquitto_want_write(handle_.get())) {
      std::optional<OutgoingMessage> message = queue_.Pop();
      if (!message) return;
      int id = 0;
      const int code = mosquitto_publish_v5(handle_.get(), &id, message->topic.c_str(),
                                            static_cast<int>(message->payload.size()),
                                            message->payload.data(), message->qos, false, nullptr);
      const std::size_t bytes = message->bytes();
      // With QoS 1 the library keeps the message when the connection breaks here, and sends it
      // after the next login.
      const bool broken =
          code == MOSQ_ERR_NO_CONN || code == MOSQ_ERR_CONN_LOST || code == MOSQ_ERR_ERRNO;
      if (code == MOSQ_ERR_SUCCESS || (broken && message->qos > 0)) {
        {
          const MutexLock lock(mutex_);
          statistics_.sent_bytes += bytes;
        }
        MqttPublishOutcome outcome{message->tag, std::move(message->topic), bytes, 0, ""};
        if (message->qos == 0) {
          Finish(std::move(outcome));
        } else {
          inflight_[id] = std::move(outcome);
          CountInflight();
        }
      } else {
        Finish({message->tag, std::move(message->topic), bytes, ReasonOfMqttError(code),
                DescribeMosquittoError(code)});
      }
      if (broken) return;
    }
  }

  void Finish(MqttPublishOutcome outcome) {
    {
      const MutexLock lock(mutex_);
      ++(outcome.accepted() ? statistics_.published : statistics_.publishes_refused);
      if (!outcome.accepted()) {
        statistics_.last_error =
            "a message on '" + outcome.topic + "' was refused: " + outcome.reason;
      }
    }
    if (!callbacks_.on_published) return;
    Guarded(this, [&](Connection& connection) { connection.callbacks_.on_published(outcome); });
  }

  void CountInflight() {
    const MutexLock lock(mutex_);
    statistics_.inflight = inflight_.size();
  }

  /// The first cause counts: what follows from it says less.
  void Explain(const std::string& reason) {
    if (loss_reason_.empty()) loss_reason_ = reason;
  }

  std::string DescribeLoss(int code) const {
    return tls_error_.empty() ? DescribeMosquittoError(code) : "TLS: " + tls_error_;
  }

  void EndConnection() {
    logged_in_ = false;
    asked_.clear();
    asking_.clear();
    TellFollowed();
    Explain("the connection to the broker was lost");
    {
      const MutexLock lock(mutex_);
      if (!statistics_.connected) ++statistics_.connection_failures;
      statistics_.connected = false;
      statistics_.subscriptions_granted = 0;
      statistics_.last_error = loss_reason_;
    }
    if (!callbacks_.on_connection) return;
    Guarded(this, [](Connection& connection) {
      connection.callbacks_.on_connection(false, connection.loss_reason_);
    });
  }

  void HandleConnect(int reason_code) {
    if (reason_code != MQTT_RC_SUCCESS) {
      Explain("the broker refused the login of '" + options_.user +
              "': " + DescribeReason(reason_code));
      return;
    }
    logged_in_ = true;
    std::string where;
    {
      const MutexLock lock(mutex_);
      statistics_.connected = true;
      ++statistics_.connections;
      where = statistics_.broker.host + ":" + std::to_string(statistics_.broker.port);
    }
    {
      const MutexLock lock(mutex_);
      follows_others_ = !followed_.empty();
    }
    for (const MqttSubscription& subscription : subscriptions_) {
      mosquitto_subscribe_v5(handle_.get(), nullptr, subscription.filter.c_str(), subscription.qos,
                             kSubscribeOptions, nullptr);
    }
    if (callbacks_.on_connection) callbacks_.on_connection(true, where);
  }

  void HandleSubscribe(int id, int count, const int* granted) {
    CountSubscribed(count, granted);
    const auto asking = asking_.find(id);
    if (asking == asking_.end()) return;
    if (count == 1 && granted[0] < MQTT_RC_UNSPECIFIED) granted_.insert(asking->second);
    asking_.erase(asking);
    TellFollowed();
  }

  void CountSubscribed(int count, const int* granted) {
    const MutexLock lock(mutex_);
    for (int i = 0; i < count; ++i) {
      if (granted[i] < MQTT_RC_UNSPECIFIED) {
        ++statistics_.subscriptions_granted;
      } else {
        ++statistics_.subscriptions_refused;
        statistics_.last_error = "a subscription was refused: " + DescribeReason(granted[i]);
      }
    }
  }

  void HandlePublish(int id, int reason_code) {
    const auto found = inflight_.find(id);
    if (found == inflight_.end()) return;  // QoS 0, finished when it was sent.
    MqttPublishOutcome outcome = std::move(found->second);
    inflight_.erase(found);
    CountInflight();
    outcome.reason_code = reason_code;
    outcome.reason = DescribeReason(reason_code);
    Finish(std::move(outcome));
  }

  void HandleMessage(const mosquitto_message& message) {
    const MqttMessage received{message.topic,
                               {static_cast<const std::uint8_t*>(message.payload),
                                static_cast<std::size_t>(message.payloadlen)}};
    {
      const MutexLock lock(mutex_);
      ++statistics_.received;
      statistics_.received_bytes += received.topic.size() + received.payload.size;
    }
    if (IsUnasked(message.topic)) {
      mosquitto_unsubscribe_v5(handle_.get(), nullptr, message.topic, nullptr);
    }
    if (callbacks_.on_message) callbacks_.on_message(received);
  }

  /// Runs a handler; no exception of a callback may pass through the C library or end the thread.
  template <typename Handler>
  static void Guarded(void* self, Handler handler) {
    auto& connection = *static_cast<Connection*>(self);
    try {
      handler(connection);
    } catch (const std::exception& error) {
      const MutexLock lock(connection.mutex_);
      connection.statistics_.last_error = std::string("an MQTT callback failed: ") + error.what();
    }
  }

  static void OnConnect(mosquitto*, void* self, int reason_code, int, const mosquitto_property*) {
    Guarded(self, [=](Connection& connection) { connection.HandleConnect(reason_code); });
  }
  static void OnDisconnect(mosquitto*, void* self, int code, const mosquitto_property*) {
    // From 128 on this is the broker's own reason, below it is a result of the library, which the
    // loop functions return as well.
    if (code < MQTT_RC_UNSPECIFIED) return;
    Guarded(self, [=](Connection& connection) {
      connection.Explain("the broker closed the connection: " + DescribeReason(code));
    });
  }
  static void OnPublish(mosquitto*, void* self, int id, int reason_code,
                        const mosquitto_property*) {
    Guarded(self, [=](Connection& connection) { connection.HandlePublish(id, reason_code); });
  }
  static void OnSubscribe(mosquitto*, void* self, int id, int count, const int* granted,
                          const mosquitto_property*) {
    Guarded(self, [=](Connection& connection) { connection.HandleSubscribe(id, count, granted); });
  }
  static void OnMessage(mosquitto*, void* self, const mosquitto_message* message,
                        const mosquitto_property*) {
    Guarded(self, [=](Connection& connection) { connection.HandleMessage(*message); });
  }

  static void OnLog(mosquitto*, void* self, int level, const char* line) {
    if (level != MOSQ_LOG_ERR) return;
    Guarded(self, [=](Connection& connection) {
      const std::string words = TlsErrorIn(line);
      if (!words.empty()) connection.tls_error_ = words;
    });
  }

  const MqttConfig options_;
  const std::vector<MqttSubscription> subscriptions_;
  const MqttCallbacks callbacks_;
  OutgoingQueue queue_;
  EventFd wake_;
  EventFd stop_;
  std::atomic<bool> stopping_{false};

  mutable Mutex mutex_;
  MqttStatistics statistics_ GUARDED_BY(mutex_);
  std::set<std::string> followed_ GUARDED_BY(mutex_);
  int followed_qos_ GUARDED_BY(mutex_) = 1;
  bool follows_others_ GUARDED_BY(mutex_) = false;  ///< The broker does not know yet.

  // Thread side.
  std::vector<MqttAddress> brokers_;
  BrokerCertificate certificate_;
  MosquittoHandle handle_;
  Backoff backoff_;
  std::map<int, MqttPublishOutcome> inflight_;  ///< By packet id.
  std::set<std::string> asked_;                 ///< Of the topics of Follow, on this connection.
  std::map<int, std::string> asking_;           ///< Not answered yet, by packet id.
  std::set<std::string> granted_;
  std::vector<std::string> told_granted_;
  bool logged_in_ = false;
  std::string loss_reason_;
  std::string tls_error_;  ///< Of this attempt, in OpenSSL's words.

  std::thread thread_;  // Last: it uses everything above.
};

MqttClient::MqttClient(const MqttConfig& options, std::vector<MqttSubscription> subscriptions,
                       MqttCallbacks callbacks)
    : connection_(
          std::make_unique<Connection>(options, std::move(subscriptions), std::move(callbacks))) {}

MqttClient::~MqttClient() = default;

MqttPublishStatus MqttClient::Publish(std::string topic, std::vector<std::uint8_t> payload, int qos,
                                      std::uint64_t tag) {
  return connection_->Publish({std::move(topic), std::move(payload), qos, tag});
}

void MqttClient::Follow(std::vector<std::string> topics, int qos) {
  connection_->Follow(std::move(topics), qos);
}

bool MqttClient::connected() const { return connection_->connected(); }

MqttStatistics MqttClient::statistics() const { return connection_->statistics(); }

}  // namespace livemap::transport
