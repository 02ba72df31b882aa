#include "web/driver/driver_site.h"

#include <filesystem>
#include <regex>
#include <string_view>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "web/api/query.h"
#include "web/http/page_answer.h"

namespace livemap::web {
namespace {

constexpr std::string_view kStateAddress = "/api/v1/driver";

bool IsRead(const HttpRequest& question) {
  return question.method == "GET" || question.method == "HEAD";
}

}  // namespace

bool IsLocalHost(const std::string& host) {
  static const std::regex kLocal(
      R"((localhost|127\.[0-9]{1,3}\.[0-9]{1,3}\.[0-9]{1,3}|\[::1\])(:[0-9]{1,5})?)");
  return std::regex_match(host, kLocal);
}

DriverSite::DriverSite(const Config& config, const protocol::HazardCatalogue& catalogue)
    : config_(config),
      classes_(ClassesJson(catalogue)),
      files_(config.web_root),
      page_policy_(PagePolicy("")),
      version_(static_cast<std::uint64_t>(SystemNs() / 1'000'000)) {
  const std::string page = config_.web_root + "/driver/index.html";
  std::error_code failure;
  if (!std::filesystem::is_regular_file(page, failure)) {
    throw Error("the in-car page '" + page + "' is not there");
  }
  Publish(Json::object());
}

void DriverSite::Publish(Json state) {
  const MutexLock lock(mutex_);
  ++version_;
  state["version"] = version_;
  state_ = ToText(state);
  for (const Done& done : waiting_) done(State());
  waiting_.clear();
}

void DriverSite::Stop() {
  const MutexLock lock(mutex_);
  stopped_ = true;
  waiting_.clear();
}

bool DriverSite::AnswersLater(const HttpRequest& question) const {
  return question.target.rfind(kStateAddress, 0) == 0;
}

void DriverSite::Answer(const HttpRequest& question, const Done& done) {
  std::optional<std::uint64_t> since;
  try {
    const RequestTarget target = ParseTarget(question.target);
    const bool is_state = target.path == kStateAddress && IsRead(question);
    if (!is_state || Refusal(question)) return done(Answer(question));
    since = ParseStreamQuery(target);
  } catch (const BadRequest& mistake) {
    return done(Finish(MakeErrorAnswer(400, mistake.what())));
  }
  const MutexLock lock(mutex_);
  if (stopped_) return;
  if (since == version_ && waiting_.size() < config_.max_waiting) {
    waiting_.push_back(done);
  } else {
    done(State());
  }
}

HttpResponse DriverSite::Answer(const HttpRequest& question) {
  try {
    return Finish(Route(question));
  } catch (const BadRequest& mistake) {
    return Finish(MakeErrorAnswer(400, mistake.what()));
  } catch (const std::exception&) {
    return Finish(MakeBusyAnswer("the page cannot be made now"));
  }
}

std::optional<HttpResponse> DriverSite::Refusal(const HttpRequest& question) const {
  if (config_.only_local && !IsLocalHost(question.host)) {
    return MakeErrorAnswer(421, "this server is for this machine alone, accepted is localhost");
  }
  if (IsRead(question)) return std::nullopt;
  HttpResponse answer = MakeErrorAnswer(405, "the method is not allowed, accepted is GET, HEAD");
  answer.headers.emplace_back("Allow", "GET, HEAD");
  return answer;
}

HttpResponse DriverSite::Route(const HttpRequest& question) {
  if (auto refusal = Refusal(question)) return *std::move(refusal);
  const RequestTarget target = ParseTarget(question.target);
  if (target.path == "/") return FileAnswer(files_, "driver/index.html", question);
  if (target.path == "/api/v1/classes") {
    RefuseQueryParameters(target);
    return JsonAnswer(classes_);
  }
  return FileAnswer(files_, std::string_view(target.path).substr(1), question);
}

HttpResponse DriverSite::State() {
  HttpResponse answer;
  answer.content_type = "application/json";
  answer.content = state_;
  answer.headers.emplace_back("Cache-Control", "no-store");
  return Finish(std::move(answer));
}

HttpResponse DriverSite::Finish(HttpResponse answer) const {
  AddSecurityHeaders(page_policy_, answer);
  return answer;
}

}  // namespace livemap::web
