// The in-car page on a real server for the browser tests. It takes one JSON state per line on
// standard input and publishes it; `null` closes the server, and the next state opens it again on
// the same port. The first line of its output is {"port": N}; each command is answered with {}.
#include <iostream>
#include <memory>
#include <string>

#include "common/error.h"
#include "web/driver/driver_site.h"
#include "web/server/http_server.h"

namespace {

using livemap::web::DriverSite;
using livemap::web::HttpServer;
using livemap::web::Json;

class DriverSession {
 public:
  DriverSession() {
    config_.port = 0;
    Open();
  }
  ~DriverSession() { Close(); }
  DriverSession(const DriverSession&) = delete;
  DriverSession& operator=(const DriverSession&) = delete;

  int port() const { return config_.port; }

  void Do(const Json& state) {
    if (state.is_null()) return Close();
    if (!server_) Open();
    site_->Publish(state);
  }

 private:
  void Open() {
    DriverSite::Config site;
    site.web_root = LIVEMAP_SOURCE_DIR "/web";
    site_ = std::make_unique<DriverSite>(
        site, livemap::protocol::HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml"));
    server_ = std::make_unique<HttpServer>(config_, *site_, nullptr);
    config_.port = server_->port();
  }
  void Close() {
    if (site_) site_->Stop();
    server_.reset();
    site_.reset();
  }

  livemap::web::WebConfig config_;
  std::unique_ptr<DriverSite> site_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace

int main() {
  try {
    DriverSession session;
    std::cout << Json{{"port", session.port()}} << std::endl;
    std::string line;
    while (std::getline(std::cin, line)) {
      session.Do(Json::parse(line));
      std::cout << "{}" << std::endl;
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
  return 0;
}
