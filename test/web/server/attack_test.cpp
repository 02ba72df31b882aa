// What strangers try against the server: clients that do not read, that are slow, that come in
// crowds, and requests as no browser sends them.
#include <gtest/gtest.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <list>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "common/sha256.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

namespace net = boost::asio;
using net::ip::tcp;

const geo::GeoPoint kDowntown{40.4433, -79.9436};

/// A client that says what it likes. `from` is an address of the loopback.
class RawClient {
 public:
  RawClient(int port, const std::string& from, int receive_buffer_bytes = 0) : socket_(io_) {
    socket_.open(tcp::v4());
    if (receive_buffer_bytes > 0) {
      socket_.set_option(net::socket_base::receive_buffer_size(receive_buffer_bytes));
    }
    socket_.bind({net::ip::make_address(from), 0});
    socket_.connect({net::ip::make_address("127.0.0.1"), static_cast<unsigned short>(port)});
  }

  void Say(const std::string& text) { net::write(socket_, net::buffer(text)); }
  /// A server that has refused and closed already hears no end: what it answered is read all the
  /// same.
  void EndSaying() {
    boost::system::error_code closed;
    socket_.shutdown(tcp::socket::shutdown_send, closed);
  }
  /// All that comes until the server ends the connection.
  std::string ReadToEnd() {
    std::string text;
    boost::system::error_code end;
    net::read(socket_, net::dynamic_buffer(text), end);
    return text;
  }
  /// Until `end` has come `count` times.
  std::string ReadUntil(const std::string& end, int count) {
    std::string text;
    std::array<char, 4096> buffer;
    while (count > 0) {
      const std::size_t bytes = socket_.read_some(net::buffer(buffer));
      for (std::size_t i = 0; i < bytes; ++i) {
        text += buffer[i];
        if (text.size() >= end.size() &&
            text.compare(text.size() - end.size(), end.size(), end) == 0)
          --count;
      }
    }
    return text;
  }

 private:
  net::io_context io_;
  tcp::socket socket_;
};

std::string GetText(const std::string& target, const std::string& fields = "") {
  return "GET " + target + " HTTP/1.1\r\nHost: x\r\n" + fields + "\r\n";
}

/// An address of this machine that is none of the loopback's; empty where there is none.
std::string OwnAddress() {
  net::io_context io;
  net::ip::udp::socket socket(io, net::ip::udp::v4());
  boost::system::error_code failure;
  // Nothing is sent: the system only says from where it would.
  socket.connect({net::ip::make_address("192.0.2.1"), 9}, failure);
  if (failure) return "";
  const auto address = socket.local_endpoint().address();
  return address.is_loopback() ? "" : address.to_string();
}

class AttackTest : public testing::Test {
 protected:
  int port() const { return server_.port(); }
  void ExpectOthersAreServed() {
    EXPECT_EQ(Get(port(), "/healthz").status, 200);
    EXPECT_EQ(Get(port(), "/api/v1/classes").status, 200);
    EXPECT_EQ(Get(port(), "/").status, 200);
  }

  ZoneFixture fixture_;
  WebServer server_{TestOptions(), *fixture_.zone, fixture_.catalogue};
};

TEST_F(AttackTest, AnswersThatNobodyReadsAreNotHeld) {
  fixture_.AddRow("pothole", kDowntown, 4000);  // 2 MB as a list.
  std::list<RawClient> clients;
  for (int i = 0; i < 60; ++i) {
    clients.emplace_back(port(), "127.0.0." + std::to_string(2 + i % 20), 4096);
    clients.back().Say(GetText("/api/v1/hazards?limit=50000"));
  }
  // Answers are under way once the sockets are full; then no client holds more than two pieces.
  ExpectOthersAreServed();
  EXPECT_LT(server_.counters().held_bytes, 60 * 4 * kPieceBytes);
  EXPECT_EQ(Get(port(), "/api/v1/hazards?limit=50000").Json()["features"].size(), 4000U);
}

