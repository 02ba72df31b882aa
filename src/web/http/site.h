#pragma once

#include <functional>

#include "web/http/http_message.h"

namespace livemap::web {

/// What somebody may see of a zone.
struct Visibility {
  bool told = true;        ///< Hazards that drivers are told of, and their pictures.
  bool candidates = true;  ///< All other hazards, map changes, and what happened to them.
  bool vehicles = true;    ///< Where vehicles are, and their trails.

  friend bool operator==(const Visibility& a, const Visibility& b) {
    return a.told == b.told && a.candidates == b.candidates && a.vehicles == b.vehicles;
  }
};

/// What an HttpServer serves. Thread-safe; never throws.
class Site {
 public:
  /// Called once, from any thread; must not block.
  using Done = std::function<void(HttpResponse answer)>;

  Site() = default;
  virtual ~Site() = default;
  Site(const Site&) = delete;
  Site& operator=(const Site&) = delete;

  /// The answer to any request for which AnswersLater is false.
  virtual HttpResponse Answer(const HttpRequest& question) = 0;
  /// Whether the answer may have to wait for something. Quick.
  virtual bool AnswersLater(const HttpRequest& question) const = 0;
  /// Answers any request, now or later. `done` is dropped without a call when the site goes away.
  virtual void Answer(const HttpRequest& question, const Done& done) = 0;
  /// What is answered in place of one that did not come in time (WebConfig::picture_timeout_s).
  virtual HttpResponse LateAnswer() const {
    return MakeBusyAnswer("the picture is not made yet", 2);
  }
  /// Whether the request is an official's. Quick.
  virtual bool IsByOfficial(const HttpRequest& question) const = 0;
  /// What whoever asks may see. Quick.
  virtual Visibility VisibilityFor(const HttpRequest& /*question*/) const { return {}; }
};

}  // namespace livemap::web
