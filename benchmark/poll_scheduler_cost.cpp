#include "poll_scheduler_cost.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "zone/polling/poll_scheduler.h"

namespace livemap::bench {
namespace {

constexpr std::size_t kVehicles = 10000;
constexpr double kSpacingM = 50;  // Of hazards, on a square lattice.
constexpr double kSpeedMps = 13.9;
constexpr int kTicks = 20;
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kStartNs = 1'700'000'000 * kSecondNs;
constexpr geo::GeoPoint kCorner{40.0, -80.0};
constexpr double kMetresPerDegree = 111320;

double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double AllocatedBytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks) + static_cast<double>(info.hblkhd);
}

geo::GeoPoint Place(double east_m, double north_m) {
  const double cosine = std::cos(kCorner.latitude_deg * geo::kRadiansPerDegree);
  return {kCorner.latitude_deg + north_m / kMetresPerDegree,
          kCorner.longitude_deg + east_m / (kMetresPerDegree * cosine)};
}

/// Vehicles on the lattice's lines, a little beside the hazards on them, that drive east.
class Traffic {
 public:
  Traffic(double side_m, std::mt19937_64& random) : side_m_(side_m) {
    std::uniform_real_distribution<double> along(0, side_m);
    for (std::size_t i = 0; i < kVehicles; ++i) {
      east_m_.push_back(along(random));
      north_m_.push_back(kSpacingM * std::floor(along(random) / kSpacingM) + 3);
    }
  }
  void Drive(std::int64_t now_ns, zone::PollScheduler& scheduler) {
    for (std::size_t i = 0; i < kVehicles; ++i) {
      east_m_[i] = std::fmod(east_m_[i] + kSpeedMps, side_m_);
      scheduler.SetVehicle("car-" + std::to_string(i),
                           {now_ns, Place(east_m_[i], north_m_[i]), kPi / 2, kSpeedMps});
    }
  }

 private:
  static constexpr double kPi = 3.14159265358979323846;
  double side_m_;
  std::vector<double> east_m_;
  std::vector<double> north_m_;
};

struct Cost {
  double first_s = 0;  ///< All hazards fall due at once, as after a long silence.
  double tick_s = 0;   ///< Mean of the seconds after it: vehicles are looked at in turns.
  double polls = 0;    ///< Of one second, after the first.
  double bytes_per_hazard = 0;
};

zone::PresenceRecord ToldSince(std::int64_t stamp_ns) {
  zone::PresenceRecord life;
  life.state = zone::HazardState::kActive;
  life.since_ns = life.first_seen_ns = life.last_yes_ns = life.at_ns = stamp_ns;
  life.log_odds = 3;
  return life;
}

Cost MeasureTicks(std::size_t hazards) {
  const auto side = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(hazards))));
  const zone::ClassModel entry;
  const zone::PresenceRecord life = ToldSince(kStartNs);
  Cost cost;
  const double before = AllocatedBytes();
  zone::PollScheduler scheduler(zone::PollScheduler::Config(), 5);
  for (std::size_t i = 0; i < hazards; ++i) {
    const std::size_t row = i / side;
    const geo::GeoPoint place =
        Place(kSpacingM * static_cast<double>(i % side), kSpacingM * static_cast<double>(row));
    scheduler.SetHazard(i, place, entry, life, kStartNs, kStartNs);
  }
  cost.bytes_per_hazard = (AllocatedBytes() - before) / static_cast<double>(hazards);
  std::mt19937_64 random(7);
  Traffic traffic(kSpacingM * static_cast<double>(side), random);
  std::int64_t now_ns = kStartNs + 86400 * kSecondNs;
  for (int tick = 0; tick <= kTicks; ++tick, now_ns += kSecondNs) {
    const double start = ThreadSeconds();
    traffic.Drive(now_ns, scheduler);
    const std::size_t polls = scheduler.TakeDue(now_ns).size();
    const double spent = ThreadSeconds() - start;
    if (tick == 0) {
      cost.first_s = spent;
      continue;
    }
    cost.tick_s += spent / kTicks;
    cost.polls += static_cast<double>(polls) / kTicks;
  }
  return cost;
}

}  // namespace

void PrintPollScheduler(std::size_t max_hazards) {
  std::printf("one second of %zu moving vehicles in the poll scheduler, processor time\n",
              kVehicles);
  std::printf("%10s %16s %12s %10s %18s\n", "hazards", "all fall due, ms", "then, ms", "polls",
              "bytes per hazard");
  for (std::size_t hazards = 1000; hazards <= max_hazards; hazards *= 10) {
    const Cost cost = MeasureTicks(hazards);
    std::printf("%10zu %16.1f %12.1f %10.1f %18.0f\n", hazards, 1e3 * cost.first_s,
                1e3 * cost.tick_s, cost.polls, cost.bytes_per_hazard);
    std::fflush(stdout);
  }
}

}  // namespace livemap::bench
