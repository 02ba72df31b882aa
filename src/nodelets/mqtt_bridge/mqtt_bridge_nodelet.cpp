#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "ros/bridge/bridged_type.h"
#include "ros/parameters/mqtt_bridge_parameters.h"
#include "transport/mqtt_client.h"
#include "transport/topic_template.h"

namespace livemap::nodelets {

/// The multi-master bridge: carries the listed topics between this ROS master and the zone's MQTT
/// broker. On the zone's side it writes the vehicle whose login the broker checked (it stands in
/// the MQTT topic) into each message, and sends messages with an addressee to that vehicle's topic.
class MqttBridgePart : public NodeletPart {
 public:
  ~MqttBridgePart() override { Close(); }

 private:
  /// What goes wrong with messages is counted always and said once a minute: of real time, for a
  /// simulated clock may stand still. Thread-safe.
  class OnceAMinute {
   public:
    bool Due() {
      const std::int64_t now_s = std::chrono::duration_cast<std::chrono::seconds>(
                                     std::chrono::steady_clock::now().time_since_epoch())
                                     .count();
      std::int64_t next_s = next_s_;
      return now_s >= next_s && next_s_.compare_exchange_strong(next_s, now_s + 60);
    }

   private:
    std::atomic<std::int64_t> next_s_{0};
  };

  struct Topic {
    Topic(const ros_io::BridgeTopic& topic_config)
        : config(topic_config),
          mqtt_topic(topic_config.mqtt_topic),
          type(ros_io::MakeBridgedType(topic_config.type,
                                       static_cast<std::size_t>(topic_config.max_bytes))) {}
    const ros_io::BridgeTopic config;
    const transport::TopicTemplate mqtt_topic;
    const std::unique_ptr<ros_io::BridgedType> type;
    ros::Publisher publisher;
    ros::Subscriber subscriber;
    std::atomic<std::uint64_t> carried{0};  ///< Out: accepted by the broker. In: published in ROS.
    std::atomic<std::uint64_t> bytes{0};    ///< Of the carried messages: MQTT payload and topic.
    std::atomic<std::uint64_t> refused{0};  ///< By the checks or by the broker.
    std::atomic<std::uint64_t> dropped{0};  ///< Out: no connection, or the queue was full.
    OnceAMinute say_refusal;
  };

  void Close() {
    // Nothing may call into the client while it goes, nor the client into the topics.
    diagnostics_.reset();
    for (const auto& topic : topics_) topic->subscriber.shutdown();
    client_.reset();
    topics_.clear();
  }

  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadBridgeConfig(parameters);
    if (!config_.password_file.empty()) {
      config_.mqtt.password = ros_io::ReadPassword(config_.password_file, config_.password_wait_s);
    }
    config_.mqtt.reconnect_jitter_seed = std::random_device{}();
    for (const ros_io::BridgeTopic& topic : config_.topics) {
      topics_.push_back(std::make_unique<Topic>(topic));
    }
    // Publishers stand before the client can call, the client before subscribers can.
    StartClient(AdvertiseIncoming());
    SubscribeOutgoing();
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "mqtt_bridge", "MQTT bridge", config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  std::vector<transport::MqttSubscription> AdvertiseIncoming() {
    // A zone listens to every vehicle, a vehicle to what is addressed to it.
    const transport::TopicNames names{
        config_.zone, config_.role == ros_io::BridgeRole::kZone ? "" : config_.user};
    std::vector<transport::MqttSubscription> subscriptions;
    for (const auto& topic : topics_) {
      if (topic->config.direction != ros_io::BridgeDirection::kIn) continue;
      topic->publisher =
          topic->type->Advertise(getNodeHandle(), topic->config.ros_topic,
                                 static_cast<std::uint32_t>(topic->config.ros_queue));
      subscriptions.push_back({topic->mqtt_topic.SubscriptionFilter(names), topic->config.qos});
    }
    return subscriptions;
  }

  void StartClient(std::vector<transport::MqttSubscription> subscriptions) {
    transport::MqttCallbacks callbacks;
    callbacks.on_message = [this](const transport::MqttMessage& message) { Receive(message); };
    callbacks.on_published = [this](const transport::MqttPublishOutcome& outcome) {
      CountOutcome(outcome);
    };
    callbacks.on_connection = [this](bool connected, const std::string& reason) {
      if (connected) {
        NODELET_INFO("connected to broker %s:%d as '%s'", config_.mqtt.host.c_str(),
                     config_.mqtt.port, config_.user.c_str());
      } else {
        SayLoss(reason);
      }
    };
    client_ = std::make_unique<transport::MqttClient>(config_.mqtt, std::move(subscriptions),
                                                      std::move(callbacks));
  }

  /// Each reason once a minute: a connection may end without one, and the next attempt have it.
  void SayLoss(const std::string& reason) {
    constexpr std::size_t kMaxReasons = 10;
    if (say_losses_again_.Due()) said_losses_.clear();
    if (said_losses_.size() >= kMaxReasons || !said_losses_.insert(reason).second) return;
    NODELET_WARN("%s; trying again", reason.c_str());
  }

  void SubscribeOutgoing() {
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      Topic& topic = *topics_[i];
      if (topic.config.direction != ros_io::BridgeDirection::kOut) continue;
      topic.subscriber = topic.type->Subscribe(
          getNodeHandle(), topic.config.ros_topic,
          static_cast<std::uint32_t>(topic.config.ros_queue),
          [this, i](ros_io::OutgoingBridgeMessage message) { Forward(i, std::move(message)); });
    }
  }

