// How fast the zone registers reports: in memory at 1e3 to 1e6 known hazards, what polls cost, and
// with its store.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "poll_scheduler_cost.h"
#include "zone/registry/hazard_registry.h"
#include "zone/service/zone_service.h"
#include "zone_load/report_street.h"

namespace livemap::bench {
namespace {

constexpr char kUsage[] =
    "usage: livemap_zone_benchmark [--max-hazards N] [--store-seconds S] [--help]\n"
    "\n"
    "Prints the cost of one registration in memory at 1000 to N (default 1000000) hazards and how\n"
    "it grows, what a second of 10 000 vehicles costs the poll scheduler, then committed reports "
    "per second on SQLite and the processor time of each, S seconds (default 2) for each line.\n";

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;
constexpr double kSpacingM = 12.0;
constexpr geo::GeoPoint kCorner{40.44, -79.94};
constexpr double kMetresPerDegree = 111000.0;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Processor time of this thread: the cost of a computation, also on a machine that is busy.
double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// A town of hazards on a square lattice, and reports that hit or miss them.
class Town {
 public:
  explicit Town(std::size_t hazards)
      : hazards_(hazards),
        side_(static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(hazards))))) {}

  geo::GeoPoint Place(double column, double row) const {
    const double cosine = std::cos(kCorner.latitude_deg * geo::kRadiansPerDegree);
    return {kCorner.latitude_deg + row * kSpacingM / kMetresPerDegree,
            kCorner.longitude_deg + column * kSpacingM / (kMetresPerDegree * cosine)};
  }
  protocol::Report At(const geo::GeoPoint& position) {
    protocol::Report report;
    report.uuid = Uuid::Random(generator_);
    report.vehicle_id = "car-" + std::to_string(generator_() % 1000);
    report.drive_id = "drive-1";
    report.stamp_ns = kNowNs;
    report.class_name = "pothole";
    report.confidence = 0.5F;
    report.box = {10, 20, 110, 90};
    report.position = position;
    report.covariance_m2 = Eigen::Vector2d(1.0, 4.0).asDiagonal();
    report.image_width = 640;
    report.image_height = 480;
    return report;
  }
  protocol::Report OfHazard(std::size_t i) { return At(Place(Column(i), Row(i))); }
  /// Within 2 m of a random hazard.
  protocol::Report Sighting() {
    std::uniform_int_distribution<std::size_t> any(0, hazards_ - 1);
    std::uniform_real_distribution<double> offset(-0.1, 0.1);
    const std::size_t i = any(generator_);
    return At(Place(Column(i) + offset(generator_), Row(i) + offset(generator_)));
  }
  /// In the middle between four hazards, 8.5 m from each.
  protocol::Report News() {
    std::uniform_int_distribution<std::size_t> any(0, hazards_ - 1);
    const std::size_t i = any(generator_);
    return At(Place(Column(i) + 0.5, Row(i) + 0.5));
  }
  /// Place of a hazard in the square grid of all hazards.
  double Column(std::size_t i) const { return static_cast<double>(i % side_); }
  double Row(std::size_t i) const {
    const std::size_t row = i / side_;
    return static_cast<double>(row);
  }
  Uuid NextUuid() { return Uuid::Random(generator_); }

 private:
  std::mt19937_64 generator_{1};
  std::size_t hazards_;
  std::size_t side_;
};

struct Cost {
  double news_ns = 0;
  double sighting_ns = 0;
};

/// Registers `reports` inside a transaction that is then taken back, so that the size stays.
/// Returns processor seconds of the registration alone.
double RegisterAndTakeBack(zone::HazardRegistry& registry,
                           const std::vector<protocol::Report>& reports, Town& town,
                           std::uint64_t sequence) {
  registry.Begin();
  const double start = ThreadSeconds();
  for (const protocol::Report& report : reports) {
    const auto match = registry.FindMatch(report.class_name, report.position);
    if (match) {
      registry.Merge(*match, report, {}, ++sequence, kNowNs);
    } else {
      registry.Add(report, {}, town.NextUuid(), ++sequence, kNowNs);
    }
  }
  const double seconds = ThreadSeconds() - start;
  registry.Rollback();
  return seconds;
}

