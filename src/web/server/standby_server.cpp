#include "web/server/standby_server.h"

#include <atomic>

#include "web/http/http_message.h"
#include "web/http/page_answer.h"
#include "web/http/request_target.h"
#include "web/http/site.h"
#include "web/metrics/metrics_text.h"
#include "web/metrics/zone_metrics.h"
#include "web/server/http_server.h"

namespace livemap::web {

/// Answers the same whoever asks.
class StandbySite : public Site {
 public:
  void Tell(std::uint64_t epoch) { epoch_ = epoch; }

  HttpResponse Answer(const HttpRequest& question) override {
    HttpResponse answer = Route(question);
    AddSecurityHeaders(page_policy_, answer);
    return answer;
  }
  bool AnswersLater(const HttpRequest&) const override { return false; }
  void Answer(const HttpRequest& question, const Done& done) override { done(Answer(question)); }
  bool IsByOfficial(const HttpRequest&) const override { return false; }

 private:
  HttpResponse Route(const HttpRequest& question) {
    const std::string path = question.target.substr(0, question.target.find('?'));
    const bool is_read = question.method == "GET" || question.method == "HEAD";
    if (is_read && path == "/healthz") return JsonAnswer({{"status", "standby"}});
    if (is_read && path == "/metrics") {
      HttpResponse answer;
      answer.content_type = kMetricsType;
      answer.content = StandbyMetricsText({false, epoch_, 0});
      answer.headers.emplace_back("Cache-Control", "no-store");
      return answer;
    }
    // Nobody logs in here: who the active one is would be told to everybody.
    return MakeBusyAnswer("this server is the zone's standby, another one is active");
  }

  const std::string page_policy_ = PagePolicy("");
  std::atomic<std::uint64_t> epoch_{0};
};

class StandbyServer::Implementation {
 public:
  explicit Implementation(const WebConfig& options) : server_(options, site_, nullptr) {}

  StandbySite& site() { return site_; }
  const HttpServer& server() const { return server_; }

 private:
  StandbySite site_;
  HttpServer server_;  // Last: its sessions use the site.
};

StandbyServer::StandbyServer(const WebConfig& options) {
  Validate(options);
  implementation_ = std::make_unique<Implementation>(options);
}

StandbyServer::~StandbyServer() = default;

void StandbyServer::Tell(std::uint64_t epoch) { implementation_->site().Tell(epoch); }

int StandbyServer::port() const { return implementation_->server().port(); }

}  // namespace livemap::web
