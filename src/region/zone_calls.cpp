#include "region/zone_calls.h"

#include <algorithm>
#include <utility>

#include "common/mutex.h"

namespace livemap::region {
namespace {

/// The answers of all zones while they come in.
class Gathering {
 public:
  Gathering(std::size_t zones, std::function<void(ZoneCalls::Answers)> done)
      : done_(std::move(done)), answers_(zones), missing_(zones) {}

  /// Of each zone once; with the last one all are handed on.
  void Put(std::size_t zone, std::optional<orders::HttpAnswer> answer) {
    ZoneCalls::Answers all;
    {
      const MutexLock lock(mutex_);
      answers_[zone] = std::move(answer);
      if (--missing_ > 0) return;
      all = std::move(answers_);
    }
    done_(std::move(all));
  }

 private:
  const std::function<void(ZoneCalls::Answers)> done_;
  Mutex mutex_;
  ZoneCalls::Answers answers_ GUARDED_BY(mutex_);
  std::size_t missing_ GUARDED_BY(mutex_);
};

}  // namespace

ZoneCalls::ZoneCalls(const Region& region)
    : region_(region), open_(region.zones()), threads_(kThreads) {}

ZoneCalls::~ZoneCalls() { Stop(); }

void ZoneCalls::Stop() {
  stop_ = true;
  threads_.Stop();
}

double ZoneCalls::ShortS() const { return std::min(kListTimeoutS, region_.config().timeout_s); }

bool ZoneCalls::Ask(std::size_t zone, const orders::HttpCall& call, const Done& done) {
  return AskFor(zone, call, region_.status(zone).is_up ? region_.config().timeout_s : ShortS(),
                done);
}

void ZoneCalls::AskAll(const orders::HttpCall& call,
                       const std::function<void(Answers answers)>& done) {
  const std::size_t zones = region_.zones();
  const auto gathering = std::make_shared<Gathering>(zones, done);
  for (std::size_t zone = 0; zone < zones; ++zone) {
    const auto put = [gathering, zone](const orders::HttpAnswer& answer) {
      gathering->Put(zone, answer);
    };
    const bool is_asked = region_.status(zone).is_up && AskFor(zone, call, ShortS(), put);
    if (!is_asked) gathering->Put(zone, std::nullopt);
  }
}

bool ZoneCalls::AskFor(std::size_t zone, orders::HttpCall call, double timeout_s,
                       const Done& done) {
  if (open_[zone].fetch_add(1) >= kMaxOpenPerZone) {
    --open_[zone];
    return false;
  }
  const RegionZone& asked = region_.zone(zone);
  call.url = asked.url + call.url;
  if (!asked.token.empty()) call.headers.push_back("Authorization: Bearer " + asked.token);
  threads_.Post(
      asked.id, web::WorkQueue::Rank::kOfficial,
      [this, zone, timeout_s, call = std::move(call), done] {
        orders::HttpAnswer answer;
        try {
          answer = orders::NetworkClient({region_.config().ca_file, timeout_s, &stop_}).Call(call);
        } catch (const std::exception& error) {
          answer.error = error.what();
        }
        --open_[zone];
        if (!stop_) done(answer);
      });
  return true;
}

}  // namespace livemap::region
