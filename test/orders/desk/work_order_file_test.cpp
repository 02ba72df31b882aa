#include "orders/desk/work_order_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"

namespace livemap::orders {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class WorkOrderFileTest : public testing::Test {
 protected:
  WorkOrderFileTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "livemap_file_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    WriteSecret(0600);
  }
  ~WorkOrderFileTest() override { std::filesystem::remove_all(folder_); }

  void WriteSecret(mode_t mode) const {
    std::ofstream(folder_ + "/secret") << "hunter2hunter2\n";
    chmod((folder_ + "/secret").c_str(), mode);
  }
  WorkOrderConfig Parse(const std::string& text) const {
    return ParseWorkOrders(text, "orders.yaml", folder_);
  }
  std::string WhyRefused(const std::string& text) const {
    try {
      Parse(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "it is accepted";
  }
  static std::string Hook(const std::string& more = "", const std::string& rule = "") {
    return "recipients:\n"
           "  - {name: works, kind: webhook, url: 'https://works.example/hook', secret_file: "
           "secret" +
           more + "}\nrules:\n  - {recipient: works" + rule + "}\n";
  }
  static std::string Mail(const std::string& server, const std::string& more) {
    return "recipients:\n  - {name: roads, kind: mail, server: '" + server +
           "', from: map@city.example, to: [roads@city.example]" + more +
           "}\nrules:\n  - recipient: roads\n";
  }

  std::string folder_;
};

TEST_F(WorkOrderFileTest, ReadsRecipientsOfAllKindsAndRules) {
  const WorkOrderConfig config = Parse(R"(
recipients:
  - name: roads
    kind: mail
    server: smtp://mail.city.example:587
    user: map
    password_file: secret
    from: map@city.example
    to: [roads@city.example, night@city.example]
  - name: works
    kind: webhook
    url: https://works.example/hook
    secret_file: secret
    timeout_s: 5
  - name: city311
    kind: open311
    url: https://311.city.example/v2/
    jurisdiction_id: city.example
    api_key_file: secret
    services: {pothole: "001", debris: "042"}
    poll_s: 60
rules:
  - recipient: city311
    classes: [pothole, debris]
    area: [[-80, 40], [-79, 40], [-79, 41]]
    min_confidence: 0.5
  - recipient: works
    when: active
    delay_s: 0
retry_s: 10
)");
  ASSERT_EQ(config.recipients.size(), 3U);
  EXPECT_TRUE(std::get<MailSender::Config>(config.recipients[0].way).needs_tls);
  EXPECT_EQ(std::get<MailSender::Config>(config.recipients[0].way).password, "hunter2hunter2");
  EXPECT_EQ(config.recipients[1].timeout_s, 5);
  const auto& open311 = std::get<Open311Sender::Config>(config.recipients[2].way);
  EXPECT_EQ(open311.url, "https://311.city.example/v2");
  EXPECT_EQ(open311.services.at("debris"), "042");
  ASSERT_EQ(config.rules.size(), 2U);
  zone::Hazard hazard;
  hazard.class_name = "pothole";
  hazard.confidence = 0.6F;
  hazard.position = {40.2, -79.2};
  EXPECT_TRUE(config.rules[0].Matches(hazard));
  hazard.position = {40.9, -79.9};
  EXPECT_FALSE(config.rules[0].Matches(hazard)) << "it lies outside of the area";
  EXPECT_TRUE(config.rules[1].Matches(hazard));
  hazard.position = {40.2, -79.2};
  hazard.confidence = 0.4F;
  EXPECT_FALSE(config.rules[0].Matches(hazard)) << "it is too uncertain";
  hazard.confidence = 0.6F;
  hazard.class_name = "deer";
  EXPECT_FALSE(config.rules[0].Matches(hazard)) << "it is of another class";
  EXPECT_EQ(config.rules[0].delay_s, 60);
  EXPECT_EQ(config.rules[1].when, OrderRule::When::kActive);
  EXPECT_EQ(config.retry_s, 10);
}

TEST_F(WorkOrderFileTest, AMistakeIsNamedWithItsLineAndWhatIsAccepted) {
  EXPECT_THAT(WhyRefused(Hook("", ", min_confidence: 2")),
              AllOf(HasSubstr("'orders.yaml', line 4"), HasSubstr("'min_confidence' is '2'"),
                    HasSubstr("from 0 to 1")));
  EXPECT_THAT(WhyRefused(Hook("", ", min_confidence: .nan")), HasSubstr("from 0 to 1"));
  EXPECT_THAT(WhyRefused(Hook("", ", colour: red")),
              AllOf(HasSubstr("'colour' is unknown"), HasSubstr("min_confidence")));
  EXPECT_THAT(WhyRefused(Hook("", ", area: [[0, 0], [1, 95], [2, 0]]")), HasSubstr("latitude 95"));
  EXPECT_THAT(WhyRefused("rules: []"), HasSubstr("'recipients' is missing"));
  EXPECT_THAT(WhyRefused("recipients: [{name: a, kind: pigeon}]\nrules: []"),
              HasSubstr("accepted is mail, webhook or open311"));
  EXPECT_THAT(WhyRefused(":"), HasSubstr("orders.yaml"));
}

TEST_F(WorkOrderFileTest, WithoutTlsNothingLeavesThisMachine) {
  EXPECT_THAT(WhyRefused("recipients:\n  - {name: w, kind: webhook, url: 'http://works.example/', "
                         "secret_file: secret}\nrules:\n  - recipient: w\n"),
              HasSubstr("https://"));
  EXPECT_THAT(WhyRefused("recipients:\n  - {name: w, kind: webhook, url: 'http://127.0.0.1.evil/', "
                         "secret_file: secret}\nrules:\n  - recipient: w\n"),
              HasSubstr("https://"));
  EXPECT_THAT(WhyRefused("recipients:\n  - {name: w, kind: webhook, url: 'http://localhost@evil/', "
                         "secret_file: secret}\nrules:\n  - recipient: w\n"),
              HasSubstr("https://"));
  EXPECT_THAT(WhyRefused(Mail("smtp://mail.example:25", ", tls: none")), HasSubstr("'tls'"));
  EXPECT_THAT(WhyRefused(Mail("smtp://127.0.0.1:25", ", tls: none")), HasSubstr("accepted"));
  EXPECT_THAT(WhyRefused(Mail("file:///etc/passwd", "")), HasSubstr("smtp://"));
  EXPECT_THAT(WhyRefused(Mail("smtp://mail.example:25/x", "")), HasSubstr("smtp://"));
}

TEST_F(WorkOrderFileTest, ASecretIsReadFromAFileOfItsOwnerAndNeverSaid) {
  WriteSecret(0644);
  EXPECT_THAT(WhyRefused(Hook()), AllOf(HasSubstr("0600"), Not(HasSubstr("hunter2"))));
  std::filesystem::remove(folder_ + "/secret");
  EXPECT_THAT(WhyRefused(Hook()), HasSubstr("cannot be read"));
  std::ofstream(folder_ + "/secret") << "hunter 2\n";
  chmod((folder_ + "/secret").c_str(), 0600);
  EXPECT_THAT(WhyRefused(Hook()), AllOf(HasSubstr("first line"), Not(HasSubstr("hunter"))));
}

TEST_F(WorkOrderFileTest, RefusesRulesForNobodyAndNamesThatStandTwice) {
  EXPECT_THAT(
      WhyRefused("recipients:\n"
                 "  - {name: a, kind: webhook, url: 'https://x.example/', secret_file: secret}\n"
                 "  - {name: a, kind: webhook, url: 'https://y.example/', secret_file: secret}\n"
                 "rules:\n  - recipient: a\n"),
      HasSubstr("a name once"));
  EXPECT_THAT(
      WhyRefused("recipients:\n"
                 "  - {name: a, kind: webhook, url: 'https://x.example/', secret_file: secret}\n"
                 "rules:\n  - recipient: b\n"),
      HasSubstr("'recipient' is 'b'"));
}

}  // namespace
}  // namespace livemap::orders
