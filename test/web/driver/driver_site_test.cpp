#include "web/driver/driver_site.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>

#include "common/error.h"
#include "test/web/http/http_client.h"
#include "web/server/http_server.h"

namespace livemap::web {
namespace {

DriverSite::Config DriverConfig() {
  DriverSite::Config config;
  config.web_root = LIVEMAP_SOURCE_DIR "/web";
  return config;
}

WebConfig DriverServerConfig() {
  WebConfig config;
  config.port = 0;
  return config;
}

class DriverPage : public ::testing::Test {
 protected:
  ~DriverPage() override { site_.Stop(); }

  int port() const { return server_.port(); }

  DriverSite site_{DriverConfig(),
                   protocol::HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml")};
  HttpServer server_{DriverServerConfig(), site_, nullptr};
};

TEST_F(DriverPage, ServesThePageItsFilesAndTheClasses) {
  EXPECT_NE(Get(port(), "/").body.find("driver/driver.js"), std::string::npos);
  EXPECT_EQ(Get(port(), "/driver/driver.js").status, 200);
  EXPECT_EQ(Get(port(), "/icons/deer.svg").status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/classes").Json().at("classes").size(), 8U);
  EXPECT_EQ(Get(port(), "/../config/hazards.yaml").status, 404);
  EXPECT_NE(Get(port(), "/").Field("Content-Security-Policy").find("script-src 'self'"),
            std::string::npos);
}

TEST_F(DriverPage, TellsANewStateToWhoWaitsForIt) {
  site_.Publish({{"hazards", Json::array()}});
  const auto first = Get(port(), "/api/v1/driver").Json();
  const std::string next =
      "/api/v1/driver?since=" + std::to_string(first.at("version").get<std::uint64_t>());
  auto waiting = std::async(std::launch::async, [&] { return Get(port(), next).Json(); });
  EXPECT_EQ(waiting.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  site_.Publish({{"hazards", {1}}});
  EXPECT_EQ(waiting.get().at("hazards").size(), 1U);
  EXPECT_EQ(Get(port(), next).Json().at("hazards").size(), 1U);  // It knows an older one.
}

TEST_F(DriverPage, RefusesWhatItDoesNotServe) {
  EXPECT_EQ(Request(port(), "POST", "/api/v1/driver", {}, "x").status, 405);
  EXPECT_EQ(Get(port(), "/api/v1/driver?since=x").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/driver?other=1").status, 400);
  EXPECT_EQ(Get(port(), "/ws").status, 404);
  EXPECT_EQ(Get(port(), "/nothing").status, 404);
}

TEST_F(DriverPage, IsNotReadThroughANameThatLeadsToTheLoopback) {
  EXPECT_EQ(Get(port(), "/api/v1/driver", {{"Host", "evil.example"}}).status, 421);
  EXPECT_EQ(Get(port(), "/", {{"Host", "127.0.0.1.evil.example"}}).status, 421);
  EXPECT_EQ(Get(port(), "/api/v1/driver", {{"Host", "localhost:8090"}}).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/driver", {{"Host", "[::1]"}}).status, 200);
}

TEST(DriverSite, RefusesAFolderWithoutThePage) {
  DriverSite::Config config;
  config.web_root = "/nowhere";
  EXPECT_THROW(DriverSite(config, protocol::HazardCatalogue()), Error);
}

}  // namespace
}  // namespace livemap::web
