#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <regex>
#include <set>
#include <string>
#include <thread>

#include "common/text_file.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

const geo::GeoPoint kStart{40.4433, -79.9436};

class LiveStreamTest : public testing::Test {
 protected:
  ZoneFixture fixture_;
  WebServer server_{TestOptions(), *fixture_.zone, fixture_.catalogue};
};

TEST_F(LiveStreamTest, TellsAddedUpdatedAndRemovedInOrder) {
  StreamClient client(server_.port());
  EXPECT_EQ(client.Next()["type"], "hello");
  EXPECT_EQ(client.Next()["type"], "live");
  const protocol::Receipt receipt = fixture_.zone->Handle(fixture_.MakeReport("pothole", kStart));
  fixture_.zone->Handle(fixture_.MakeReport("pothole", kStart));
  fixture_.zone->Remove(receipt.hazard_uuid, "repaired");
  std::uint64_t last = 0;
  for (const char* action : {"added", "updated", "removed"}) {
    const nlohmann::json message = client.NextOfType("hazard");
    EXPECT_EQ(message["action"], action);
    EXPECT_EQ(message["feature"]["id"], receipt.hazard_uuid.ToString());
    EXPECT_GT(message["sequence"].get<std::uint64_t>(), last);
    last = message["sequence"];
  }
}

TEST_F(LiveStreamTest, TellsVehiclePositions) {
  StreamClient client(server_.port());
  client.NextOfType("live");
  zone::VehicleState vehicle;
  vehicle.vehicle_id = "car-1";
  vehicle.position = kStart;
  vehicle.speed_mps = 12.5;
  vehicle.stamp_ns =
      ZoneFixture::kStartNs - 3'600'000'000'000;  // A replay: driven long ago, heard now.
  ASSERT_TRUE(fixture_.zone->UpdateVehicle(vehicle));
  const nlohmann::json message = client.NextOfType("vehicle");
  EXPECT_EQ(message["feature"]["properties"]["vehicle"], "car-1");
  EXPECT_EQ(message["feature"]["properties"]["speed_mps"], 12.5);
  EXPECT_NE(message["feature"]["properties"]["heard"], message["feature"]["properties"]["time"]);

  StreamClient later(server_.port());
  EXPECT_EQ(later.NextOfType("vehicle")["feature"]["id"], "car-1");
}

TEST_F(LiveStreamTest, ReplaysWhatHappenedAfterSince) {
  fixture_.AddRow("pothole", kStart, 3);
  const std::uint64_t known = fixture_.zone->Sequence();
  fixture_.AddRow("debris", {41, -79}, 700);  // More than one page of the replay.
  StreamClient client(server_.port(), "/ws?since=" + std::to_string(known));
  std::uint64_t last = known;
  for (int i = 0; i < 700; ++i) {
    const nlohmann::json message = client.NextOfType("hazard");
    ASSERT_GT(message["sequence"].get<std::uint64_t>(), last);
    last = message["sequence"];
    ASSERT_EQ(message["feature"]["properties"]["class"], "debris");
  }
  EXPECT_EQ(client.Next()["type"], "live");
}

TEST_F(LiveStreamTest, AClientOfAnotherStoreIsToldTheSmallerSequence) {
  fixture_.AddRow("pothole", kStart, 2);
  StreamClient client(server_.port(), "/ws?since=1000000");
  EXPECT_EQ(client.Next()["sequence"], fixture_.zone->Sequence());
  fixture_.AddRow("debris", {41, -79}, 1);
  EXPECT_EQ(client.NextOfType("hazard")["feature"]["properties"]["class"], "debris");
}

/// List first, then the stream from the list's sequence, while reports come in all the time: in
/// the end the client knows exactly what the zone knows, and every event came once.
TEST_F(LiveStreamTest, ListAndStreamTogetherHaveNoGapAndNoDuplicate) {
  constexpr int kReports = 600;
  std::thread reporter([&] {
    for (int i = 0; i < kReports; ++i) {
      // Every third report is a further sighting of the one before.
      const double row = 0.0002 * (i - i % 3);
      fixture_.zone->Handle(fixture_.MakeReport("pothole", {40.0 + row, -79.9}));
    }
  });
  for (int round = 0; round < 4; ++round) {
    const nlohmann::json list = Get(server_.port(), "/api/v1/hazards").Json();
    std::map<std::string, std::uint64_t> sightings;
    for (const auto& feature : list["features"]) {
      sightings[feature["id"]] = feature["properties"]["sightings"];
    }
    StreamClient client(server_.port(), "/ws?since=" + list["sequence"].dump());
    std::set<std::uint64_t> told;
    std::uint64_t last = list["sequence"];
    const std::uint64_t end = kReports;  // One event per report.
    while (last < end) {
      const nlohmann::json message = client.NextOfType("hazard");
      const std::uint64_t sequence = message["sequence"];
      ASSERT_TRUE(told.insert(sequence).second) << "event " << sequence << " was told twice";
      ASSERT_GT(sequence, last);
      last = sequence;
      sightings[message["feature"]["id"]] = message["feature"]["properties"]["sightings"];
    }
    ASSERT_EQ(sightings.size(), kReports / 3U);
    for (const auto& entry : sightings) ASSERT_EQ(entry.second, 3U) << entry.first;
  }
  reporter.join();
}