  /// From ROS to the broker.
  void Forward(std::size_t index, ros_io::OutgoingBridgeMessage message) {
    Topic& topic = *topics_[index];
    if (message.fault) return Refuse(topic, *message.fault);
    if (message.envelope.size() > static_cast<std::size_t>(topic.config.max_bytes)) {
      return Refuse(topic, "the message has " + std::to_string(message.envelope.size()) +
                               " bytes, at most " + std::to_string(topic.config.max_bytes) +
                               " are accepted");
    }
    const std::string& vehicle =
        config_.role == ros_io::BridgeRole::kZone ? message.vehicle_id : config_.user;
    if (topic.mqtt_topic.has_vehicle() && !transport::IsValidId(vehicle)) {
      return Refuse(topic, "the addressee '" + vehicle + "' is no vehicle id");
    }
    // A report that is dropped here is sent again by its owner until the zone's receipt comes.
    if (!topic.config.keep_when_disconnected && !client_->connected()) {
      ++topic.dropped;
      return;
    }
    const transport::MqttPublishStatus status =
        client_->Publish(topic.mqtt_topic.Expand({config_.zone, vehicle}),
                         std::move(message.envelope), topic.config.qos, index);
    if (status != transport::MqttPublishStatus::kQueued) ++topic.dropped;
  }

  /// From the broker to ROS, on the client's thread.
  void Receive(const transport::MqttMessage& message) {
    for (const auto& topic : topics_) {
      if (topic->config.direction != ros_io::BridgeDirection::kIn) continue;
      const std::optional<transport::TopicNames> names = topic->mqtt_topic.Match(message.topic);
      if (!names || (topic->mqtt_topic.has_zone() && names->zone != config_.zone)) continue;
      return Publish(*topic, *names, message);
    }
    ++unexpected_;
  }

  void Publish(Topic& topic, const transport::TopicNames& names,
               const transport::MqttMessage& message) {
    if (message.payload.size > static_cast<std::size_t>(topic.config.max_bytes)) {
      return Refuse(topic, "from '" + names.vehicle + "': the message has " +
                               std::to_string(message.payload.size) + " bytes, at most " +
                               std::to_string(topic.config.max_bytes) + " are accepted");
    }
    const std::optional<std::string> sender = config_.role == ros_io::BridgeRole::kZone
                                                  ? std::make_optional(names.vehicle)
                                                  : std::nullopt;
    const std::optional<std::string> fault =
        topic.type->PublishChecked(topic.publisher, message.payload, sender);
    if (fault) return Refuse(topic, "from '" + names.vehicle + "': " + *fault);
    ++topic.carried;
    topic.bytes += message.topic.size() + message.payload.size;
  }

  void CountOutcome(const transport::MqttPublishOutcome& outcome) {
    Topic& topic = *topics_[outcome.tag];
    if (!outcome.accepted()) return Refuse(topic, "the broker: " + outcome.reason);
    ++topic.carried;
    topic.bytes += outcome.bytes;
  }

  void Refuse(Topic& topic, const std::string& reason) {
    ++topic.refused;
    if (topic.say_refusal.Due()) {
      NODELET_WARN("refused a message of topic '%s': %s", topic.config.name.c_str(),
                   reason.c_str());
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const transport::MqttStatistics mqtt = client_->statistics();
    if (!mqtt.connected) {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR,
                     mqtt.last_error.empty() ? "connecting" : mqtt.last_error);
    } else if (mqtt.subscriptions_refused > 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, mqtt.last_error);
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "connected");
    }
    status.add("connected", mqtt.connected);
    status.add("broker", config_.mqtt.host + ":" + std::to_string(config_.mqtt.port));
    status.add("user", config_.user);
    status.add("last_error", mqtt.last_error);
    status.add("connections", mqtt.connections);
    status.add("connection_failures", mqtt.connection_failures);
    status.add("uplink_bytes", mqtt.sent_bytes);
    status.add("downlink_bytes", mqtt.received_bytes);
    status.add("publishes_refused", mqtt.publishes_refused);
    status.add("queued", mqtt.queued);
    status.add("queue_overflows", mqtt.queue_overflows);
    status.add("inflight", mqtt.inflight);
    status.add("unexpected_topics", unexpected_.load());
    for (const auto& topic : topics_) {
      const bool out = topic->config.direction == ros_io::BridgeDirection::kOut;
      status.add(topic->config.name + (out ? "_out" : "_in"), topic->carried.load());
      status.add(topic->config.name + "_bytes", topic->bytes.load());
      status.add(topic->config.name + "_refused", topic->refused.load());
      if (out) status.add(topic->config.name + "_dropped", topic->dropped.load());
    }
  }

  ros_io::BridgeConfig config_;
  std::vector<std::unique_ptr<Topic>> topics_;  ///< The index is the tag of a publication.
  std::atomic<std::uint64_t> unexpected_{0};    ///< Received on a topic that is not in the list.
  OnceAMinute say_losses_again_;
  std::set<std::string> said_losses_;  ///< In this minute; the client's thread's.
  std::unique_ptr<transport::MqttClient> client_;
  std::unique_ptr<Diagnostics> diagnostics_;  ///< Last: it uses the rest.
};

using MqttBridgeNodelet = PartNodelet<MqttBridgePart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::MqttBridgeNodelet, nodelet::Nodelet)
