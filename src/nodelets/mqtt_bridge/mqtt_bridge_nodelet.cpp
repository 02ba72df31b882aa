#include <livemap/VehicleCells.h>
#include <livemap/VehicleZones.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Bool.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "common/mutex.h"
#include "common/time.h"
#include "directory/directory_file.h"
#include "directory/directory_handout.h"
#include "directory/directory_offers.h"
#include "directory/zone_handover.h"
#include "nodelets/diagnostics.h"
#include "nodelets/mqtt_bridge/zone_connections.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "ros/bridge/bridged_type.h"
#include "ros/conversions/cell_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/parameters/mqtt_bridge_parameters.h"
#include "transport/mqtt_client.h"
#include "transport/topic_template.h"

namespace livemap::nodelets {
namespace {

constexpr double kZoneTickS = 0.5;
/// Between two looks whether the zone's process is still the active one.
constexpr double kActiveTickS = 0.1;
/// Fixes count when no fused one has come for so long.
constexpr double kFusedSilenceS = 2;
constexpr double kHandoutTickS = 0.5;
/// The payload is the signed file as it is.
constexpr char kDirectoryTopic[] = "livemap/v1/{zone}/vehicle/{vehicle}/directory";

}  // namespace

/// The multi-master bridge: carries the listed topics between this ROS master and the zone's MQTT
/// broker. On the zone's side it writes the vehicle whose login the broker checked (it stands in
/// the MQTT topic) into each message, and sends messages with an addressee to that vehicle's topic.
///
/// On a vehicle with a zone directory it connects to the brokers of several zones, as ZoneHandover
/// decides by the vehicle's position. It writes the zone into each message that comes in, and sends
/// a message to the zone in it; without one to the present zone. A zone with a zone directory gives
/// it to each vehicle that it hears; the vehicle puts what is newer into its own file.
///
/// A topic with a level {cell} is one topic for each cell of the map. A zone sends a message to the
/// cell of its place; a vehicle hears of the cells that it is told to, and says of which it does.
///
/// Of a zone with a standby only the bridge beside the active process is connected: the broker
/// keeps one session of the zone's login, with what waits in it, for whichever of the two connects.
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

  struct Counts {
    explicit Counts(std::string name_of_topic) : name(std::move(name_of_topic)) {}
    const std::string name;
    std::atomic<std::uint64_t> carried{0};  ///< Out: accepted by the broker. In: published in ROS.
    std::atomic<std::uint64_t> bytes{0};    ///< Of the carried messages: MQTT payload and topic.
    std::atomic<std::uint64_t> refused{0};  ///< By the checks or by the broker.
    OnceAMinute say_refusal;
  };

  struct Topic : Counts {
    Topic(const ros_io::BridgeTopic& topic_config)
        : Counts(topic_config.name),
          config(topic_config),
          mqtt_topic(topic_config.mqtt_topic),
          type(ros_io::MakeBridgedType(topic_config.type,
                                       static_cast<std::size_t>(topic_config.max_bytes),
                                       topic_config.write_version)) {}
    const ros_io::BridgeTopic config;
    const transport::TopicTemplate mqtt_topic;
    const std::unique_ptr<ros_io::BridgedType> type;
    ros::Publisher publisher;
    ros::Subscriber subscriber;
    std::atomic<std::uint64_t> dropped{0};  ///< Out: no connection, or the queue was full.
  };

