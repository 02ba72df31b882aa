#pragma once

#include <functional>

#include "web/http/http_message.h"

namespace livemap::web {

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
  /// Whether the request has a valid token. Quick.
  virtual bool IsByOfficial(const HttpRequest& question) const = 0;
};

}  // namespace livemap::web
