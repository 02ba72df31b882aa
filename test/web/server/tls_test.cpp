// The server by HTTPS, asked by real clients of OpenSSL.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/ssl.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <chrono>
#include <list>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "common/clock.h"
#include "test/web/http/http_client.h"
#include "test/web/server/tls_files.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace net = boost::asio;
namespace ssl = net::ssl;
using net::ip::tcp;
using testing::HasSubstr;

const geo::GeoPoint kTlsPlace{40.4433, -79.9436};
constexpr std::chrono::seconds kPatience{30};  // Only a hang takes so long.

tcp::endpoint LoopbackPort(int port) {
  return {net::ip::make_address("127.0.0.1"), static_cast<unsigned short>(port)};
}

/// Trusts the test's certificate alone, and knows the address that it must be for.
ssl::context ClientContext(const TlsFiles& files) {
  ssl::context context(ssl::context::tls_client);
  context.load_verify_file(files.certificate());
  context.set_verify_mode(ssl::verify_peer);
  context.set_verify_callback(ssl::host_name_verification("127.0.0.1"));
  return context;
}

/// A connection by HTTPS, of as many requests as the server takes.
class HttpsClient {
 public:
  HttpsClient(int port, ssl::context context) : context_(std::move(context)), port_(port) {
    beast::get_lowest_layer(stream_).expires_after(kPatience);
    beast::get_lowest_layer(stream_).connect(LoopbackPort(port));
    stream_.handshake(ssl::stream_base::client);
  }

  HttpResult Ask(const std::string& method, const std::string& target,
                 const Headers& headers = {}) {
    http::request<http::string_body> request;
    request.version(11);
    request.method_string(method);
    request.target(target);
    request.set(http::field::host, "127.0.0.1:" + std::to_string(port_));
    for (const auto& [name, value] : headers) request.set(name, value);
    http::write(stream_, request);
    http::response_parser<http::string_body> parser;
    parser.skip(method == "HEAD");
    parser.body_limit(64U << 20);
    http::read(stream_, buffer_, parser);
    const auto& response = parser.get();
    return {static_cast<int>(response.result_int()), response.body(), response.base()};
  }
  HttpResult Get(const std::string& target) { return Ask("GET", target); }

  /// The error by which nothing more comes: stream_truncated where TLS was not ended.
  beast::error_code ReadEnd() {
    beast::error_code end;
    char byte = 0;
    stream_.read_some(net::buffer(&byte, 1), end);
    return end;
  }
  long serial() {
    const std::unique_ptr<X509, decltype(&X509_free)> certificate(
        SSL_get1_peer_certificate(stream_.native_handle()), &X509_free);
    return ASN1_INTEGER_get(X509_get0_serialNumber(certificate.get()));
  }
  std::string version() { return SSL_get_version(stream_.native_handle()); }
  std::string cipher() { return SSL_get_cipher_name(stream_.native_handle()); }

 private:
  ssl::context context_;
  const int port_;
  net::io_context io_;
  beast::ssl_stream<beast::tcp_stream> stream_{io_, context_};
  beast::flat_buffer buffer_;
};

/// A client without TLS that says what it likes.
class PlainClient {
 public:
  explicit PlainClient(int port) { socket_.connect(LoopbackPort(port)); }
  void Say(const std::string& text) { net::write(socket_, net::buffer(text)); }
  std::string ReadToEnd() {
    std::string text;
    boost::system::error_code end;
    net::read(socket_, net::dynamic_buffer(text), end);
    return text;
  }

 private:
  net::io_context io_;
  tcp::socket socket_{io_};
};

class TlsTest : public testing::Test {
 protected:
  TlsTest() { files_.Write(); }

