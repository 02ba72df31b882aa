// The client against a real mosquitto: every test starts one of its own.
#include "transport/mqtt_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>
#include <set>
#include <thread>

#include "common/error.h"
#include "test/transport/broker_process.h"
#include "test/transport/waiting.h"

namespace livemap::transport {
namespace {

using ::testing::HasSubstr;

constexpr char kReport[] = "livemap/v1/test/vehicle/car-1/report";
constexpr char kReports[] = "livemap/v1/test/vehicle/+/report";

std::vector<std::uint8_t> Bytes(const std::string& text) { return {text.begin(), text.end()}; }

/// What a client saw, collected from its network thread.
class Log {
 public:
  MqttCallbacks Callbacks() {
    MqttCallbacks callbacks;
    callbacks.on_message = [this](const MqttMessage& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      payloads_.emplace(reinterpret_cast<const char*>(message.payload.data), message.payload.size);
    };
    callbacks.on_published = [this](const MqttPublishOutcome& outcome) {
      const std::lock_guard<std::mutex> lock(mutex_);
      outcomes_.push_back(outcome);
    };
    callbacks.on_connection = [this](bool connected, const std::string& reason) {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!connected) losses_.push_back(reason);
    };
    callbacks.on_followed = [this](const std::vector<std::string>& topics) {
      const std::lock_guard<std::mutex> lock(mutex_);
      followed_ = topics;
    };
    return callbacks;
  }

  std::set<std::string> payloads() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return payloads_;
  }
  std::vector<MqttPublishOutcome> outcomes() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return outcomes_;
  }
  std::vector<std::string> followed() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return followed_;
  }
  std::vector<std::string> losses() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return losses_;
  }

 private:
  mutable std::mutex mutex_;
  std::set<std::string> payloads_;
  std::vector<MqttPublishOutcome> outcomes_;
  std::vector<std::string> losses_;
  std::vector<std::string> followed_;
};

MqttConfig Login(const BrokerProcess& broker, const std::string& user) {
  MqttConfig options;
  options.port = broker.port();
  options.client_id = user;
  options.user = user;
  options.password = broker.Password(user);
  options.reconnect_min_s = 0.05;
  options.reconnect_max_s = 0.5;
  return options;
}

bool Subscribed(const MqttClient& client) {
  return Eventually([&] { return client.statistics().subscriptions_granted == 1; });
}

class MqttClientTest : public ::testing::Test {
 protected:
  MqttClientTest() { broker_.Start(); }

  BrokerProcess broker_;
  Log zone_log_;
  Log car_log_;
};

TEST_F(MqttClientTest, DeliversAMessageAndReportsItsAcknowledgement) {
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
  ASSERT_TRUE(Subscribed(zone));
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  EXPECT_EQ(car.Publish(kReport, Bytes("hole"), 1, 42), MqttPublishStatus::kQueued);
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 1; }));
  const MqttPublishOutcome outcome = car_log_.outcomes()[0];
  EXPECT_TRUE(outcome.accepted());
  EXPECT_EQ(outcome.tag, 42U);
  EXPECT_EQ(outcome.bytes, std::string(kReport).size() + 4);
  EXPECT_TRUE(Eventually([&] { return zone_log_.payloads() == std::set<std::string>{"hole"}; }));
  EXPECT_EQ(car.statistics().sent_bytes, outcome.bytes);
  EXPECT_EQ(car.statistics().published, 1U);
}

TEST_F(MqttClientTest, ReportsThatTheBrokerDeniesAnotherVehiclesTopic) {
  MqttClient car(Login(broker_, "car-2"), {}, car_log_.Callbacks());
  car.Publish(kReport, Bytes("forged"), 1, 7);
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 1; }));
  EXPECT_EQ(car_log_.outcomes()[0].reason_code, 135);
  EXPECT_FALSE(car_log_.outcomes()[0].accepted());
  EXPECT_EQ(car.statistics().publishes_refused, 1U);
  EXPECT_THAT(car.statistics().last_error, HasSubstr("135"));
  EXPECT_TRUE(car.connected());
}

TEST_F(MqttClientTest, NeverReceivesAnotherVehiclesMessages) {
  const MqttClient spy(Login(broker_, "car-2"), {{"livemap/v1/test/#", 1}}, car_log_.Callbacks());
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
  ASSERT_TRUE(Subscribed(zone));
  ASSERT_TRUE(Subscribed(spy));
  MqttClient car(Login(broker_, "car-1"), {}, {});
  car.Publish(kReport, Bytes("secret"), 1, 0);
  ASSERT_TRUE(Eventually([&] { return zone_log_.payloads().size() == 1; }));
  // The notice comes after the report in the broker's order: once it is here, the report is not.
  MqttClient notifier(Login(broker_, "zone"), {}, {});
  notifier.Publish("livemap/v1/test/notice", Bytes("notice"), 1, 0);
  ASSERT_TRUE(Eventually([&] { return !car_log_.payloads().empty(); }));
  EXPECT_EQ(car_log_.payloads(), std::set<std::string>{"notice"});
}