TEST_F(AttackTest, SlowClientsOfOneAddressShutNobodyOut) {
  std::list<RawClient> slow;
  for (int i = 0; i < 400; ++i) {
    slow.emplace_back(port(), "127.0.0.2");
    try {
      slow.back().Say("GET / HTTP/1.1\r\nHost:");
    } catch (const boost::system::system_error&) {
      // Ended already: a newer one needed its place.
    }
  }
  for (int i = 0; i < 20; ++i) ExpectOthersAreServed();
  EXPECT_LE(server_.connections(), 256U);
  EXPECT_GT(server_.counters().connections_ended, 0U);
}

TEST_F(AttackTest, SlowClientsOfTheSameAddressShutNobodyOut) {
  std::list<RawClient> slow;
  for (int i = 0; i < 300; ++i) {
    slow.emplace_back(port(), "127.0.0.1");
    try {
      slow.back().Say("GET / HTTP/1.1\r\nHost:");
    } catch (const boost::system::system_error&) {
      // As above.
    }
    if (i % 20 == 0) ExpectOthersAreServed();
  }
}

TEST_F(AttackTest, RequestsSentAtOnceAreAnsweredInOrder) {
  RawClient client(port(), "127.0.0.1");
  std::string text;
  for (int i = 0; i < 200; ++i) text += GetText(i % 2 == 0 ? "/healthz" : "/api/v1/nothing");
  std::thread sender([&] { client.Say(text); });
  const std::string answers = client.ReadUntil("HTTP/1.1 404", 100);
  sender.join();
  std::size_t at = 0;
  for (int i = 0; i < 200; ++i) {
    at = answers.find("HTTP/1.1 ", at);
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(answers.substr(at + 9, 3), i % 2 == 0 ? "200" : "404");
    ++at;
  }
}

/// Guesses tokens as a client behind the proxy at `proxy`, or one that says so.
class GuessingClients {
 public:
  explicit GuessingClients(int port) : port_(port) {}
  /// Status of one guess; `fields` name whom the request is passed on for.
  std::string Guess(const std::string& from, const std::string& fields) const {
    RawClient client(port_, from);
    client.Say(
        "POST /api/v1/vehicles/x/trust HTTP/1.1\r\nHost: x\r\nConnection: close\r\n"
        "Authorization: Bearer wrong\r\n" +
        fields + "\r\n");
    const std::string answer = client.ReadToEnd();
    return answer.size() < 12 ? answer : answer.substr(9, 3);
  }
  /// Of the last of so many guesses.
  std::string GuessOften(const std::string& from, const std::string& fields) const {
    for (int i = 0; i < 20; ++i) Guess(from, fields);
    return Guess(from, fields);
  }

 private:
  int port_;
};

TEST(ProxiedClients, GuessesCountAgainstTheClientThatAListedProxyNames) {
  const ZoneFixture fixture;
  const TokenFile tokens;
  WebConfig options = TestOptions();
  options.token_file = tokens.path();
  options.proxies = {"127.0.0.9"};
  const WebServer server(options, *fixture.zone, fixture.catalogue);
  const GuessingClients clients(server.port());
  const std::string a = "X-Forwarded-For: 192.0.2.1\r\n";
  const std::string b = "X-Forwarded-For: 192.0.2.2\r\n";
  EXPECT_EQ(clients.GuessOften("127.0.0.9", a), "429");
  EXPECT_EQ(clients.Guess("127.0.0.9", b), "401") << "another client of the proxy";
  EXPECT_EQ(clients.Guess("127.0.0.9", b + a), "429") << "what the client wrote itself comes first";
  EXPECT_EQ(clients.Guess("127.0.0.9", a + b), "401");
  EXPECT_EQ(clients.Guess("127.0.0.9", "X-Forwarded-For: 192.0.2.2, 192.0.2.1\r\n"), "429");
  EXPECT_EQ(clients.GuessOften("127.0.0.8", a), "429");
  EXPECT_EQ(clients.Guess("127.0.0.8", b), "429") << "no listed proxy: it names nobody";
}

