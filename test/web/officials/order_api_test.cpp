#include "web/officials/order_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A zone whose orders go to a port at which nobody listens.
class OrderApiTest : public testing::Test {
 protected:
  explicit OrderApiTest(double give_up_s = 7 * 86400) {
    orders::WorkOrderConfig config;
    config.give_up_s = give_up_s;
    orders::Recipient recipient;
    recipient.name = "works";
    recipient.way = orders::WebhookSender::Config{"http://127.0.0.1:1/hook", "top-secret-key"};
    config.recipients.push_back(recipient);
    orders::OrderRule rule;
    rule.recipient = "works";
    rule.delay_s = 0;
    config.rules.push_back(rule);
    config.retry_s = 3600;
    desk_ = std::make_unique<orders::OrderDesk>(
        config, folder_.path(), *fixture_.zone, fixture_.catalogue,
        [this] { return fixture_.now_ns.load(); }, 1, [](const std::string&) {});
    WebConfig options = TestOptions();
    options.token_file = tokens_.path();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue, desk_.get());
  }

  Headers AsOfficial() const { return {{"Authorization", "Bearer " + TokenFile::token()}}; }
  HttpResult Ask(const std::string& target) {
    return Request(server_->port(), "GET", target, AsOfficial(), "");
  }
  HttpResult Post(const std::string& target) {
    return Request(server_->port(), "POST", target, AsOfficial(), "");
  }
  /// The one order, once an attempt to send it has failed.
  nlohmann::json FailedOrder() {
    const geo::GeoPoint place{40.4433, -79.9436};
    const Uuid hazard = fixture_.zone->Handle(fixture_.MakeReport("pothole", place)).hazard_uuid;
    fixture_.zone->Confirm(hazard, "miller");
    for (int i = 0; i < 500; ++i) {
      const auto orders = Ask("/api/v1/orders").Json()["orders"];
      if (!orders.empty() && !orders[0]["last_error"].is_null()) return orders[0];
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "no order failed";
    return {};
  }

  ZoneFixture fixture_;
  TokenFile tokens_;
  TemporaryFolder folder_;
  std::unique_ptr<orders::OrderDesk> desk_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(OrderApiTest, OfficialsSeeOrdersWithTheirAttemptsAndErrors) {
  const nlohmann::json order = FailedOrder();
  EXPECT_EQ(order["recipient"], "works");
  EXPECT_EQ(order["state"], "waiting");
  EXPECT_EQ(order["class"], "pothole");
  EXPECT_EQ(order["position"], nlohmann::json({-79.9436, 40.4433})) << "longitude first";
  EXPECT_EQ(order["official"], "miller");
  EXPECT_EQ(order["attempts"], 1);
  EXPECT_EQ(order["may_have_arrived"], false) << "nobody was reached";
  EXPECT_THAT(order["last_error"], HasSubstr("onnect"));
  EXPECT_THAT(Ask("/api/v1/orders").body, Not(HasSubstr("top-secret")));
  EXPECT_EQ(Ask("/api/v1/orders?state=waiting&limit=1").Json()["next"], order["number"]);
  EXPECT_TRUE(Ask("/api/v1/orders?state=sent").Json()["orders"].empty());
  const std::string metrics = Ask("/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("livemap_work_orders{state=\"waiting\"} 1\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_work_order_attempts_total{outcome=\"refused\"} 1\n"));
}

TEST_F(OrderApiTest, NobodyElseSeesOrChangesThem) {
  for (const char* method : {"GET", "POST"}) {
    EXPECT_EQ(Request(server_->port(), method, "/api/v1/orders", {}, "").status, 401);
    EXPECT_EQ(Request(server_->port(), method, "/api/v1/orders/x/close", {}, "").status, 401);
  }
  const Headers of_other_page{{"Authorization", "Bearer " + TokenFile::token()},
                              {"Origin", "https://evil.example"}};
  EXPECT_EQ(Request(server_->port(), "POST", "/api/v1/orders/x/close", of_other_page, "").status,
            403);
}

TEST_F(OrderApiTest, WhatCannotBeDoneIsSaid) {
  const std::string id = FailedOrder()["id"];
  EXPECT_EQ(Post("/api/v1/orders/" + id + "/close").status, 409) << "nobody has it";
  EXPECT_EQ(Post("/api/v1/orders/" + id + "/retry").status, 409) << "it is not given up";
  EXPECT_EQ(Post("/api/v1/orders/none/close").status, 400);
  EXPECT_EQ(Post("/api/v1/orders/11111111-2222-4333-8444-555555555555/close").status, 404);
  EXPECT_EQ(Post("/api/v1/orders/" + id + "/burn").status, 404);
  EXPECT_EQ(Post("/api/v1/orders").status, 405);
  EXPECT_EQ(Ask("/api/v1/orders/" + id + "/close").status, 405);
  EXPECT_EQ(Ask("/api/v1/orders?state=lost").status, 400);
  EXPECT_EQ(Ask("/api/v1/orders?x=1").status, 400);
}

/// The same, and an order is given up after its first attempt.
class GivenUpOrderTest : public OrderApiTest {
 protected:
  GivenUpOrderTest() : OrderApiTest(0) {}
};

TEST_F(GivenUpOrderTest, ARetryIsDoneAndStandsInTheAuditTrail) {
  const nlohmann::json order = FailedOrder();
  ASSERT_EQ(order["state"], "failed");
  EXPECT_EQ(order["next_attempt"], nullptr);
  const std::string id = order["id"];
  EXPECT_EQ(Post("/api/v1/orders/" + id + "/retry").status, 200);
  const nlohmann::json decision = Ask("/api/v1/decisions?limit=1").Json()["decisions"][0];
  EXPECT_EQ(decision["decision"], "retry_order");
  EXPECT_EQ(decision["official"], TokenFile::official());
  EXPECT_EQ(decision["subject"], order["hazard"]);
  EXPECT_EQ(decision["detail"], "to works, LM-" + id);
  EXPECT_EQ(decision["undone_by"], nullptr);
}

TEST_F(GivenUpOrderTest, ACloseStandsInTheAuditTrailAndCannotBeTakenBack) {
  const nlohmann::json order = FailedOrder();
  const std::string id = order["id"];
  const HttpResult closed = Post("/api/v1/orders/" + id + "/close");
  EXPECT_EQ(closed.status, 200);
  EXPECT_EQ(closed.Json()["state"], "closed");
  EXPECT_EQ(closed.Json()["closed_by"], TokenFile::official());
  EXPECT_EQ(Post("/api/v1/orders/" + id + "/close").status, 409) << "closed twice";
  const nlohmann::json decisions = Ask("/api/v1/decisions").Json()["decisions"];
  ASSERT_EQ(decisions.size(), 2U) << "what was refused is not in it: " << decisions;
  EXPECT_EQ(decisions[0]["decision"], "close_order");
  Headers headers = AsOfficial();
  headers.emplace_back("Content-Type", "application/json");
  const std::string hazard = "/api/v1/hazards/" + order["hazard"].get<std::string>();
  EXPECT_EQ(Request(server_->port(), "POST", hazard + "/undo", headers,
                    nlohmann::json{{"decision_id", decisions[0]["id"]}}.dump())
                .status,
            409);
  const HttpResult undone = Request(server_->port(), "POST", hazard + "/undo", headers, "{}");
  EXPECT_EQ(undone.status, 200) << "the confirmation is the newest decision that can be undone";
  EXPECT_EQ(undone.Json()["properties"]["state"], "candidate");
}

TEST_F(OrderApiTest, TheListIsOfOneHazardOrRecipientAndNamesTheTeam) {
  const nlohmann::json order = FailedOrder();
  const std::string hazard = order["hazard"];
  EXPECT_EQ(order["team"], nullptr);
  zone::DeskAction assign;
  assign.kind = zone::DecisionKind::kAssign;
  assign.team = "Roads north";
  assign.due_ns = ZoneFixture::kStartNs - 10 * std::int64_t{86'400'000'000'000};
  fixture_.zone->Act(*Uuid::Parse(hazard), "miller", assign);
  const nlohmann::json told = Ask("/api/v1/orders?hazard=" + hazard).Json();
  ASSERT_EQ(told["orders"].size(), 1U);
  EXPECT_EQ(told["orders"][0]["team"], "Roads north");
  EXPECT_EQ(told["orders"][0]["due"], "2025-12-22");
  EXPECT_EQ(told["orders"][0]["overdue"], true);
  EXPECT_EQ(told["recipients"], nlohmann::json({"works"}));
  EXPECT_EQ(told["counts"],
            nlohmann::json(
                {{"waiting", 1}, {"sent", 0}, {"closed", 0}, {"failed", 0}, {"cancelled", 0}}));
  const std::string other = "11111111-2222-4333-8444-555555555555";
  EXPECT_TRUE(Ask("/api/v1/orders?hazard=" + other).Json()["orders"].empty());
  EXPECT_EQ(Ask("/api/v1/orders?recipient=works").Json()["orders"].size(), 1U);
  EXPECT_TRUE(Ask("/api/v1/orders?recipient=else").Json()["orders"].empty());
  EXPECT_EQ(Ask("/api/v1/orders?recipient=").status, 400);
  EXPECT_EQ(Ask("/api/v1/orders?hazard=x").status, 400);
  EXPECT_EQ(Ask("/api/v1/config").Json()["orders"], true);
}

TEST(OrderApiWithoutOrdersTest, SaysThatThereAreNone) {
  ZoneFixture fixture;
  const TokenFile tokens;
  WebConfig options = TestOptions();
  options.token_file = tokens.path();
  WebServer server(options, *fixture.zone, fixture.catalogue);
  const Headers official{{"Authorization", "Bearer " + TokenFile::token()}};
  EXPECT_EQ(Request(server.port(), "GET", "/api/v1/orders", official, "").status, 404);
  EXPECT_EQ(Request(server.port(), "GET", "/api/v1/config", {}, "").Json()["orders"], false);
}

}  // namespace
}  // namespace livemap::web