  WebConfig Options() const {
    WebConfig options = TestOptions();
    options.certificate_file = files_.certificate();
    options.key_file = files_.key();
    options.certificate_check_s = 0.02;
    return options;
  }
  void Start(const WebConfig& options) {
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }
  int port() const { return server_->port(); }
  HttpsClient Client() const { return HttpsClient(port(), ClientContext(files_)); }
  /// Whether the condition comes true.
  template <typename Condition>
  static bool Comes(const Condition& condition) {
    const std::int64_t end_ns = SteadyNs() + 30'000'000'000;
    while (SteadyNs() < end_ns) {
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  TemporaryFolder folder_;
  const TlsFiles files_{folder_.path()};
  ZoneFixture fixture_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(TlsTest, ServesRequestsOneAfterTheOther) {
  Start(Options());
  fixture_.AddRow("pothole", kTlsPlace, 4000);  // 2 MB as a list.
  HttpsClient client = Client();
  EXPECT_EQ(client.Get("/healthz").Json()["status"], "ok");
  EXPECT_EQ(client.Get("/api/v1/hazards?limit=50000").Json()["features"].size(), 4000U);
  EXPECT_EQ(client.Get("/").status, 200);
  EXPECT_EQ(client.Ask("HEAD", "/").body, "");
  const HttpResult answer = client.Get("/api/v1/classes");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.Field("Strict-Transport-Security"), "max-age=31536000");
  EXPECT_EQ(server_->connections(), 1U);
}

TEST_F(TlsTest, TellsBrowsersNothingOfHstsWhereThatIsZero) {
  WebConfig options = Options();
  options.hsts_s = 0;
  Start(options);
  EXPECT_EQ(Client().Get("/healthz").Field("Strict-Transport-Security"), "");
}

TEST_F(TlsTest, EndsTlsBeforeItEndsTheConnection) {
  Start(Options());
  HttpsClient client = Client();
  EXPECT_EQ(client.Ask("GET", "/healthz", {{"Connection", "close"}}).status, 200);
  EXPECT_EQ(client.ReadEnd(), net::error::eof);
}

TEST_F(TlsTest, SpeaksVersions12And13WithEphemeralKeysAlone) {
  Start(Options());
  HttpsClient newest = Client();
  EXPECT_EQ(newest.version(), "TLSv1.3");
  EXPECT_EQ(newest.Get("/healthz").status, 200);
  ssl::context older = ClientContext(files_);
  SSL_CTX_set_max_proto_version(older.native_handle(), TLS1_2_VERSION);
  HttpsClient client(port(), std::move(older));
  EXPECT_EQ(client.version(), "TLSv1.2");
  EXPECT_THAT(client.cipher(), testing::StartsWith("ECDHE-"));
  EXPECT_EQ(client.Get("/healthz").status, 200);
  ssl::context oldest = ClientContext(files_);
  SSL_CTX_set_cipher_list(oldest.native_handle(), "ALL:@SECLEVEL=0");
  SSL_CTX_set_min_proto_version(oldest.native_handle(), TLS1_VERSION);
  SSL_CTX_set_max_proto_version(oldest.native_handle(), TLS1_1_VERSION);
  EXPECT_THROW(HttpsClient(port(), std::move(oldest)), boost::system::system_error);
  ssl::context weak = ClientContext(files_);
  SSL_CTX_set_max_proto_version(weak.native_handle(), TLS1_2_VERSION);
  SSL_CTX_set_cipher_list(weak.native_handle(), "ECDHE-ECDSA-AES128-SHA:@SECLEVEL=0");
  EXPECT_THROW(HttpsClient(port(), std::move(weak)), boost::system::system_error);
  EXPECT_TRUE(Comes([&] { return server_->counters().failed_handshakes == 2; }))
      << server_->counters().failed_handshakes;
}

TEST_F(TlsTest, PlainTextIsSentToTheAddressByHttps) {
  Start(Options());
  const std::string host = "127.0.0.1:" + std::to_string(port());
  const HttpResult answer = web::Get(port(), "/api/v1/hazards?limit=1");
  EXPECT_EQ(answer.status, 308);
  EXPECT_EQ(answer.Field("Location"), "https://" + host + "/api/v1/hazards?limit=1");
  EXPECT_EQ(answer.Field("Strict-Transport-Security"), "") << "it counts by HTTPS alone";
  EXPECT_EQ(Request(port(), "POST", "/api/v1/session", {{"Content-Type", "application/json"}}, "{}")
                .status,
            400);
  PlainClient strange(port());
  strange.Say("GET / HTTP/1.1\r\nHost: evil.example/\"\r\n\r\n");
  EXPECT_THAT(strange.ReadToEnd(), HasSubstr("HTTP/1.1 400"));
  PlainClient nonsense(port());
  nonsense.Say("EHLO mail.example\r\n\r\n");
  EXPECT_THAT(nonsense.ReadToEnd(), HasSubstr("HTTP/1.1 400"));
  EXPECT_EQ(Client().Get("/healthz").status, 200);
}

TEST_F(TlsTest, APortOfPlainHttpLeadsToHttps) {
  WebConfig options = Options();
  {
    // A port that was free a moment ago.
    net::io_context io;
    options.redirect_port = tcp::acceptor(io, LoopbackPort(0)).local_endpoint().port();
  }
  Start(options);
  const HttpResult answer = web::Get(options.redirect_port, "/feeds");
  EXPECT_EQ(answer.status, 308);
  EXPECT_EQ(answer.Field("Location"), "https://127.0.0.1:" + std::to_string(port()) + "/feeds");
  EXPECT_EQ(Request(options.redirect_port, "DELETE", "/").status, 400);
}

TEST_F(TlsTest, AClientThatDoesNotFinishTheHandshakeIsLetGo) {
  WebConfig options = Options();
  options.request_timeout_s = 0.2;
  Start(options);
  PlainClient silent(port());
  PlainClient slow(port());
  slow.Say(std::string("\x16\x03\x01\x02\x00", 5));
  EXPECT_EQ(silent.ReadToEnd(), "");
  EXPECT_EQ(slow.ReadToEnd(), "");
  EXPECT_TRUE(Comes([&] { return server_->connections() == 0; }));
}

TEST_F(TlsTest, ClientsThatDoNotFinishTheHandshakeKeepNobodyOut) {
  WebConfig options = Options();
  options.max_connections = 8;
  options.request_timeout_s = 600;
  Start(options);
  std::list<PlainClient> crowd;
  for (int i = 0; i < 40; ++i) {
    crowd.emplace_back(port());
    if (i % 2 == 0) crowd.back().Say(std::string("\x16\x03\x01\x02\x00\x01\x00\x01", 8));
  }
  EXPECT_EQ(Client().Get("/healthz").status, 200);
  EXPECT_LE(server_->connections(), 8U);
}

TEST_F(TlsTest, BrokenRecordsEndAConnection) {
  Start(Options());
  PlainClient broken(port());
  broken.Say(std::string("\x16\x03\x01\x01\x00\x01\x00\x00\xfc", 9) + std::string(252, '\xff'));
  broken.ReadToEnd();
  EXPECT_TRUE(Comes([&] { return server_->counters().failed_handshakes == 1; }));
  EXPECT_EQ(Client().Get("/healthz").status, 200);
}

TEST_F(TlsTest, ANewCertificateIsServedAndNoConnectionIsDropped) {
  Start(Options());
  HttpsClient old_client = Client();
  EXPECT_EQ(old_client.Get("/healthz").status, 200);
  const long first = old_client.serial();
  files_.Write();
  ASSERT_TRUE(Comes([&] { return server_->certificate()->loads == 2; }))
      << server_->certificate()->refusal;
  HttpsClient client = Client();
  EXPECT_EQ(client.serial(), TlsFiles::Serial());
  EXPECT_NE(client.serial(), first);
  EXPECT_EQ(client.Get("/healthz").status, 200);
  EXPECT_EQ(old_client.Get("/healthz").status, 200) << "the connection of before goes on";
}

TEST_F(TlsTest, ABrokenCertificateLeavesTheOneOfBefore) {
  Start(Options());
  const TlsFiles trusted(folder_.path(), "trusted");
  std::filesystem::copy_file(files_.certificate(), trusted.certificate());
  files_.Write(-2 * 86400, -86400);
  ASSERT_TRUE(Comes([&] { return !server_->certificate()->refusal.empty(); }));
  EXPECT_THAT(server_->certificate()->refusal, HasSubstr("the certificate of before is kept"));
  EXPECT_EQ(HttpsClient(port(), ClientContext(trusted)).Get("/healthz").status, 200);
}

TEST_F(TlsTest, MetricsSayWhenTheCertificateEnds) {
  Start(Options());
  const std::string metrics = Client().Get("/metrics").body;
  const std::string name = "\nlivemap_web_certificate_seconds ";
  const std::size_t at = metrics.find(name);
  ASSERT_NE(at, std::string::npos) << metrics;
  const double left_s = std::stod(metrics.substr(at + name.size()));
  EXPECT_GT(left_s, 29 * 86400);
  EXPECT_LE(left_s, 30 * 86400);
  EXPECT_THAT(metrics, HasSubstr("\nlivemap_web_failed_handshakes_total 0\n"));
}

TEST_F(TlsTest, LinksInFeedsAreByHttps) {
  Start(Options());
  EXPECT_THAT(Client().Get("/ogc").body,
              HasSubstr("https://127.0.0.1:" + std::to_string(port()) + "/ogc"));
}

TEST_F(TlsTest, TheLiveStreamTellsWhatHappens) {
  Start(Options());
  ssl::context context = ClientContext(files_);
  net::io_context io;
  beast::websocket::stream<beast::ssl_stream<beast::tcp_stream>> stream(io, context);
  beast::get_lowest_layer(stream).expires_after(kPatience);
  beast::get_lowest_layer(stream).connect(LoopbackPort(port()));
  stream.next_layer().handshake(ssl::stream_base::client);
  const std::string host = "127.0.0.1:" + std::to_string(port());
  const auto next = [&] {
    beast::flat_buffer buffer;
    stream.read(buffer);
    return nlohmann::json::parse(beast::buffers_to_string(buffer.data()));
  };
  stream.handshake(host, "/ws");
  EXPECT_EQ(next()["type"], "hello");
  fixture_.AddRow("pothole", kTlsPlace, 1);
  nlohmann::json message = next();
  while (message["type"] != "hazard") message = next();
  EXPECT_EQ(message["action"], "added");
  stream.close(beast::websocket::close_code::normal);
  EXPECT_TRUE(Comes([&] { return server_->connections() == 0; }));
}

TEST_F(TlsTest, APageInPlainTextOfTheSameHostMayNotOpenTheLiveStream) {
  Start(Options());
  const std::string host = "127.0.0.1:" + std::to_string(port());
  const auto upgrade = [&](const std::string& origin) {
    return Client()
        .Ask("GET", "/ws",
             {{"Connection", "Upgrade"},
              {"Upgrade", "websocket"},
              {"Sec-WebSocket-Version", "13"},
              {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
              {"Origin", origin}})
        .status;
  };
  EXPECT_EQ(upgrade("http://" + host), 403);
  EXPECT_EQ(upgrade("https://" + host), 101);
}

TEST_F(TlsTest, RefusesOptionsThatDoNotFitTogether) {
  const auto refusal = [&](const WebConfig& options) -> std::string {
    try {
      Start(options);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  };
  WebConfig options = Options();
  options.key_file.clear();
  EXPECT_THAT(refusal(options), HasSubstr("accepted are two files or none"));
  options = TestOptions();
  options.redirect_port = 8080;
  EXPECT_THAT(refusal(options), HasSubstr("web_http_redirect_port is 8080"));
  options = Options();
  options.hsts_s = -1;
  EXPECT_THAT(refusal(options), HasSubstr("hsts_s is -1"));
}

}  // namespace
}  // namespace livemap::web