TEST(ProxiedClients, ReadersOfOneClientBehindAProxyTakeNoPlacesOfAnother) {
  const ZoneFixture fixture;
  WebConfig options = TestOptions();
  options.proxies = {"127.0.0.9"};
  options.max_connections_per_client = 4;
  const WebServer server(options, *fixture.zone, fixture.catalogue);
  std::list<RawClient> streams;
  const auto open = [&](const std::string& client) {
    streams.emplace_back(server.port(), "127.0.0.9");
    streams.back().Say(GetText("/ws", "X-Forwarded-For: " + client +
                                          "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                                          "Sec-WebSocket-Version: 13\r\n"
                                          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"));
    return streams.back().ReadUntil("\r\n", 1).substr(9, 3);
  };
  for (int i = 0; i < 3; ++i) EXPECT_EQ(open("192.0.2.1"), "101");
  EXPECT_EQ(open("192.0.2.1"), "503") << "three quarters of its share";
  EXPECT_EQ(open("192.0.2.2"), "101");
}

TEST_F(AttackTest, AHalfClosedClientGetsItsAnswer) {
  fixture_.AddRow("pothole", kDowntown, 500);
  RawClient client(port(), "127.0.0.1");
  client.Say(GetText("/api/v1/hazards/points"));
  client.EndSaying();
  const std::string answer = client.ReadToEnd();
  EXPECT_EQ(answer.substr(0, 12), "HTTP/1.1 200");
  EXPECT_EQ(answer.substr(answer.size() - 5), "0\r\n\r\n");
}

TEST_F(AttackTest, AnHttp10ClientGetsAListWithoutChunks) {
  fixture_.AddRow("pothole", kDowntown, 500);
  RawClient client(port(), "127.0.0.1");
  client.Say("GET /api/v1/hazards HTTP/1.0\r\n\r\n");
  const std::string answer = client.ReadToEnd();
  EXPECT_EQ(answer.find("chunked"), std::string::npos);
  const auto list = nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  EXPECT_EQ(list["features"].size(), 500U);
}

TEST_F(AttackTest, RequestsAsNoBrowserSendsThemAreRefusedOrAnswered) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {GetText("/healthz", "Range: bytes=0-3\r\n"), "200"},
      {GetText("/healthz", "Range: bytes=0-0,0-0,0-0,0-0\r\n"), "200"},
      {GetText("/", std::string(200, 'a') + ": " + std::string(7000, 'b') +
                        "\r\nX: " + std::string(4000, 'c') + "\r\n"),
       "431"},
      {"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n", "400"},
      {"OPTIONS / HTTP/1.1\r\nHost: x\r\n\r\n", "405"},
      {"TRACE / HTTP/1.1\r\nHost: x\r\n\r\n", "405"},
      {"CONNECT x:80 HTTP/1.1\r\nHost: x\r\n\r\n", "400"},
      {"GET /healthz HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nTransfer-Encoding: "
       "chunked\r\n\r\n",
       "4"},
      {"POST /api/v1/hazards HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
       "ffffffff\r\n",
       "413"},
      {"POST /api/v1/hazards HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999\r\n\r\n", "413"},
      {"POST /api/v1/hazards HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n", "400"},
      {"GET / HTTP/9.9\r\nHost: x\r\n\r\n", "400"},
      {std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11) + "\r\n\r\n", "400"},
  };
  for (const auto& [request, status] : cases) {
    RawClient client(port(), "127.0.0.1");
    client.Say(request);
    client.EndSaying();
    const std::string answer = client.ReadToEnd();
    EXPECT_EQ(answer.rfind("HTTP/1.1 " + status, 0), 0U)
        << request.substr(0, 60) << " was answered " << answer.substr(0, 40);
  }
  ExpectOthersAreServed();
}

TEST_F(AttackTest, LiveStreamsOfOneAddressAreBounded) {
  std::list<StreamClient> streams;
  int refused = 0;
  for (int i = 0; i < 80; ++i) {
    try {
      streams.emplace_back(port());
    } catch (const boost::system::system_error&) {
      ++refused;
    }
  }
  EXPECT_EQ(refused, 80 - 48);
  ExpectOthersAreServed();
}