TEST_F(MqttClientTest, TakesTheFirstAddressThatAnswersAndNamesAllWhenNoneDoes) {
  BrokerProcess first;
  first.Start();
  MqttConfig options = Login(first, "car-1");
  options.password = broker_.Password("car-1");
  first.Kill();
  options.fallbacks = {{"127.0.0.1", FreePort()}, {"127.0.0.1", broker_.port()}};
  const MqttClient car(options, {}, car_log_.Callbacks());
  ASSERT_TRUE(Eventually([&] { return car.connected(); }));
  EXPECT_EQ(car.statistics().broker.port, broker_.port());
  EXPECT_EQ(car.statistics().connection_failures, 0U) << "that was one attempt";
  broker_.Kill();
  // The first loss is the connection's, the second the one of the attempt after it.
  ASSERT_TRUE(Eventually([&] { return car_log_.losses().size() >= 2; }));
  EXPECT_GT(car.statistics().connection_failures, 0U);
  EXPECT_THAT(car_log_.losses().back(), HasSubstr(std::to_string(options.port)));
  EXPECT_THAT(car_log_.losses().back(), HasSubstr(std::to_string(broker_.port())));
}

TEST_F(MqttClientTest, AnAddressThatRefusesTheLoginIsToldAndTheNextOneTaken) {
  BrokerProcess stranger;  // It gave car-1 another password.
  stranger.Start();
  MqttConfig options = Login(broker_, "car-1");
  options.port = stranger.port();
  options.fallbacks = {{"127.0.0.1", broker_.port()}};
  const MqttClient car(options, {}, car_log_.Callbacks());
  ASSERT_TRUE(Eventually([&] { return car.connected(); }));
  EXPECT_EQ(car.statistics().broker.port, broker_.port());
  EXPECT_THAT(car_log_.losses().at(0), HasSubstr("refused the login of 'car-1'"));
}

TEST_F(MqttClientTest, SaysThatTheLoginWasRefusedAndKeepsTrying) {
  MqttConfig options = Login(broker_, "car-1");
  options.password = "wrong";
  const MqttClient car(options, {}, car_log_.Callbacks());
  ASSERT_TRUE(Eventually([&] { return car.statistics().connection_failures >= 2; }));
  EXPECT_FALSE(car.connected());
  EXPECT_EQ(car.statistics().connections, 0U);
  EXPECT_THAT(car_log_.losses().at(0), HasSubstr("refused the login of 'car-1'"));
  EXPECT_THAT(car_log_.losses().at(0), HasSubstr("135"));
}

TEST_F(MqttClientTest, RefusesWhatIsLargerThanTheBrokerAcceptsWithoutLosingTheConnection) {
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  car.Publish(kReport, std::vector<std::uint8_t>((1 << 20) + 8192), 1, 1);
  car.Publish(kReport, std::vector<std::uint8_t>((1 << 20) + 100), 1, 2);
  car.Publish(kReport, std::vector<std::uint8_t>(100), 1, 3);
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 3; }));
  for (const MqttPublishOutcome& outcome : car_log_.outcomes()) {
    EXPECT_EQ(outcome.reason_code >= 128 ? 149 : 0, outcome.tag == 3 ? 0 : 149);
  }
  EXPECT_EQ(car.statistics().connections, 1U);
}

TEST_F(MqttClientTest, ReconnectsAndResumesAfterTheBrokerWasKilled) {
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  std::set<std::string> sent;
  const auto publish = [&](const std::string& text) {
    sent.insert(text);
    car.Publish(kReport, Bytes(text), 1, 0);
  };
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(Subscribed(zone));
    ASSERT_TRUE(Eventually([&] { return car.connected(); }));
    publish("before " + std::to_string(round));
    ASSERT_TRUE(Eventually([&] { return zone_log_.payloads() == sent; }));
    broker_.Kill();
    ASSERT_TRUE(Eventually([&] { return !car.connected() && !zone.connected(); }));
    broker_.LoseState();
    broker_.Start();
    ASSERT_TRUE(Subscribed(zone));
    publish("after " + std::to_string(round));
    ASSERT_TRUE(Eventually([&] { return zone_log_.payloads() == sent; }));
  }
  EXPECT_EQ(car.statistics().connections, 4U);
  EXPECT_EQ(zone.statistics().connections, 4U);
}

