#include "region/region.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "common/error.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "transport/topic_template.h"

namespace livemap::region {
namespace {

/// What a worker sleeps at most, so that a stop is soon seen.
constexpr std::chrono::milliseconds kLongestNap{500};
constexpr double kFirstPauseS = 1;
/// Between two turns of a zone that has more to tell: one that never ends costs little.
constexpr double kTurnPauseS = 0.05;
/// A zone's log is read in one go up to so many answers; then others have a turn.
constexpr int kAnswersPerTurn = 8;

void RequireRange(const std::string& name, double value, double min, double max) {
  // Written so that NaN is refused, too.
  if (value >= min && value <= max) return;
  throw Error(name + " is " + std::to_string(value) + ", accepted is a number from " +
              std::to_string(min) + " to " + std::to_string(max));
}

Region::Config CheckedRegion(Region::Config config) {
  if (config.zones.empty()) throw Error("the region has no zone, accepted are one or more");
  std::set<std::string> ids;
  for (const RegionZone& zone : config.zones) {
    if (!transport::IsValidId(zone.id)) {
      throw Error("the zone's id '" + zone.id +
                  "' is not accepted, accepted are 1 to 64 letters, digits, '.', '_' and '-'");
    }
    if (!ids.insert(zone.id).second) {
      throw Error("zone '" + zone.id + "' is given twice, accepted is each zone once");
    }
  }
  RequireRange("ask_every_s", config.ask_every_s, 0.1, 3600);
  RequireRange("longest_pause_s", config.longest_pause_s, 0.1, 3600);
  RequireRange("timeout_s", config.timeout_s, 0.1, 600);
  RequireRange("threads", static_cast<double>(config.threads), 1, 64);
  std::error_code failure;
  std::filesystem::create_directories(config.directory, failure);
  if (!std::filesystem::is_directory(config.directory)) {
    throw Error("the region's folder '" + config.directory + "' cannot be made");
  }
  return config;
}

bool IsLater(std::int64_t a_ns, std::int64_t b_ns) { return a_ns > b_ns; }

}  // namespace

std::optional<geo::GeoBox> BoundsOf(const std::vector<RegionZone>& zones) {
  // Eastwards from the first corner: rings go on beyond 180 degrees.
  std::optional<geo::GeoBox> bounds;
  double first_deg = 0;
  for (const RegionZone& zone : zones) {
    if (!zone.area) continue;
    for (const auto& ring : zone.area->rings()) {
      for (geo::GeoPoint corner : ring) {
        if (!bounds) {
          first_deg = corner.longitude_deg;
          bounds = {corner, corner};
        }
        corner.longitude_deg = first_deg + std::remainder(corner.longitude_deg - first_deg, 360.0);
        auto& [south_west, north_east] = *bounds;
        south_west.latitude_deg = std::min(south_west.latitude_deg, corner.latitude_deg);
        south_west.longitude_deg = std::min(south_west.longitude_deg, corner.longitude_deg);
        north_east.latitude_deg = std::max(north_east.latitude_deg, corner.latitude_deg);
        north_east.longitude_deg = std::max(north_east.longitude_deg, corner.longitude_deg);
      }
    }
  }
  if (!bounds) return std::nullopt;
  for (double* side : {&bounds->south_west.longitude_deg, &bounds->north_east.longitude_deg}) {
    *side = std::remainder(*side, 360.0);
  }
  return bounds;
}

Region::Region(Config config, const protocol::HazardCatalogue& catalogue, Clock now_ns, Log log)
    : config_(CheckedRegion(std::move(config))), now_ns_(std::move(now_ns)), log_(std::move(log)) {
  const std::int64_t now = now_ns_();
  store_ = std::make_unique<RegionStore>(config_.directory + "/region.sqlite3", catalogue, now);
  if (!store_->damage().empty()) log_(store_->damage());
  // In microseconds since 1970: a region that starts goes on above what pages have heard of it.
  map_ = std::make_unique<RegionMap>(catalogue, static_cast<std::uint64_t>(now / 1000),
                                     BoundsOf(config_.zones));
  const orders::NetworkClient::Config network{config_.ca_file, config_.timeout_s, &stop_};
  for (const RegionZone& zone : config_.zones) {
    auto followed = std::make_unique<Followed>();
    followed->client = std::make_unique<orders::NetworkClient>(network);
    followed->follower = std::make_unique<ZoneFollower>(
        zone, [client = followed->client.get()](const auto& call) { return client->Call(call); },
        now_ns_, *map_, *store_);
    followed_.push_back(std::move(followed));
  }
  unasked_ = followed_.size();
  {
    const MutexLock lock(mutex_);
    for (std::size_t i = 0; i < followed_.size(); ++i) due_.push_back({SteadyNs(), i});
  }
  const std::size_t threads = std::min(config_.threads, followed_.size());
  for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { Work(); });
}