TEST_F(AttackTest, AStreamThatIsNotReadHoldsNoCatchUp) {
  fixture_.AddRow("pothole", kDowntown, 4000);
  std::list<StreamClient> clients;
  for (int i = 0; i < 30; ++i) clients.emplace_back(port(), "/ws?since=0", "", 4096);
  ExpectOthersAreServed();
  StreamClient reads(port(), "/ws?since=0");
  for (int i = 0; i < 4000; ++i) ASSERT_EQ(reads.NextOfType("hazard")["action"], "added");
  reads.NextOfType("live");
}

TEST_F(AttackTest, PicturesThatCostTooMuchAreRefusedWhileOthersAreServed) {
  cv::Mat image(3000, 3000, CV_8UC3, cv::Scalar(90, 120, 150));
  for (int i = 0; i < 8; ++i) {
    protocol::Report report =
        fixture_.MakeReport("pothole", {kDowntown.latitude_deg + 0.001 * i, -79.9436});
    image.at<cv::Vec3b>(0, i) = cv::Vec3b(0, 0, 255);
    cv::imencode(".jpg", image, report.image, {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
    report.image_format = "jpeg";
    ASSERT_EQ(fixture_.zone->Handle(report).status, protocol::Receipt::Status::kCommitted);
    const std::string sha256 = Sha256Hex(report.image.data(), report.image.size());
    EXPECT_EQ(Get(port(), "/images/" + sha256).status, 404);
  }
  const auto refused = fixture_.zone->Statistics().pictures_refused;
  EXPECT_EQ(refused[static_cast<std::size_t>(zone::PictureRefusal::kTooCostly)], 8U);
  EXPECT_EQ(Get(port(), "/api/v1/hazards").Json()["features"][0]["properties"]["image"], nullptr);
  ExpectOthersAreServed();
}

TEST_F(AttackTest, ManyPicturesAtOnceAreMadeOneAfterTheOther) {
  std::vector<std::string> addresses;
  for (int i = 0; i < 12; ++i) {
    protocol::Report report =
        fixture_.MakeReport("pothole", {kDowntown.latitude_deg + 0.001 * i, -79.9436});
    cv::imencode(".jpg", cv::Mat(480, 640, CV_8UC3, cv::Scalar(20.0 * i, 120, 150)), report.image);
    report.image_format = "jpeg";
    fixture_.zone->Handle(report);
    addresses.push_back("/images/" + Sha256Hex(report.image.data(), report.image.size()));
  }
  std::vector<std::thread> readers;
  std::vector<int> statuses(addresses.size());
  for (std::size_t i = 0; i < addresses.size(); ++i) {
    readers.emplace_back([&, i] { statuses[i] = Get(port(), addresses[i]).status; });
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(statuses, std::vector<int>(addresses.size(), 200));
}

TEST_F(AttackTest, AnOfficialDecidesWhileAllPlacesAreTaken) {
  const TokenFile tokens;
  WebConfig options = TestOptions();
  options.token_file = tokens.path();
  options.max_connections = 16;
  options.max_connections_per_client = 12;
  options.reserved_connections = 4;
  const WebServer small(options, *fixture_.zone, fixture_.catalogue);
  const std::string id =
      fixture_.zone->Handle(fixture_.MakeReport("pothole", kDowntown)).hazard_uuid.ToString();
  std::list<StreamClient> streams;
  for (int i = 0; i < 9; ++i) streams.emplace_back(small.port());
  std::list<RawClient> slow;
  for (int i = 0; i < 20; ++i) slow.emplace_back(small.port(), "127.0.0.2");
  const HttpResult confirmed = Request(small.port(), "POST", "/api/v1/hazards/" + id + "/confirm",
                                       {{"Authorization", "Bearer " + TokenFile::token()}});
  EXPECT_EQ(confirmed.status, 200) << confirmed.body;
}

TEST_F(AttackTest, OnTheReserveOnlyARightTokenIsServed) {
  const std::string elsewhere = OwnAddress();
  if (elsewhere.empty()) GTEST_SKIP() << "this machine has no address but the loopback's";
  const TokenFile tokens;
  WebConfig options = TestOptions();
  options.token_file = tokens.path();
  options.max_connections = 4;
  options.reserved_connections = 1;
  const WebServer small(options, *fixture_.zone, fixture_.catalogue);
  // Streams do not wait, and no client has more than one: nobody gives a place away.
  std::list<RawClient> streams;
  for (int i = 0; i < 3; ++i) {
    streams.emplace_back(small.port(), "127.0.0." + std::to_string(2 + i));
    streams.back().Say(GetText("/ws",
                               "Connection: Upgrade\r\nUpgrade: websocket\r\n"
                               "Sec-WebSocket-Version: 13\r\n"
                               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"));
    streams.back().ReadUntil("\"live\"", 1);
  }
  const auto status = [&](const std::string& from, const std::string& target,
                          const std::string& token) {
    RawClient client(small.port(), from);
    client.Say(GetText(target, token.empty() ? "" : "Authorization: Bearer " + token + "\r\n"));
    client.EndSaying();
    return client.ReadToEnd().substr(9, 3);
  };
  for (const char* target : {"/healthz", "/api/v1/classes"}) {
    EXPECT_EQ(status(elsewhere, target, ""), "503") << target;
    EXPECT_EQ(status(elsewhere, target, "no-official-has-this-token"), "503") << target;
    EXPECT_EQ(status(elsewhere, target, TokenFile::token()), "200") << target;
  }
  EXPECT_EQ(status("127.0.0.1", "/healthz", ""), "200");
  EXPECT_EQ(status("127.0.0.1", "/healthz", "no-official-has-this-token"), "200");
}

TEST_F(AttackTest, PointsHoldWhatTheListHoldsAndTheStreamGoesOnFromThere) {
  fixture_.AddRow("pothole", kDowntown, 1000);
  fixture_.zone->Remove(
      *Uuid::Parse(Get(port(), "/api/v1/hazards?limit=1").Json()["features"][0]["id"]), "test");
  const HttpResult answer = Get(port(), "/api/v1/hazards/points");
  EXPECT_EQ(answer.Field("Content-Type"), "application/x-ndjson");
  std::istringstream lines(answer.body);
  std::string line;
  std::getline(lines, line);
  const auto header = nlohmann::json::parse(line);
  EXPECT_EQ(header["count"], 999);
  EXPECT_EQ(header["sequence"], fixture_.zone->Sequence());
  const auto features = Get(port(), "/api/v1/hazards").Json()["features"];
  std::size_t count = 0;
  for (; std::getline(lines, line); ++count) {
    const auto row = nlohmann::json::parse(line);
    nlohmann::json hazard;
    for (std::size_t i = 0; i < row.size(); ++i) {
      hazard[header["columns"][i].get<std::string>()] = row[i];
    }
    ASSERT_LT(count, features.size());
    const auto& properties = features[count]["properties"];
    for (const char* name :
         {"id", "class", "state", "presence", "confidence", "sightings", "vehicles", "sequence"}) {
      ASSERT_EQ(hazard[name], properties[name]) << name;
    }
    ASSERT_EQ(hazard["longitude"], features[count]["geometry"]["coordinates"][0]);
    ASSERT_EQ(hazard["latitude"], features[count]["geometry"]["coordinates"][1]);
    ASSERT_NEAR(hazard["updated_s"], static_cast<double>(fixture_.now_ns) * 1e-9, 0.001);
  }
  EXPECT_EQ(count, 999U);

  StreamClient stream(port(), "/ws?since=" + std::to_string(header["sequence"].get<int>()));
  EXPECT_EQ(stream.Next()["type"], "hello");
  EXPECT_EQ(stream.Next()["type"], "live");
  EXPECT_EQ(Get(port(), "/api/v1/hazards/points?state=gone").status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/points?limit=3").status, 400);
}

}  // namespace
}  // namespace livemap::web
