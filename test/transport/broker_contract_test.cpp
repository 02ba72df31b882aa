// What LiveMap needs of a broker (docs/reference/broker.md#the-contract), on each broker that it is
// said to work with. What a broker is known to lack is tested as well: the test fails once the
// broker no longer lacks it, or has another fault than it is known by.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "common/error.h"
#include "test/transport/contract_broker.h"
#include "test/transport/waiting.h"
#include "transport/mqtt_client.h"
#include "transport/topic_template.h"

namespace livemap::transport {
namespace {

constexpr char kPrefix[] = "livemap/v1/demo/";
constexpr int kNotAuthorized = 135;
constexpr int kTooLarge = 149;
constexpr int kRefused = 128;  // From here on.

bool IsAccepted(int reason) { return reason >= 0 && reason < kRefused; }

std::string Below(const std::string& name) { return kPrefix + name; }
std::string Of(const std::string& vehicle, const std::string& name) {
  return Below("vehicle/" + vehicle + "/" + name);
}

using Subscriptions = std::vector<MqttSubscription>;

/// Of a client: what it heard and how its messages ended, in order.
class ContractClient {
 public:
  explicit ContractClient(const MqttConfig& config, const Subscriptions& subscriptions = {})
      : subscriptions_(subscriptions.size()), client_(config, subscriptions, Callbacks()) {}

  bool LogsIn() {
    return Eventually([&] { return client_.connected(); });
  }

  /// Whether the broker let it in and answered all its subscriptions, with a refusal or without.
  bool IsReady() {
    return LogsIn() && Eventually([&] {
             const MqttStatistics now = client_.statistics();
             return now.subscriptions_granted + now.subscriptions_refused == subscriptions_;
           });
  }

  /// The broker's reason for a message of QoS 1; -1 when none came because the connection was lost.
  int Publish(const std::string& topic, const std::string& payload, int qos = 1) {
    Eventually([&] { return client_.connected() || losses() > 0; });
    const std::size_t lost = losses();
    if (!client_.connected()) return -1;
    const std::size_t before = Locked([&] { return reasons_.size(); });
    client_.Publish(topic, {payload.begin(), payload.end()}, qos, 0);
    Eventually([&] { return Locked([&] { return reasons_.size(); }) > before || losses() > lost; });
    return Locked([&] { return reasons_.size() > before ? reasons_.back() : -1; });
  }

  bool Hears(const std::string& topic, const std::string& payload) {
    return Eventually([&] { return HasHeard(topic, payload); });
  }
  bool HasHeard(const std::string& topic, const std::string& payload) {
    return Locked([&] {
      for (const auto& [where, what] : messages_) {
        if (where == topic && what == payload) return true;
      }
      return false;
    });
  }

  std::vector<std::string> payloads() {
    return Locked([&] {
      std::vector<std::string> payloads;
      for (const auto& [topic, payload] : messages_) payloads.push_back(payload);
      return payloads;
    });
  }
  std::vector<std::string> followed() {
    return Locked([&] { return followed_; });
  }
  std::size_t losses() {
    return Locked([&] { return losses_; });
  }
  MqttClient& client() { return client_; }

 private:
  template <typename Read>
  auto Locked(Read read) -> decltype(read()) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return read();
  }

  MqttCallbacks Callbacks() {
    MqttCallbacks callbacks;
    callbacks.on_message = [this](const MqttMessage& message) {
      const auto* bytes = reinterpret_cast<const char*>(message.payload.data);
      Locked([&] {
        messages_.emplace_back(message.topic, std::string(bytes, message.payload.size));
        return 0;
      });
    };
    callbacks.on_published = [this](const MqttPublishOutcome& outcome) {
      Locked([&] {
        reasons_.push_back(outcome.reason_code);
        return 0;
      });
    };
    callbacks.on_connection = [this](bool connected, const std::string&) {
      Locked([&] { return losses_ += connected ? 0 : 1; });
    };
    callbacks.on_followed = [this](const std::vector<std::string>& topics) {
      Locked([&] {
        followed_ = topics;
        return 0;
      });
    };
    return callbacks;
  }