TEST_F(MqttClientTest, SendsWhatWasQueuedWhileTheBrokerWasAway) {
  broker_.Kill();
  MqttConfig options = Login(broker_, "car-1");
  options.queue_messages = 3;
  MqttClient car(options, {}, car_log_.Callbacks());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(car.Publish(kReport, Bytes(std::to_string(i)), 1, 0), MqttPublishStatus::kQueued);
  }
  EXPECT_EQ(car.Publish(kReport, Bytes("3"), 1, 0), MqttPublishStatus::kQueueFull);
  EXPECT_EQ(car.statistics().queue_overflows, 1U);
  EXPECT_EQ(car.statistics().queued, 3U);
  ASSERT_TRUE(Eventually([&] { return car.statistics().connection_failures > 0; }));
  EXPECT_THAT(car.statistics().last_error, HasSubstr("Connection refused"));
  broker_.Start();
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 3; }));
  EXPECT_EQ(car.statistics().queued, 0U);
}

TEST_F(MqttClientTest, PublishesFromManyThreadsAtOnce) {
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
  ASSERT_TRUE(Subscribed(zone));
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  constexpr int kThreads = 4;
  constexpr int kEach = 100;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kEach; ++i) {
        car.Publish(kReport, Bytes(std::to_string(t) + ":" + std::to_string(i)), i % 2, 0);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(Eventually([&] { return zone_log_.payloads().size() == kThreads * kEach; }));
  EXPECT_TRUE(Eventually([&] { return car.statistics().published == kThreads * kEach; }));
  EXPECT_EQ(car.statistics().inflight, 0U);
}

TEST_F(MqttClientTest, MayPublishFromACallback) {
  MqttClient* echo = nullptr;
  std::mutex echo_mutex;
  MqttCallbacks callbacks;
  callbacks.on_message = [&](const MqttMessage& message) {
    const std::lock_guard<std::mutex> lock(echo_mutex);
    if (echo == nullptr) return;
    echo->Publish("livemap/v1/test/notice",
                  {message.payload.data, message.payload.data + message.payload.size}, 1, 0);
  };
  MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, callbacks);
  {
    const std::lock_guard<std::mutex> lock(echo_mutex);
    echo = &zone;
  }
  ASSERT_TRUE(Subscribed(zone));
  MqttClient car(Login(broker_, "car-1"), {{"livemap/v1/test/notice", 1}}, car_log_.Callbacks());
  ASSERT_TRUE(Subscribed(car));
  car.Publish(kReport, Bytes("hole"), 1, 0);
  EXPECT_TRUE(Eventually([&] { return car_log_.payloads().count("hole") == 1; }));
}

TEST_F(MqttClientTest, SurvivesACallbackThatThrows) {
  MqttCallbacks callbacks;
  callbacks.on_message = [](const MqttMessage&) { throw Error("no room for it"); };
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, callbacks);
  ASSERT_TRUE(Subscribed(zone));
  MqttClient car(Login(broker_, "car-1"), {}, {});
  car.Publish(kReport, Bytes("hole"), 1, 0);
  EXPECT_TRUE(Eventually(
      [&] { return zone.statistics().last_error.find("no room for it") != std::string::npos; }));
  EXPECT_TRUE(zone.connected());
}

TEST_F(MqttClientTest, ReceivesWhatCameWhileItWasAwayFromItsKeptSession) {
  {
    const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
    ASSERT_TRUE(Subscribed(zone));
  }
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  car.Publish(kReport, Bytes("hole"), 1, 0);
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 1; }));
  const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, zone_log_.Callbacks());
  EXPECT_TRUE(Eventually([&] { return zone_log_.payloads().count("hole") == 1; }));
}

TEST_F(MqttClientTest, ForgetsItsSessionOnACleanStart) {
  {
    const MqttClient zone(Login(broker_, "zone"), {{kReports, 1}}, {});
    ASSERT_TRUE(Subscribed(zone));
  }
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  car.Publish(kReport, Bytes("missed"), 1, 0);
  ASSERT_TRUE(Eventually([&] { return car_log_.outcomes().size() == 1; }));
  MqttConfig options = Login(broker_, "zone");
  options.clean_start = true;
  const MqttClient zone(options, {{kReports, 1}}, zone_log_.Callbacks());
  ASSERT_TRUE(Subscribed(zone));
  car.Publish(kReport, Bytes("seen"), 1, 0);
  ASSERT_TRUE(Eventually([&] { return zone_log_.payloads().count("seen") == 1; }));
  EXPECT_EQ(zone_log_.payloads(), std::set<std::string>{"seen"});
}