/// Of batches: others' work on a shared machine disturbs some of them.
double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Cost MeasureRegistry(std::size_t hazards) {
  Town town(hazards);
  zone::HazardRegistry registry(protocol::HazardCatalogue(), 5);
  std::uint64_t sequence = 0;
  for (std::size_t i = 0; i < hazards; ++i) {
    registry.Add(town.OfHazard(i), {}, town.NextUuid(), ++sequence, kNowNs);
  }
  constexpr int kBatches = 400;
  constexpr int kBatchReports = 250;
  std::vector<double> news_ns;
  std::vector<double> sighting_ns;
  // The first round warms up and is not counted.
  for (int batch = 0; batch <= kBatches; ++batch) {
    std::vector<protocol::Report> news;
    std::vector<protocol::Report> sightings;
    for (int i = 0; i < kBatchReports; ++i) {
      news.push_back(town.News());
      sightings.push_back(town.Sighting());
    }
    const double news_s = RegisterAndTakeBack(registry, news, town, sequence);
    const double sighting_s = RegisterAndTakeBack(registry, sightings, town, sequence);
    if (batch == 0) continue;
    news_ns.push_back(news_s * 1e9 / kBatchReports);
    sighting_ns.push_back(sighting_s * 1e9 / kBatchReports);
  }
  return {Median(news_ns), Median(sighting_ns)};
}

void PrintRegistry(std::size_t max_hazards) {
  std::printf("registration without I/O, one thread, processor time\n");
  std::printf("%10s %12s %12s %18s\n", "hazards", "new, ns", "sighting, ns", "registrations/s");
  Cost first;
  Cost last;
  for (std::size_t hazards = 1000; hazards <= max_hazards; hazards *= 10) {
    last = MeasureRegistry(hazards);
    if (hazards == 1000) first = last;
    std::printf("%10zu %12.0f %12.0f %18.0f\n", hazards, last.news_ns, last.sighting_ns,
                2e9 / (last.news_ns + last.sighting_ns));
    std::fflush(stdout);
  }
  std::printf("cost growth to the largest: new %.2f, sighting %.2f\n", last.news_ns / first.news_ns,
              last.sighting_ns / first.sighting_ns);
}

/// A JPEG header with random bytes behind it: the zone reads the header only.
std::vector<std::uint8_t> MakePicture(std::size_t bytes, std::mt19937& generator) {
  std::vector<std::uint8_t> picture{0xff, 0xd8, 0xff, 0xc0, 0, 11,   8, 1,
                                    0xe0, 2,    0x80, 1,    1, 0x11, 0};
  while (picture.size() < bytes) picture.push_back(static_cast<std::uint8_t>(generator()));
  return picture;
}

/// Commits batches of what `next` makes until they took so many seconds, in a store of its own, and
/// prints a line of what a report costs.
template <typename Next>
void PrintStore(const char* name, std::size_t batch_reports, std::size_t picture_bytes,
                double seconds, const Next& next) {
  std::string directory =
      (std::filesystem::temp_directory_path() / "livemap_zone_benchmark_XXXXXX").string();
  if (mkdtemp(directory.data()) == nullptr) throw Error("cannot make '" + directory + "'");
  double spent_s = 0;
  double processor_s = 0;
  std::size_t count = 0;
  {
    zone::ZoneService::Config config;
    config.directory = directory;
    // The reports of a whole fleet come under few names here.
    config.speed.max_speed_mps = 1e9;
    config.allowance.reports_per_hour = 1e9;
    config.allowance.evidence_per_hour = 1e9;
    zone::ZoneService zone(
        config, [] { return kNowNs; }, 1);
    while (spent_s < seconds) {
      std::vector<protocol::Report> reports;
      for (std::size_t i = 0; i < batch_reports; ++i) reports.push_back(next(count + i));
      const auto start = std::chrono::steady_clock::now();
      const double processor_start_s = ThreadSeconds();
      zone.HandleBatch(reports);
      processor_s += ThreadSeconds() - processor_start_s;
      spent_s += SecondsSince(start);
      count += batch_reports;
    }
  }
  std::filesystem::remove_all(directory);
  std::printf("%10zu %14zu %9s %18.0f %17.1f\n", batch_reports, picture_bytes, name,
              static_cast<double>(count) / spent_s, 1e6 * processor_s / static_cast<double>(count));
  std::fflush(stdout);
}