  const std::size_t subscriptions_;
  std::mutex mutex_;
  std::vector<std::pair<std::string, std::string>> messages_;
  std::vector<int> reasons_;
  std::size_t losses_ = 0;
  std::vector<std::string> followed_;
  MqttClient client_;  // Last: its thread uses everything above.
};

class BrokerContract : public ::testing::TestWithParam<BrokerKind> {
 protected:
  static void TearDownTestSuite() { Started().clear(); }

  void SetUp() override {
    if (!IsBrokerInstalled(GetParam())) {
      GTEST_SKIP() << "skipped, no ejabberd; apt-get install ejabberd brings it";
    }
  }

  /// One of each kind for all tests: to start it takes longer than they do.
  static ContractBroker& broker() {
    const auto [started, is_first] = Started().try_emplace(GetParam());
    if (is_first) started->second = std::make_unique<ContractBroker>(GetParam());
    if (!started->second) throw Error("this broker did not start; the first test says why");
    return *started->second;
  }

  MqttConfig Login(const std::string& name) { return broker().Login(name); }

  /// A login that the broker keeps a session of when it is away.
  MqttConfig KeptLogin(const std::string& name) {
    MqttConfig config = broker().Login(name);
    config.clean_start = false;
    config.session_expiry_s = 600;
    return config;
  }

  /// The zone, listening to everything that vehicles write.
  MqttConfig ZoneLogin() { return Login("zone"); }
  static Subscriptions ZoneSubscriptions() {
    Subscriptions all;
    for (const char* name : kOfVehicles) all.push_back({Of("+", name), 1});
    return all;
  }

  /// The sentence says what the broker did instead of what this test wants of it; empty: it did
  /// that. A broker that is known to lack it has the fault by which it is known, and no other.
  void Expect(const std::string& fault) {
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    EXPECT_EQ(fault, broker().KnownFault(name.substr(0, name.find('/'))))
        << "expected is nothing, or what this broker is said to do in broker.md";
  }

  static constexpr const char* kOfVehicles[] = {"report",    "position", "answer",
                                                "candidate", "change",   "cell_request"};
  static constexpr const char* kOfZone[] = {"receipt",      "change_receipt", "notice",
                                            "cell_hazards", "poll",           "directory"};