  void Close() {
    // Nothing may call into the clients while they go, nor the clients into the topics.
    diagnostics_.reset();
    zone_timer_.stop();
    handout_timer_.stop();
    active_subscriber_.shutdown();
    cells_subscriber_.shutdown();
    for (ros::Subscriber& subscriber : position_subscribers_) subscriber.shutdown();
    for (const auto& topic : topics_) topic->subscriber.shutdown();
    connections_.reset();
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
    if (!IsZone()) {
      cells_publisher_ = getNodeHandle().advertise<VehicleCells>("vehicle/cells_heard", 20);
    }
    // Publishers stand before a client can call, the clients before subscribers can.
    AdvertiseIncoming();
    if (IsZone() && !config_.zones.directory.empty()) StartHandout();
    MakeConnections();
    if (FollowsZones()) {
      FollowZones();
    } else if (config_.active_timeout_s > 0) {
      FollowActivity();
    } else {
      connections_->Keep({ConfiguredZone()});
    }
    FollowCells();
    SubscribeOutgoing();
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "mqtt_bridge", "MQTT bridge", config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void AdvertiseIncoming() {
    for (const auto& topic : topics_) {
      if (topic->config.direction != ros_io::BridgeDirection::kIn) continue;
      topic->publisher =
          topic->type->Advertise(getNodeHandle(), topic->config.ros_topic,
                                 static_cast<std::uint32_t>(topic->config.ros_queue));
    }
  }

  std::vector<transport::MqttSubscription> SubscriptionsOf(const std::string& zone) const {
    // A zone listens to every vehicle, a vehicle to what is addressed to it.
    const transport::TopicNames names{zone, IsZone() ? "" : config_.user};
    std::vector<transport::MqttSubscription> subscriptions;
    for (const auto& topic : topics_) {
      if (topic->config.direction != ros_io::BridgeDirection::kIn) continue;
      if (topic->mqtt_topic.has_cell()) continue;  // FollowCells.
      subscriptions.push_back({topic->mqtt_topic.SubscriptionFilter(names), topic->config.qos});
    }
    if (FollowsZones()) subscriptions.push_back({directory_topic_.SubscriptionFilter(names), 1});
    return subscriptions;
  }

  void MakeConnections() {
    ZoneConnections::Events events;
    events.on_message = [this](const std::string& zone, const transport::MqttMessage& message) {
      Receive(zone, message);
    };
    events.on_published = [this](const transport::MqttPublishOutcome& outcome) {
      CountOutcome(outcome);
    };
    events.on_connection = [this](const std::string& zone, bool connected,
                                  const std::string& where_or_why) {
      connected ? SayConnection(zone, where_or_why) : SayLoss(zone, where_or_why);
      // A broker that was killed may have lost what it had for vehicles.
      if (connected && handout_) handout_->TakeBackAll();
    };
    events.on_followed = [this](const std::string& zone, const std::vector<std::string>& topics) {
      TellCellsHeard(zone, topics);
    };
    connections_ = std::make_unique<ZoneConnections>(
        config_.mqtt, [this](const std::string& zone) { return SubscriptionsOf(zone); },
        std::move(events));
  }

  /// The topics with a level for the cell that a vehicle takes in.
  std::vector<const Topic*> CellTopics() const {
    std::vector<const Topic*> topics;
    for (const auto& topic : topics_) {
      const bool is_in = topic->config.direction == ros_io::BridgeDirection::kIn;
      if (is_in && topic->mqtt_topic.has_cell()) topics.push_back(topic.get());
    }
    return topics;
  }

  void FollowCells() {
    if (IsZone() || CellTopics().empty()) return;
    cells_subscriber_ =
        getNodeHandle().subscribe("vehicle/cells", 1, &MqttBridgePart::OnCells, this);
  }

  /// The cells of which the vehicle wants to hear, from all zones.
  void OnCells(const VehicleCells& message) {
    std::vector<geo::MapCell> cells;
    try {
      cells = ros_io::FromMessage(message);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
      return;
    }
    const std::vector<const Topic*> topics = CellTopics();
    const auto topics_of = [this, cells, topics](const std::string& zone) {
      std::vector<std::string> names;
      for (const Topic* topic : topics) {
        for (const geo::MapCell& cell : cells) {
          names.push_back(topic->mqtt_topic.Expand({zone, config_.user, cell.Quadkey()}));
        }
      }
      return names;
    };
    connections_->Follow(topics_of, topics.front()->config.qos);
  }

  /// Of which cells the broker of `zone` lets the vehicle hear now; on its client's thread.
  void TellCellsHeard(const std::string& zone, const std::vector<std::string>& topics) {
    const std::vector<const Topic*> cell_topics = CellTopics();
    if (cell_topics.empty()) return;
    std::vector<geo::MapCell> cells;
    for (const std::string& topic : topics) {
      // Where there are several topics of a cell, the first one tells.
      const auto names = cell_topics.front()->mqtt_topic.Match(topic);
      const auto cell = names ? geo::MapCell::FromQuadkey(names->cell) : std::nullopt;
      if (cell) cells.push_back(*cell);
    }
    cells_publisher_.publish(ros_io::ToMessage(cells, zone));
  }

  bool FollowsZones() const { return !IsZone() && !config_.zones.directory.empty(); }
  bool IsZone() const { return config_.role == ros_io::BridgeRole::kZone; }

  ZoneConnections::Zone ConfiguredZone() const {
    ZoneConnections::Zone zone{config_.zone, {{config_.mqtt.host, config_.mqtt.port}}};
    zone.brokers.insert(zone.brokers.end(), config_.mqtt.fallbacks.begin(),
                        config_.mqtt.fallbacks.end());
    return zone;
  }

  /// Starts to give the zone directory to the vehicles that are heard.
  void StartHandout() {
    handout_ = std::make_unique<directory::DirectoryHandout>(
        directory::DirectoryFile(directory::TrustedAuthority::Read(config_.zones.authority),
                                 config_.zones.directory),
        config_.handout);
    ReadHandout();
    handout_timer_ = getNodeHandle().createSteadyTimer(ros::WallDuration(kHandoutTickS),
                                                       [this](const ros::SteadyTimerEvent&) {
                                                         ReadHandout();
                                                         GiveDirectory();
                                                       });
  }

  void ReadHandout() {
    if (!handout_->ReadIfChanged()) return;
    const std::string damage = handout_->damage();
    if (!damage.empty()) NODELET_ERROR("%s", damage.c_str());
  }

  /// To the vehicles that were heard. While the broker is away they wait: they will be heard again.
  void GiveDirectory() {
    transport::MqttClient* const client = connections_ ? ConnectionTo(config_.zone) : nullptr;
    if (client == nullptr || !client->connected()) return;
    for (const auto& [vehicle, bytes] : handout_->Next(Nanoseconds(SteadyS()))) {
      const transport::MqttPublishStatus status =
          client->Publish(directory_topic_.Expand({config_.zone, vehicle}),
                          {bytes->begin(), bytes->end()}, 1, topics_.size());
      if (status != transport::MqttPublishStatus::kQueued) handout_->TakeBack(vehicle);
    }
  }

  /// Puts what the zones' brokers have sent since into the vehicle's file.
  void TakeDirectories() {
    for (const auto& [zone, bytes] : directory_offers_.Take()) {
      const auto before = directory_file_->directory();
      if (const auto reason = OfferDirectory(bytes)) {
        RefuseDirectory(zone, *reason);
        continue;
      }
      ++directory_counts_.carried;
      directory_counts_.bytes += bytes.size();
      const auto after = directory_file_->directory();
      if (!after || (before && before->version() == after->version())) continue;
      NODELET_INFO("zone '%s' gave version %s of the zone directory", zone.c_str(),
                   std::to_string(after->version()).c_str());
    }
  }

  /// Why it is not taken: it is refused, or cannot be written.
  std::optional<std::string> OfferDirectory(const std::string& bytes) {
    try {
      return directory_file_->Offer(bytes);
    } catch (const Error& error) {
      return error.what();
    }
  }

  void RefuseDirectory(const std::string& zone, const std::string& reason) {
    const std::string sentence = "from zone '" + zone + "': " + reason;
    {
      const MutexLock lock(directory_refusal_mutex_);
      directory_refusal_ = sentence;
    }
    Refuse(directory_counts_, sentence);
  }

  /// Connects while the process beside it is the active one of the zone.
  void FollowActivity() {
    active_subscriber_ =
        getNodeHandle().subscribe("zone/active", 1, &MqttBridgePart::OnActivity, this);
    zone_timer_ = getNodeHandle().createSteadyTimer(
        ros::WallDuration(kActiveTickS),
        [this](const ros::SteadyTimerEvent&) { ConnectWhileActive(); });
  }

  void OnActivity(const std_msgs::Bool& message) {
    active_ns_ = message.data != 0 ? BootNs() : 0;
    ConnectWhileActive();
  }

  void ConnectWhileActive() {
    const bool is_active = IsActive();
    if (is_active != was_active_) {
      NODELET_INFO("%s", is_active ? "the zone is active here: connecting"
                                   : "the zone is not active here: not connected");
    }
    was_active_ = is_active;
    connections_->Keep(is_active ? std::vector{ConfiguredZone()}
                                 : std::vector<ZoneConnections::Zone>{});
  }

  bool IsActive() const {
    if (config_.active_timeout_s <= 0) return true;
    return active_ns_ != 0 &&
           static_cast<double>(BootNs() - active_ns_) < config_.active_timeout_s * 1e9;
  }

  /// Starts to choose the zones by the vehicle's position.
  void FollowZones() {
    directory_file_.emplace(directory::TrustedAuthority::Read(config_.zones.authority),
                            config_.zones.directory);
    ReadDirectory();
    StayWithConfiguredZone();
    zones_publisher_ = getNodeHandle().advertise<VehicleZones>("zones", 1, /*latch=*/true);
    position_subscribers_ = {
        getNodeHandle().subscribe("fix", 10, &MqttBridgePart::OnFix, this),
        getNodeHandle().subscribe("localization/fix", 10, &MqttBridgePart::OnFusedFix, this),
    };
    ConnectToZones();
    zone_timer_ = getNodeHandle().createSteadyTimer(ros::WallDuration(kZoneTickS),
                                                    [this](const ros::SteadyTimerEvent&) {
                                                      ReadDirectory();
                                                      TakeDirectories();
                                                      ConnectToZones();
                                                    });
  }

  /// Again when somebody has put another file in its place.
  void ReadDirectory() {
    if (!directory_file_->ReadIfChanged() || directory_file_->damage().empty()) return;
    NODELET_ERROR("%s", directory_file_->damage().c_str());
  }

  void StayWithConfiguredZone() {
    handover_ = std::make_unique<directory::ZoneHandover>(config_.handover, config_.zone);
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    if (fused_s_ && SteadyS() - *fused_s_ < kFusedSilenceS) return;
    MoveTo(message);
  }

  void OnFusedFix(const sensor_msgs::NavSatFix& message) {
    fused_s_ = SteadyS();
    MoveTo(message);
  }

  void MoveTo(const sensor_msgs::NavSatFix& message) {
    const geo::Fix fix = ros_io::ToFix(message);
    const auto directory = directory_file_->directory();
    if (!fix.has_fix || !geo::IsValid(fix.position) || !directory) return;
    if (handover_->Move(*directory, fix.position)) {
      NODELET_INFO("the present zone is '%s'", handover_->present().c_str());
    }
    ConnectToZones();
  }

  void ConnectToZones() {
    const auto directory = directory_file_->directory();
    // A zone that the directory no longer has may have no broker.
    const bool is_known = directory && (handover_->present() == config_.zone ||
                                        directory->FindId(handover_->present()));
    if (!is_known && handover_->near() != std::vector<std::string>{config_.zone}) {
      StayWithConfiguredZone();
    }
    std::vector<ZoneConnections::Zone> zones;
    for (const std::string& id : handover_->Wanted(SteadyS(), connections_->Waiting())) {
      auto zone = FindZone(id, directory.get());
      // A broker keeps one connection of a user: a second one would end the first.
      const auto is_same_place = [](const transport::MqttAddress& one,
                                    const transport::MqttAddress& other) {
        return one.host == other.host && one.port == other.port;
      };
      const auto shares_broker = [&](const ZoneConnections::Zone& other) {
        return std::find_first_of(other.brokers.begin(), other.brokers.end(), zone->brokers.begin(),
                                  zone->brokers.end(), is_same_place) != other.brokers.end();
      };
      if (zone && std::none_of(zones.begin(), zones.end(), shares_broker)) {
        zones.push_back(std::move(*zone));
      }
    }
    connections_->Keep(zones);
    if (told_zones_ == handover_->near()) return;
    told_zones_ = handover_->near();
    VehicleZones message;
    message.zones = told_zones_;
    zones_publisher_.publish(message);
  }

  /// Nothing where nobody says where its broker is.
  std::optional<ZoneConnections::Zone> FindZone(const std::string& id,
                                                const directory::ZoneDirectory* directory) const {
    const auto found = directory != nullptr ? directory->FindId(id) : std::nullopt;
    if (found) {
      ZoneConnections::Zone zone{id, {}};
      for (const directory::BrokerAddress& broker : directory->zones()[*found].brokers) {
        zone.brokers.push_back({broker.host, broker.port, broker.fingerprint});
      }
      return zone;
    }
    if (id == config_.zone) return ConfiguredZone();
    return std::nullopt;
  }

  void SayConnection(const std::string& zone, const std::string& where) const {
    if (FollowsZones()) {
      NODELET_INFO("connected to the broker of zone '%s' as '%s'", zone.c_str(),
                   config_.user.c_str());
    } else {
      NODELET_INFO("connected to broker %s as '%s'", where.c_str(), config_.user.c_str());
    }
  }

  /// Each reason once a minute: a connection may end without one, and the next attempt have it.
  void SayLoss(const std::string& zone, const std::string& reason) {
    constexpr std::size_t kMaxReasons = 10;
    {
      const MutexLock lock(losses_mutex_);
      if (say_losses_again_.Due()) said_losses_.clear();
      if (said_losses_.size() >= kMaxReasons || !said_losses_.insert(zone + reason).second) return;
    }
    if (FollowsZones()) {
      NODELET_WARN("zone '%s': %s; trying again", zone.c_str(), reason.c_str());
    } else {
      NODELET_WARN("%s; trying again", reason.c_str());
    }
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
    const std::string& vehicle = IsZone() ? message.vehicle_id : config_.user;
    if (topic.mqtt_topic.has_vehicle() && !transport::IsValidId(vehicle)) {
      return Refuse(topic, "the addressee '" + vehicle + "' is no vehicle id");
    }
    if (topic.mqtt_topic.has_cell() && message.cell.empty()) {
      return Refuse(topic, "the message has no valid place, so it belongs to no cell");
    }
    // Also of a process that stood still together with the timer.
    if (!IsActive()) {
      ++topic.dropped;
      return;
    }
    const std::string zone = AddresseeOf(message);
    transport::MqttClient* const client = ConnectionTo(zone);
    // A report that is dropped here is sent again by its owner until the zone's receipt comes.
    if (client == nullptr || (!topic.config.keep_when_disconnected && !client->connected())) {
      ++topic.dropped;
      return;
    }
    const transport::MqttPublishStatus status =
        client->Publish(topic.mqtt_topic.Expand({zone, vehicle, message.cell}),
                        std::move(message.envelope), topic.config.qos, index);
    if (status != transport::MqttPublishStatus::kQueued) ++topic.dropped;
  }

  /// Id of the zone to which the message goes.
  std::string AddresseeOf(const ros_io::OutgoingBridgeMessage& message) const {
    if (IsZone()) return config_.zone;
    if (!message.zone.empty()) return message.zone;
    return handover_ ? handover_->present() : config_.zone;
  }

  /// The connection to a zone, which may have to be made; null: it is not known where its broker
  /// is, or other zones have the connections.
  transport::MqttClient* ConnectionTo(const std::string& zone) {
    if (handover_ && FindZone(zone, directory_file_->directory().get())) {
      handover_->NoteMessage(zone, SteadyS());
      if (connections_->Find(zone) == nullptr) ConnectToZones();
    }
    return connections_->Find(zone);
  }

  /// From the broker of `zone` to ROS, on its client's thread.
  void Receive(const std::string& zone, const transport::MqttMessage& message) {
    if (FollowsZones() && ReceiveDirectory(zone, message)) return;
    for (const auto& topic : topics_) {
      if (topic->config.direction != ros_io::BridgeDirection::kIn) continue;
      const std::optional<transport::TopicNames> names = topic->mqtt_topic.Match(message.topic);
      if (!names || (topic->mqtt_topic.has_zone() && names->zone != zone)) continue;
      if (handout_ && topic->mqtt_topic.has_vehicle()) handout_->Hear(names->vehicle);
      return Publish(*topic, zone, *names, message);
    }
    ++unexpected_;
  }

  /// Whether it is a zone directory. It is looked at later: a signature takes its time.
  bool ReceiveDirectory(const std::string& zone, const transport::MqttMessage& message) {
    const std::optional<transport::TopicNames> names = directory_topic_.Match(message.topic);
    if (!names || names->zone != zone || names->vehicle != config_.user) return false;
    if (const auto reason = directory_offers_.Put(zone, message.payload)) {
      RefuseDirectory(zone, *reason);
    }
    return true;
  }

  void Publish(Topic& topic, const std::string& zone, const transport::TopicNames& names,
               const transport::MqttMessage& message) {
    if (message.payload.size > static_cast<std::size_t>(topic.config.max_bytes)) {
      return Refuse(topic, "from '" + names.vehicle + "': the message has " +
                               std::to_string(message.payload.size) + " bytes, at most " +
                               std::to_string(topic.config.max_bytes) + " are accepted");
    }
    const ros_io::BridgeOrigin origin =
        IsZone() ? ros_io::BridgeOrigin{names.vehicle, ""} : ros_io::BridgeOrigin{{}, zone};
    const std::optional<std::string> fault =
        topic.type->PublishChecked(topic.publisher, message.payload, origin);
    if (fault) return Refuse(topic, "from '" + names.vehicle + "': " + *fault);
    ++topic.carried;
    topic.bytes += message.topic.size() + message.payload.size;
  }

  void CountOutcome(const transport::MqttPublishOutcome& outcome) {
    Counts& counts = outcome.tag < topics_.size() ? *topics_[outcome.tag] : directory_counts_;
    if (!outcome.accepted()) return Refuse(counts, "the broker: " + outcome.reason);
    ++counts.carried;
    counts.bytes += outcome.bytes;
    // Heard before the broker began anew, the vehicle may not have subscribed again yet.
    if (handout_ && outcome.has_no_listener()) TakeBackGift(outcome.topic);
  }

  /// The vehicle of that topic is given the zone directory again at its next message.
  void TakeBackGift(const std::string& topic) {
    const std::optional<transport::TopicNames> names = directory_topic_.Match(topic);
    if (names) handout_->TakeBack(names->vehicle);
  }

  void Refuse(Counts& counts, const std::string& reason) {
    ++counts.refused;
    if (counts.say_refusal.Due()) {
      NODELET_WARN("refused a message of topic '%s': %s", counts.name.c_str(), reason.c_str());
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const std::map<std::string, transport::MqttStatistics> zones = connections_->Statistics();
    const std::string present = handover_ ? handover_->present() : config_.zone;
    const auto found = zones.find(present);
    const transport::MqttStatistics mqtt =
        found != zones.end() ? found->second : transport::MqttStatistics();
    if (!IsActive()) {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "standby, not connected");
    } else if (!mqtt.connected) {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR,
                     mqtt.last_error.empty() ? "connecting" : mqtt.last_error);
    } else if (mqtt.subscriptions_refused > 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, mqtt.last_error);
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "connected");
    }
    status.add("connected", mqtt.connected);
    status.add("broker", mqtt.broker.host + ":" + std::to_string(mqtt.broker.port));
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
    if (handout_) {
      status.add("zone_directory_version", handout_->version());
      DiagnoseDirectory("_out", status);
    }
    if (!handover_) return;
    status.add("present_zone", present);
    const auto directory = directory_file_->directory();
    status.add("zone_directory_version", directory ? directory->version() : 0);
    DiagnoseDirectory("_in", status);
    {
      const MutexLock lock(directory_refusal_mutex_);
      status.add("zone_directory_refusal", directory_refusal_);
    }
    for (const auto& [zone, connection] : zones) DiagnoseZone(zone, connection, status);
  }

  void DiagnoseDirectory(const std::string& direction, Diagnostics::Status& status) const {
    status.add(directory_counts_.name + direction, directory_counts_.carried.load());
    status.add(directory_counts_.name + "_bytes", directory_counts_.bytes.load());
    status.add(directory_counts_.name + "_refused", directory_counts_.refused.load());
  }

  static void DiagnoseZone(const std::string& zone, const transport::MqttStatistics& connection,
                           Diagnostics::Status& status) {
    status.add(zone + ".connected", connection.connected);
    status.add(zone + ".broker",
               connection.broker.host + ":" + std::to_string(connection.broker.port));
    status.add(zone + ".last_error", connection.last_error);
    status.add(zone + ".connections", connection.connections);
    status.add(zone + ".connection_failures", connection.connection_failures);
    status.add(zone + ".uplink_bytes", connection.sent_bytes);
    status.add(zone + ".downlink_bytes", connection.received_bytes);
    status.add(zone + ".queued", connection.queued);
    status.add(zone + ".inflight", connection.inflight);
  }

  ros_io::BridgeConfig config_;
  std::vector<std::unique_ptr<Topic>> topics_;  ///< The index is the tag of a publication.
  std::atomic<std::uint64_t> unexpected_{0};    ///< Received on a topic that is not in the list.
  Mutex losses_mutex_;
  OnceAMinute say_losses_again_ GUARDED_BY(losses_mutex_);
  std::set<std::string> said_losses_ GUARDED_BY(losses_mutex_);  ///< In this minute.
  const transport::TopicTemplate directory_topic_{kDirectoryTopic};
  Counts directory_counts_{"zone_directory"};  ///< Their tag is one beyond the topics.
  // Of a zone that has a directory; else null.
  std::unique_ptr<directory::DirectoryHandout> handout_;
  ros::SteadyTimer handout_timer_;
  // Of a vehicle that changes zones; else null.
  directory::DirectoryOffers directory_offers_;
  Mutex directory_refusal_mutex_;
  std::string directory_refusal_ GUARDED_BY(directory_refusal_mutex_);  ///< The last one.
  std::optional<directory::DirectoryFile> directory_file_;
  std::unique_ptr<directory::ZoneHandover> handover_;
  std::vector<std::string> told_zones_;
  std::optional<double> fused_s_;  ///< When the last fused fix came.
  // Of a zone with a standby.
  ros::Subscriber active_subscriber_;
  std::int64_t active_ns_ = 0;  ///< BootNs of the last word that the zone is active; 0: it is not.
  bool was_active_ = false;
  ros::Publisher zones_publisher_;
  ros::Publisher cells_publisher_;    ///< Of a vehicle.
  ros::Subscriber cells_subscriber_;  ///< Of a vehicle that hears of cells.
  std::vector<ros::Subscriber> position_subscribers_;
  ros::SteadyTimer zone_timer_;
  std::unique_ptr<ZoneConnections> connections_;
  std::unique_ptr<Diagnostics> diagnostics_;  ///< Last: it uses the rest.
};

using MqttBridgeNodelet = PartNodelet<MqttBridgePart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::MqttBridgeNodelet, nodelet::Nodelet)
