#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "protocol/hazard_catalogue.h"
#include "web/http/site.h"
#include "web/http/static_files.h"
#include "web/json/json.h"

namespace livemap::web {

/// The in-car page: its files, the classes of hazards, and what the driver sees now.
///
///   GET /                     web/driver/index.html; other paths: the files below web/
///   GET /api/v1/classes       as the zone's map has it
///   GET /api/v1/driver        the state that was published last, with its `version`
///   GET /api/v1/driver?since=VERSION    the same as soon as it is another one than VERSION
///
/// Thread-safe.
class DriverSite : public Site {
 public:
  struct Config {
    std::string web_root;  ///< Holds driver/index.html.
    /// Requests must name this machine itself (the Host header): then no page of the internet that
    /// has its name lead to the loopback reads what the driver sees.
    bool only_local = true;
    std::size_t max_waiting = 64;  ///< Who waits beyond it is answered at once.
  };

  /// Throws Error when the page is not there.
  DriverSite(const Config& config, const protocol::HazardCatalogue& catalogue);

  /// What is seen from now on; whoever waits is told.
  void Publish(Json state);
  /// Lets go of whoever waits, for good: when it returns, none is being called.
  void Stop();

  HttpResponse Answer(const HttpRequest& question) override;
  bool AnswersLater(const HttpRequest& question) const override;
  void Answer(const HttpRequest& question, const Done& done) override;
  bool IsByOfficial(const HttpRequest&) const override { return false; }

 private:
  HttpResponse Route(const HttpRequest& question);
  HttpResponse State() REQUIRES(mutex_);
  HttpResponse Finish(HttpResponse answer) const;
  /// What Route would refuse; none where the request is for the state.
  std::optional<HttpResponse> Refusal(const HttpRequest& question) const;

  const Config config_;
  const Json classes_;
  const StaticFiles files_;
  const std::string page_policy_;
  Mutex mutex_;
  std::string state_ GUARDED_BY(mutex_);  ///< As JSON.
  /// Goes on from the time of the start: what a page knows of an earlier run is another version.
  std::uint64_t version_ GUARDED_BY(mutex_);
  std::vector<Done> waiting_ GUARDED_BY(mutex_);
  bool stopped_ GUARDED_BY(mutex_) = false;
};

/// Whether a Host header names this machine by its loopback: localhost, 127.0.0.0/8 or ::1, with or
/// without a port.
bool IsLocalHost(const std::string& host);

}  // namespace livemap::web