 private:
  static std::map<BrokerKind, std::unique_ptr<ContractBroker>>& Started() {
    static std::map<BrokerKind, std::unique_ptr<ContractBroker>> started;
    return started;
  }
};

TEST_P(BrokerContract, LetsAVehicleWriteItsOwnTopics) {
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ASSERT_TRUE(zone.IsReady());
  ContractClient car(Login("1001"));
  std::string fault;
  for (const char* name : kOfVehicles) {
    if (car.Publish(Of("1001", name), "hole") != 0) fault = std::string(name) + " was not accepted";
    if (!zone.Hears(Of("1001", name), "hole")) fault = std::string(name) + " did not arrive";
  }
  Expect(fault);
}

TEST_P(BrokerContract, LetsAVehicleWriteNothingElse) {
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ContractClient other(Login("1002"), {{Below("notice"), 1}, {Of("1002", "poll"), 1}});
  ASSERT_TRUE(zone.IsReady() && other.IsReady());
  ContractClient car(Login("1001"));
  std::vector<std::string> topics = {Below("notice"),       Below("notice/123012301230123"),
                                     Of("1002", "poll"),    Of("1001", "other"),
                                     Below("vehicle/1001"), "livemap/v1/other/vehicle/1001/report"};
  for (const char* name : kOfVehicles) topics.push_back(Of("1002", name));
  for (const char* name : kOfZone) topics.push_back(Of("1001", name));
  std::string fault;
  for (const std::string& topic : topics) {
    if (car.Publish(topic, "forged") < kRefused) fault = topic + " was accepted";
  }
  if (!car.client().connected()) fault = "the connection was lost";
  car.Publish(Of("1001", "report"), "true");
  if (!zone.Hears(Of("1001", "report"), "true")) fault = "the vehicle's own topic is refused, too";
  if (zone.payloads() != std::vector<std::string>{"true"}) fault = "the zone heard a forged one";
  if (!other.payloads().empty()) fault = "a vehicle heard a forged one";
  Expect(fault);
}

TEST_P(BrokerContract, SaysNotAuthorized) {
  ContractClient car(Login("1001"));
  const int reason = car.Publish(Of("1002", "report"), "forged");
  Expect(reason == kNotAuthorized ? "" : "it said reason " + std::to_string(reason));
}

TEST_P(BrokerContract, LetsAVehicleHearItsOwnTopicsAndNoOthers) {
  ContractClient spy(Login("1002"), {{"#", 1},
                                     {Below("#"), 1},
                                     {Below("vehicle/#"), 1},
                                     {"+/+/+/+/+/+", 1},
                                     {Of("+", "poll"), 1},
                                     {Of("1001", "poll"), 1},
                                     {Of("1001", "report"), 1},
                                     {Of("1002", "poll"), 1}});
  ASSERT_TRUE(spy.IsReady());
  ContractClient car(Login("1001"), {{Of("1001", "poll"), 1}});
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ASSERT_TRUE(car.IsReady() && zone.IsReady());
  car.Publish(Of("1001", "report"), "secret report");
  zone.Publish(Of("1001", "poll"), "secret poll");
  // By the broker's order of one publisher's messages: once this is here, the others are not.
  zone.Publish(Of("1002", "poll"), "own poll");
  std::string fault;
  if (!car.Hears(Of("1001", "poll"), "secret poll")) fault = "a vehicle did not hear its own";
  if (!spy.Hears(Of("1002", "poll"), "own poll")) fault = "the other vehicle did not hear its own";
  for (const std::string& payload : spy.payloads()) {
    if (payload != "own poll") fault = "a vehicle heard another one's";
  }
  Expect(fault);
}

TEST_P(BrokerContract, TellsAVehicleByEachOfItsTopics) {
  std::vector<std::string> topics = {Below("notice"), Below("notice/123012301230123")};
  for (const char* name : kOfZone) topics.push_back(Of("1001", name));
  Subscriptions subscriptions;
  for (const std::string& topic : topics) subscriptions.push_back({topic, 1});
  ContractClient car(Login("1001"), subscriptions);
  ContractClient zone(ZoneLogin());
  ASSERT_TRUE(car.IsReady() && zone.IsReady());
  std::string fault;
  for (const std::string& topic : topics) {
    if (zone.Publish(topic, "told") != 0) fault = topic + " was not accepted";
    if (!car.Hears(topic, "told")) fault = topic + " did not arrive";
  }
  Expect(fault);
}

TEST_P(BrokerContract, TellsTheVehiclesThatFollowACell) {
  const std::string here = Below("notice/123012301230123");
  const std::string there = Below("notice/123012301230120");
  ContractClient zone(ZoneLogin());
  ContractClient car(Login("1001"));
  ASSERT_TRUE(zone.IsReady() && car.IsReady());
  car.client().Follow({here, there}, 1);
  const bool granted = Eventually([&] {
    return car.followed() == std::vector<std::string>{there, here};
  });
  zone.Publish(here, "first");
  const bool heard = car.Hears(here, "first");
  car.client().Follow({there}, 1);
  const bool left = Eventually([&] { return zone.Publish(here, "unheard") == 16; });
  zone.Publish(there, "last");
  const bool heard_last = car.Hears(there, "last");
  Expect(!granted      ? "a cell was not granted"
         : !heard      ? "a notice of a followed cell did not arrive"
         : !left       ? "a cell that was left still has a listener"
         : !heard_last ? "the cell that stayed is no longer heard"
                       : "");
}

TEST_P(BrokerContract, SaysThatNobodyListens) {
  ContractClient zone(ZoneLogin());
  ASSERT_TRUE(zone.IsReady());
  const int reason = zone.Publish(Of("1001", "directory"), "list");
  Expect(reason == 16 ? "" : "it said reason " + std::to_string(reason));
}

TEST_P(BrokerContract, DeliversInTheOrderOfSending) {
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ASSERT_TRUE(zone.IsReady());
  ContractClient car(Login("1001"));
  std::vector<std::string> sent;
  for (int i = 0; i < 300; ++i) {
    sent.push_back(std::to_string(i));
    car.client().Publish(Of("1001", "report"), {sent.back().begin(), sent.back().end()}, 1, 0);
  }
  const bool complete = Eventually([&] { return zone.payloads().size() >= sent.size(); });
  Expect(!complete                 ? "messages are missing"
         : zone.payloads() != sent ? "messages came in another order or twice"
                                   : "");
}

TEST_P(BrokerContract, DeliversAReceiptOfQosZero) {
  ContractClient car(Login("1001"), {{Of("1001", "receipt"), 0}});
  ContractClient zone(ZoneLogin());
  ASSERT_TRUE(car.IsReady() && zone.IsReady());
  zone.Publish(Of("1001", "receipt"), "committed", 0);
  Expect(car.Hears(Of("1001", "receipt"), "committed") ? "" : "it did not arrive");
}

TEST_P(BrokerContract, CarriesAReportOfOneMebibyte) {
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ContractClient car(Login("1001"));
  ASSERT_TRUE(zone.IsReady() && car.IsReady());
  const std::string report(1 << 20, 'r');
  car.Publish(Of("1001", "report"), report);
  Expect(zone.Hears(Of("1001", "report"), report) ? "" : "it did not arrive");
}

TEST_P(BrokerContract, CarriesTheLargestZoneDirectory) {
  ContractClient car(Login("1001"), {{Of("1001", "directory"), 1}});
  ContractClient zone(ZoneLogin());
  ASSERT_TRUE(car.IsReady() && zone.IsReady());
  const std::string directory(2064 << 10, 'd');
  zone.Publish(Of("1001", "directory"), directory);
  Expect(car.Hears(Of("1001", "directory"), directory) ? "" : "it did not arrive");
}

TEST_P(BrokerContract, RefusesWhatIsTooLargeAndKeepsTheConnection) {
  ContractClient car(Login("1001"));
  ASSERT_TRUE(car.IsReady());
  const int reason = car.Publish(Of("1001", "report"), std::string(3 << 20, 'x'));
  Expect(reason == kTooLarge ? ""
         : reason < 0        ? "it ended the connection"
                             : "it said reason " + std::to_string(reason));
}

TEST_P(BrokerContract, KeepsWhatComesWhileAClientIsAway) {
  {
    ContractClient zone(KeptLogin("zone"), ZoneSubscriptions());
    ASSERT_TRUE(zone.IsReady());
  }
  ContractClient car(Login("1001"));
  const int reason = car.Publish(Of("1001", "report"), "meanwhile");
  ContractClient zone(KeptLogin("zone"), ZoneSubscriptions());
  Expect(reason != 0 ? "it said reason " + std::to_string(reason)
         : !zone.Hears(Of("1001", "report"), "meanwhile") ? "it was lost"
                                                          : "");
}

TEST_P(BrokerContract, ForgetsASessionOnACleanStart) {
  {
    ContractClient zone(KeptLogin("zone"), ZoneSubscriptions());
    ASSERT_TRUE(zone.IsReady());
  }
  ContractClient car(Login("1001"));
  car.Publish(Of("1001", "report"), "before");
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ASSERT_TRUE(zone.IsReady());
  car.Publish(Of("1001", "report"), "after");
  zone.Hears(Of("1001", "report"), "after");
  Expect(zone.payloads() == std::vector<std::string>{"after"} ? "" : "it kept the session");
}

TEST_P(BrokerContract, GivesASessionToTheLaterLogin) {
  ContractClient first(KeptLogin("zone"), ZoneSubscriptions());
  ASSERT_TRUE(first.IsReady());
  // It asks for nothing itself: what it hears, it hears by the session.
  ContractClient second(KeptLogin("zone"));
  ASSERT_TRUE(second.LogsIn());
  const bool lost = Eventually([&] { return first.losses() > 0; });
  ContractClient car(Login("1001"));
  car.Publish(Of("1001", "report"), "hole");
  Expect(!lost                                         ? "both stayed connected"
         : !second.Hears(Of("1001", "report"), "hole") ? "the session was lost"
                                                       : "");
}

TEST_P(BrokerContract, EndsTheFirstLoginOfAName) {
  MqttConfig elsewhere = Login("1001");
  elsewhere.client_id = "elsewhere";
  ContractClient first(Login("1001"));
  ASSERT_TRUE(first.LogsIn());
  ContractClient second(elsewhere);
  ASSERT_TRUE(second.LogsIn());
  // A broker that ends the first login does so before it answers the second one.
  const bool is_lost = first.Publish(Of("1001", "report"), "still here") < 0 || first.losses() > 0;
  Expect(is_lost ? "" : "two clients were in under one name");
}

TEST_P(BrokerContract, LetsNoVehicleTakeAnotherOnesSession) {
  ContractClient car(KeptLogin("1001"), {{Of("1001", "poll"), 1}});
  ASSERT_TRUE(car.IsReady());
  MqttConfig thief_login = KeptLogin("1002");
  thief_login.client_id = "1001";
  ContractClient thief(thief_login);
  ASSERT_TRUE(thief.LogsIn());
  ContractClient zone(ZoneLogin());
  zone.Publish(Of("1001", "poll"), "question");
  Expect(!car.Hears(Of("1001", "poll"), "question") ? "the vehicle no longer hears its own topics"
         : car.losses() > 0                         ? "the vehicle was thrown out"
         : !thief.payloads().empty()                ? "another vehicle heard it"
                                                    : "");
}

/// What one of mosquitto's own clients prints: LiveMap's client neither retains nor asks for what
/// is retained.
std::string RunMosquittoClient(const std::string& program, const MqttConfig& login,
                               const std::string& arguments) {
  const std::string command = program + " -V 5 -q 1 -h " + login.host + " -p " +
                              std::to_string(login.port) + " --cafile " + login.tls->ca_file +
                              " --cert " + login.tls->certificate_file + " --key " +
                              login.tls->key_file + " -u " + login.user + " -i " + login.client_id +
                              " -t " + Of("1001", "report") + " " + arguments + " 2>&1";
  FILE* output = popen(command.c_str(), "r");
  std::string text(100, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), output));
  pclose(output);
  return text;
}

