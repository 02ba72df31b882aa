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
  OrderApiTest() {
    orders::WorkOrderConfig config;
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

TEST(OrderApiWithoutOrdersTest, SaysThatThereAreNone) {
  ZoneFixture fixture;
  const TokenFile tokens;
  WebConfig options = TestOptions();
  options.token_file = tokens.path();
  WebServer server(options, *fixture.zone, fixture.catalogue);
  const Headers official{{"Authorization", "Bearer " + TokenFile::token()}};
  EXPECT_EQ(Request(server.port(), "GET", "/api/v1/orders", official, "").status, 404);
}

}  // namespace
}  // namespace livemap::web