void PrintStores(double seconds) {
  std::printf("committed reports/s on SQLite (WAL, synchronous=FULL), half new, half sightings\n");
  std::printf("%10s %14s %9s %18s %17s\n", "per commit", "picture, bytes", "vehicles", "reports/s",
              "processor us each");
  Town town(100000);
  std::mt19937 generator(2);
  // A thousand vehicles that all report at one moment.
  const auto standing = [&](std::size_t picture_bytes) {
    return [&, picture_bytes](std::size_t i) {
      protocol::Report report = i % 2 == 0 ? town.News() : town.Sighting();
      if (picture_bytes > 0) report.image = MakePicture(picture_bytes, generator);
      return report;
    };
  };
  for (const std::size_t batch : {1U, 100U, 500U}) {
    PrintStore("stand", batch, 0, seconds, standing(0));
  }
  PrintStore("stand", 500, 20000, seconds, standing(20000));
  // So few drive on with every report that their pasts are full.
  constexpr std::uint32_t kDriving = 20;
  const ReportStreet street(kDriving, kNowNs - 5LL * 86400 * 1'000'000'000);
  PrintStore("drive", 500, 0, seconds, [&](std::size_t i) {
    const auto vehicle = static_cast<std::uint32_t>(i % kDriving);
    protocol::Report report = street.ReportOf(vehicle, static_cast<std::uint32_t>(i / kDriving));
    report.uuid = town.NextUuid();
    report.vehicle_id = "car-" + std::to_string(vehicle);
    return report;
  });
}

/// The positive number after `name`; `fallback` when the option is not given.
double Option(const std::vector<std::string>& arguments, const std::string& name, double fallback) {
  for (std::size_t i = 0; i + 1 < arguments.size(); ++i) {
    if (arguments[i] != name) continue;
    char* end = nullptr;
    const double value = std::strtod(arguments[i + 1].c_str(), &end);
    if (*end == '\0' && value > 0 && value <= 1e8) return value;
    throw Error(name + " is '" + arguments[i + 1] + "', accepted is a number above 0 up to 1e8");
  }
  return fallback;
}

int Run(const std::vector<std::string>& arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == "--help") {
      std::cout << kUsage;
      return 0;
    }
    const bool is_known = arguments[i] == "--max-hazards" || arguments[i] == "--store-seconds";
    if (!is_known || ++i == arguments.size()) {
      throw Error("unknown or incomplete argument '" + arguments[i - (is_known ? 1 : 0)] +
                  "', try --help");
    }
  }
  const double max_hazards = Option(arguments, "--max-hazards", 1e6);
  const double seconds = Option(arguments, "--store-seconds", 2.0);
  PrintRegistry(static_cast<std::size_t>(max_hazards));
  PrintPollScheduler(static_cast<std::size_t>(max_hazards));
  PrintStores(seconds);
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  try {
    return livemap::bench::Run(std::vector<std::string>(argv + 1, argv + argc));
  } catch (const std::exception& error) {
    std::cerr << "livemap_zone_benchmark: " << error.what() << "\n";
    return 2;
  }
}