TEST_F(MqttClientTest, IsThrownOutByALaterLoginAndTakesItsPlaceBackAfterwards) {
  const MqttClient first(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  ASSERT_TRUE(Eventually([&] { return first.connected(); }));
  {
    const MqttClient second(Login(broker_, "car-1"), {}, {});
    ASSERT_TRUE(Eventually([&] { return !car_log_.losses().empty(); }));
  }
  EXPECT_TRUE(Eventually([&] { return first.statistics().connections >= 2; }));
  EXPECT_FALSE(car_log_.losses().at(0).empty());
}

TEST(MqttClientStop, DoesNotWaitForASilentBroker) {
  // Accepts connections in the kernel's backlog and never answers.
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(listener, 16), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  MqttConfig options;
  options.port = ntohs(address.sin_port);
  options.client_id = "car-1";
  { const MqttClient car(options, {}, {}); }  // A hang here is the failure.
  close(listener);
}

TEST(MqttClientOptions, RefusesValuesThatItCannotKeep) {
  const auto refuses = [](const std::function<void(MqttConfig&)>& spoil) {
    MqttConfig options;
    options.client_id = "car-1";
    options.port = 1;
    spoil(options);
    EXPECT_THROW(MqttClient(options, {}, {}), Error);
  };
  refuses([](MqttConfig& options) { options.client_id.clear(); });
  refuses([](MqttConfig& options) { options.port = 70000; });
  refuses([](MqttConfig& options) { options.keepalive_s = 1; });
  refuses([](MqttConfig& options) { options.max_inflight = 0; });
  refuses([](MqttConfig& options) { options.reconnect_min_s = 0; });
  refuses([](MqttConfig& options) { options.reconnect_max_s = 0.1; });
  refuses([](MqttConfig& options) { options.tls = MqttTlsConfig{"/no/ca.pem", "", ""}; });
}

using Topics = std::vector<std::string>;

TEST_F(MqttClientTest, HearsOfTheTopicsThatItFollowsAndNoLongerOfThoseOfBefore) {
  const std::string cells = "livemap/v1/test/notice/";
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  car.Follow({cells + "1", cells + "2"}, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.followed() == Topics{cells + "1", cells + "2"}; }));
  MqttClient zone(Login(broker_, "zone"), {}, zone_log_.Callbacks());
  zone.Publish(cells + "1", Bytes("first"), 1, 1);
  zone.Publish(cells + "3", Bytes("far away"), 1, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.payloads().count("first") == 1; }));
  car.Follow({cells + "2", cells + "3"}, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.followed() == Topics{cells + "2", cells + "3"}; }));
  zone.Publish(cells + "1", Bytes("behind"), 1, 1);
  zone.Publish(cells + "3", Bytes("near now"), 1, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.payloads().count("near now") == 1; }));
  EXPECT_EQ(car_log_.payloads(), (std::set<std::string>{"first", "near now"}));
}

TEST_F(MqttClientTest, FollowsAgainAfterTheBrokerWasLost) {
  const std::string topic = "livemap/v1/test/notice/1";
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  car.Follow({topic}, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.followed() == Topics{topic}; }));
  broker_.Kill();
  ASSERT_TRUE(Eventually([&] { return car_log_.followed().empty(); }));
  broker_.LoseState();
  broker_.Start();
  ASSERT_TRUE(Eventually([&] { return car_log_.followed() == Topics{topic}; }));
  MqttClient zone(Login(broker_, "zone"), {}, zone_log_.Callbacks());
  zone.Publish(topic, Bytes("again"), 1, 1);
  EXPECT_TRUE(Eventually([&] { return car_log_.payloads().count("again") == 1; }));
}

TEST_F(MqttClientTest, LeavesTheTopicsThatAnEarlierProcessFollowed) {
  const std::string topic = "livemap/v1/test/notice/1";
  MqttClient zone(Login(broker_, "zone"), {}, zone_log_.Callbacks());
  {
    MqttClient before(Login(broker_, "car-1"), {}, zone_log_.Callbacks());
    before.Follow({topic}, 1);
    ASSERT_TRUE(Eventually([&] { return zone_log_.followed() == Topics{topic}; }));
  }
  MqttClient car(Login(broker_, "car-1"), {}, car_log_.Callbacks());
  ASSERT_TRUE(Eventually([&] { return car.connected(); }));
  // The first one makes it leave.
  zone.Publish(topic, Bytes("first"), 1, 1);
  ASSERT_TRUE(Eventually([&] { return car_log_.payloads().count("first") == 1; }));
  EXPECT_TRUE(Eventually([&] {
    const std::size_t before = zone_log_.outcomes().size();
    zone.Publish(topic, Bytes("again"), 1, 1);
    Eventually([&] { return zone_log_.outcomes().size() > before; });
    return zone_log_.outcomes().back().has_no_listener();
  }));
}

}  // namespace
}  // namespace livemap::transport