TEST_F(LiveStreamTest, AClientThatReadsNothingIsClosedAndCatchesUp) {
  WebConfig options = TestOptions();
  options.max_queued_messages = 50;
  options.socket_send_buffer_bytes = 4096;
  const WebServer tight(options, *fixture_.zone, fixture_.catalogue);
  StreamClient client(tight.port(), "/ws", "", 4096);
  client.NextOfType("live");
  fixture_.AddRow("pothole", {10, 10}, 3000);

  // The close comes behind what the network already holds, or, after a grace, as a plain end.
  std::uint64_t last = 0;
  int received = 0;
  try {
    for (;;) {
      last = client.NextOfType("hazard")["sequence"];
      ++received;
    }
  } catch (const boost::system::system_error& end) {
    const auto& reason = client.stream().reason();
    if (end.code() == boost::beast::websocket::error::closed) {
      EXPECT_EQ(reason.code, boost::beast::websocket::close_code::try_again_later);
      EXPECT_THAT(std::string(reason.reason.c_str()), testing::HasSubstr("too far behind"));
    }
  }
  EXPECT_LT(received, 3000);

  StreamClient again(tight.port(), "/ws?since=" + std::to_string(last));
  for (int i = received; i < 3000; ++i) {
    const std::uint64_t sequence = again.NextOfType("hazard")["sequence"];
    ASSERT_EQ(sequence, last + 1);
    last = sequence;
  }
}

TEST_F(LiveStreamTest, APageOfAnotherOriginIsRefused) {
  EXPECT_THROW(StreamClient(server_.port(), "/ws", "http://evil.example"),
               boost::system::system_error);
  const std::string own = "http://127.0.0.1:" + std::to_string(server_.port());
  EXPECT_NO_THROW(StreamClient(server_.port(), "/ws", own));
}

TEST_F(LiveStreamTest, ABadSinceIsAnswered400) {
  const HttpResult answer = Get(server_.port(), "/ws?since=x",
                                {{"Connection", "Upgrade"},
                                 {"Upgrade", "websocket"},
                                 {"Sec-WebSocket-Version", "13"},
                                 {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="}});
  EXPECT_EQ(answer.status, 400);
}

TEST_F(LiveStreamTest, AClientThatTalksTooMuchIsClosed) {
  StreamClient client(server_.port());
  client.NextOfType("live");
  // The server may close as soon as it has read how long the message is, so either call may fail.
  EXPECT_THROW(
      {
        client.stream().write(boost::asio::buffer(std::string(5000, 'x')));
        client.Next();
      },
      boost::system::system_error);
  EXPECT_EQ(Get(server_.port(), "/healthz").status, 200);
}

TEST_F(LiveStreamTest, AQuietStreamBeats) {
  WebConfig options = TestOptions();
  options.heartbeat_s = 0.02;
  const WebServer lively(options, *fixture_.zone, fixture_.catalogue);
  StreamClient client(lively.port());
  EXPECT_EQ(client.NextOfType("beat")["sequence"], 0);
}

TEST(LiveStream, BeatsTwiceBeforeThePageTakesItForDead) {
  const std::string page = ReadTextFile(TestOptions().web_root + "/worker/live_feed.js", 1 << 20);
  std::smatch silence;
  ASSERT_TRUE(std::regex_search(page, silence, std::regex("SILENCE_MS = ([0-9]+);")));
  EXPECT_LT(2 * WebConfig().heartbeat_s, std::stod(silence[1]) / 1000);
}

TEST_F(LiveStreamTest, ClosedClientsFreeTheirConnections) {
  for (int i = 0; i < 20; ++i) StreamClient(server_.port()).NextOfType("live");
  // The server hears of the last end soon after it; the test's time limit bounds the wait.
  while (server_.connections() > 0) std::this_thread::yield();
}

TEST_F(LiveStreamTest, TheServerStopsWhileClientsAndReportsKeepComing) {
  std::atomic<bool> stop{false};
  std::thread reporter([&] {
    for (int i = 0; !stop; ++i) {
      fixture_.zone->Handle(fixture_.MakeReport("deer", {20.0 + 0.0002 * i, 20}));
    }
  });
  for (int round = 0; round < 5; ++round) {
    auto server = std::make_unique<WebServer>(TestOptions(), *fixture_.zone, fixture_.catalogue);
    StreamClient first(server->port(), "/ws?since=0");
    StreamClient second(server->port());
    first.NextOfType("hazard");
    second.NextOfType("hazard");
    server.reset();
  }
  stop = true;
  reporter.join();
}

}  // namespace
}  // namespace livemap::web