Region::~Region() {
  stop_ = true;
  {
    const MutexLock lock(mutex_);
    changed_.NotifyAll();
  }
  for (std::thread& thread : threads_) thread.join();
}

void Region::Work() {
  const auto is_later = [](const Due& a, const Due& b) { return IsLater(a.at_ns, b.at_ns); };
  while (!stop_) {
    Due next{};
    {
      const MutexLock lock(mutex_);
      if (due_.empty() || due_.front().at_ns > SteadyNs()) {
        auto nap = std::chrono::nanoseconds(kLongestNap);
        if (!due_.empty())
          nap = std::min(nap, std::chrono::nanoseconds(due_.front().at_ns - SteadyNs()));
        changed_.WaitFor(mutex_, nap);
        continue;
      }
      std::pop_heap(due_.begin(), due_.end(), is_later);
      next = due_.back();
      due_.pop_back();
    }
    next.at_ns = SteadyNs() + Nanoseconds(Ask(*followed_[next.zone]));
    const MutexLock lock(mutex_);
    due_.push_back(next);
    std::push_heap(due_.begin(), due_.end(), is_later);
  }
}

double Region::Ask(Followed& followed) {
  bool has_more = true;
  for (int i = 0; has_more && i < kAnswersPerTurn && !stop_; ++i) {
    try {
      has_more = followed.follower->Step();
      if (followed.follower->status().is_up) store_well_ = true;
    } catch (const StoreError& error) {
      if (store_well_.exchange(false)) log_(std::string("the store failed: ") + error.what());
      has_more = false;
    }
  }
  if (stop_) return 0;
  TellNews(followed);
  if (!std::exchange(followed.was_asked, true)) --unasked_;
  if (!followed.was_up) {
    followed.pause_s = std::clamp(2 * followed.pause_s, kFirstPauseS,
                                  std::max(kFirstPauseS, config_.longest_pause_s));
    return followed.pause_s;
  }
  followed.pause_s = 0;
  return has_more ? kTurnPauseS : config_.ask_every_s;
}

void Region::TellNews(Followed& followed) {
  const ZoneStatus status = followed.follower->status();
  const std::string zone = "zone '" + followed.follower->zone().id + "'";
  if (status.is_up && !followed.was_up) {
    log_(zone + " is up with " + std::to_string(status.hazards) + " hazards");
  }
  if (!status.is_up && (followed.was_up || !followed.was_asked)) {
    const std::string heard = status.heard_ns == 0
                                  ? "was never heard"
                                  : "was last heard at " + Rfc3339Seconds(status.heard_ns);
    log_(zone + " is down and " + heard + ": " + status.trouble);
  }
  if (status.refused > 0 && followed.refused == 0) {
    log_(zone + " told of hazards that are left out: " + status.refusal);
  }
  followed.refused = status.refused;
  followed.was_up = status.is_up;
}

}  // namespace livemap::region