TEST_P(BrokerContract, RetainsNothing) {
  RunMosquittoClient("mosquitto_pub", Login("1001"), "--retain -m left");
  std::future<std::string> first = std::async(std::launch::async, [login = ZoneLogin()] {
    return RunMosquittoClient("mosquitto_sub", login, "-C 1");
  });
  ContractClient car(Login("1001"));
  const auto is_over = [&] {
    car.Publish(Of("1001", "report"), "now");
    return first.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  ASSERT_TRUE(Eventually(is_over));
  const std::string heard = first.get();
  Expect(heard == "now\n" ? "" : "a later subscriber heard '" + heard + "'");
}

TEST_P(BrokerContract, SendsNoRetainedMessageToWhoAsksForNone) {
  RunMosquittoClient("mosquitto_pub", Login("1001"), "--retain -m left");
  ContractClient zone(ZoneLogin(), ZoneSubscriptions());
  ASSERT_TRUE(zone.IsReady());
  ContractClient car(Login("1001"));
  car.Publish(Of("1001", "report"), "now");
  zone.Hears(Of("1001", "report"), "now");
  Expect(zone.payloads() == std::vector<std::string>{"now"} ? "" : "it was sent what was left");
  // Where the broker keeps one, it is to be gone.
  RunMosquittoClient("mosquitto_pub", Login("1001"), "--retain --null-message");
}

TEST_P(BrokerContract, LetsNobodyInWithoutACertificate) {
  const MqttConfig login = Login("1001");
  const std::string command = "mosquitto_pub -V 5 -q 1 -h " + login.host + " -p " +
                              std::to_string(login.port) + " --cafile " + login.tls->ca_file +
                              " -u 1001 -i 1001 -t " + Of("1001", "report") + " -m forged";
  // Else any refusal would do: a wrong address, or a program that is missing.
  ASSERT_EQ(RunMosquittoClient("mosquitto_pub", login, "-m true"), "");
  Expect(std::system((command + " >/dev/null 2>&1").c_str()) == 0 ? "it let a stranger in" : "");
}

TEST_P(BrokerContract, LetsNobodyInWithoutACertificateOfTheAuthority) {
  ContractClient stranger(broker().Login("1001", "stranger"));
  const bool refused = Eventually([&] { return stranger.losses() > 0; });
  Expect(refused && stranger.client().statistics().connections == 0 ? "" : "it let a stranger in");
}

TEST_P(BrokerContract, KnowsAVehicleByItsCertificateAlone) {
  // It shows the certificate of 1001 and says that it is 1002. A broker may refuse it, or let it in
  // as 1001.
  ContractClient car(broker().Login("1002", "1001"));
  const int reason = car.Publish(Of("1002", "report"), "forged");
  Expect(IsAccepted(reason) ? "it let 1001 write as 1002" : "");
}

TEST_P(BrokerContract, TakesNothingFromARevokedVehicle) {
  ContractClient car(Login("1003"));
  const int reason = car.Publish(Of("1003", "report"), "hole");
  Expect(IsAccepted(reason) ? "it took a report" : "");
}

TEST_P(BrokerContract, RefusesTheLoginOfARevokedVehicle) {
  ContractClient car(Login("1003"));
  ASSERT_TRUE(Eventually([&] { return car.client().connected() || car.losses() > 0; }));
  Expect(car.client().connected() ? "it let the vehicle in" : "");
}

TEST_P(BrokerContract, TakesNamesWithLetters) {
  ContractClient car(Login("car-1"));
  const int reason = car.Publish(Of("car-1", "report"), "hole");
  Expect(reason == 16 ? "" : "it said reason " + std::to_string(reason));
}

TEST_P(BrokerContract, LetsNoVehicleWriteItsNameInOtherCase) {
  ContractClient car(Login("car-1"));
  const int reason = car.Publish(Of("Car-1", "report"), "hole");
  Expect(reason >= kRefused ? "" : "one vehicle may have several names");
}

TEST_P(BrokerContract, TakesANameAsItIsWritten) {
  // Its digits are those of Unicode's block of full-width forms.
  const std::string topic = Of("１００１", "report");
  EXPECT_FALSE(TopicTemplate("livemap/v1/{zone}/vehicle/{vehicle}/report").Match(topic))
      << "the zone's bridge has to refuse it where the broker does not";
  ContractClient car(Login("1001"));
  const int reason = car.Publish(topic, "hole");
  Expect(reason >= kRefused ? "" : "it took it for the vehicle's own");
}

std::vector<BrokerKind> BrokersUnderTest() {
  if (IsBrokerAddressed()) return {BrokerKind::kAddressed};
  return {BrokerKind::kMosquitto, BrokerKind::kEjabberd};
}

INSTANTIATE_TEST_SUITE_P(Brokers, BrokerContract, ::testing::ValuesIn(BrokersUnderTest()),
                         [](const ::testing::TestParamInfo<BrokerKind>& tested) {
                           return NameOf(tested.param);
                         });

}  // namespace
}  // namespace livemap::transport
