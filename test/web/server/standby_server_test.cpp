#include "web/server/standby_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

class StandbyServerTest : public testing::Test {
 protected:
  StandbyServer server_{TestOptions()};
};

TEST_F(StandbyServerTest, IsAliveAndNotReady) {
  EXPECT_EQ(Get(server_.port(), "/healthz").status, 200);
  EXPECT_EQ(Get(server_.port(), "/healthz").Json()["status"], "standby");
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 503);
}

TEST_F(StandbyServerTest, HasTheMetricsOfTheLease) {
  server_.Tell(7);
  const std::string metrics = Get(server_.port(), "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("livemap_lease_epoch 7\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_zone_active 0\n"));
}

TEST_F(StandbyServerTest, AnswersAllElseWithTheSameSentenceThatNamesNobody) {
  server_.Tell(7);
  for (const char* path : {"/", "/readyz", "/api/v1/hazards", "/api/v1/session", "/ws", "/ogc"}) {
    const HttpResult answer = Get(server_.port(), path, {{"Authorization", "Bearer whatever"}});
    EXPECT_EQ(answer.status, 503) << path;
    EXPECT_EQ(answer.Json()["error"], "this server is the zone's standby, another one is active")
        << path;
  }
  EXPECT_EQ(Request(server_.port(), "POST", "/api/v1/session").status, 503);
}

}  // namespace
}  // namespace livemap::web
