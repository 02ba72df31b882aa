// What a zone's street file costs: makes an extract of the size of a metropolis up, and reads one.
// docs/results/streets.md has what it said.
#include <sys/resource.h>
#include <time.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <osmium/builder/attr.hpp>
#include <osmium/io/pbf_output.hpp>
#include <osmium/io/writer.hpp>
#include <osmium/memory/buffer.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "geo/wgs84.h"
#include "streets/street_file.h"
#include "streets/street_lines.h"
#include "streets/street_place.h"

namespace {

constexpr char kUsage[] =
    "usage: livemap_measure_streets write FILE.osm.pbf WAYS\n"
    "       livemap_measure_streets read FILE.osm.pbf\n"
    "\n"
    "write  makes up a city of so many streets (a lattice; each way leads from one crossing to "
    "the\n"
    "       next, with four nodes between; every 20 blocks a street has another name)\n"
    "read   reads a street file as a zone does, and says what that and its use cost\n";

constexpr double kBlockDeg = 0.0011;  // Some 120 m.
constexpr std::int64_t kBends = 4;    // Nodes of a way between its crossings.
constexpr std::int64_t kBlocksOfAName = 20;
constexpr std::size_t kBufferBytes = 1 << 20;

using livemap::SteadyNs;
using namespace osmium::builder::attr;  // NOLINT: the library's own idiom.

/// The lattice: crossing (i, k) lies i blocks to the east and k to the north.
class Metropolis {
 public:
  explicit Metropolis(std::int64_t ways)
      : blocks_(
            std::max<std::int64_t>(1, std::llround(std::sqrt(0.5 * static_cast<double>(ways))))) {}

  void Write(const std::string& path) const {
    osmium::io::Writer writer(path, osmium::io::overwrite::allow);
    WriteNodes(writer);
    WriteWays(writer);
    writer.close();
  }

 private:
  std::int64_t side() const { return blocks_ + 1; }
  std::int64_t Crossing(std::int64_t i, std::int64_t k) const { return 1 + k * side() + i; }
  std::int64_t WayNumber(std::int64_t i, std::int64_t k, bool east) const {
    return 2 * (k * blocks_ + i) + (east ? 0 : 1);
  }
  std::int64_t Bend(std::int64_t way, std::int64_t n) const {
    return 1 + side() * side() + kBends * way + n;
  }

  /// Calls `take(i, k, east)` for every way, in the order of their numbers.
  template <typename Take>
  void ForEachWay(const Take& take) const {
    for (std::int64_t k = 0; k < blocks_; ++k) {
      for (std::int64_t i = 0; i < blocks_; ++i) {
        for (const bool east : {true, false}) take(i, k, east);
      }
    }
  }

  void WriteNodes(osmium::io::Writer& writer) const {
    osmium::memory::Buffer buffer(kBufferBytes, osmium::memory::Buffer::auto_grow::yes);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> jitter(-0.00004, 0.00004);
    const auto put = [&](std::int64_t id, double east, double north) {
      const osmium::Location place(-80 + kBlockDeg * 1.3 * east + jitter(random),
                                   40 + kBlockDeg * north + jitter(random));
      osmium::builder::add_node(buffer, _id(id), _location(place));
      Flush(buffer, writer);
    };
    for (std::int64_t k = 0; k < side(); ++k) {
      for (std::int64_t i = 0; i < side(); ++i) {
        put(Crossing(i, k), static_cast<double>(i), static_cast<double>(k));
      }
    }
    ForEachWay([&](std::int64_t i, std::int64_t k, bool east) {
      for (std::int64_t n = 0; n < kBends; ++n) {
        const double share = static_cast<double>(n + 1) / (kBends + 1);
        put(Bend(WayNumber(i, k, east), n), static_cast<double>(i) + (east ? share : 0),
            static_cast<double>(k) + (east ? 0 : share));
      }
    });
    writer(std::move(buffer));
  }

  void WriteWays(osmium::io::Writer& writer) const {
    osmium::memory::Buffer buffer(kBufferBytes, osmium::memory::Buffer::auto_grow::yes);
    ForEachWay([&](std::int64_t i, std::int64_t k, bool east) {
      const std::int64_t number = WayNumber(i, k, east);
      std::vector<osmium::NodeRef> nodes{osmium::NodeRef(Crossing(i, k))};
      for (std::int64_t n = 0; n < kBends; ++n) nodes.emplace_back(Bend(number, n));
      nodes.emplace_back(east ? Crossing(i + 1, k) : Crossing(i, k + 1));
      const std::int64_t street = east ? k : i;
      const std::string name = (east ? "Street " : "Avenue ") + std::to_string(street) + " part " +
                               std::to_string((east ? i : k) / kBlocksOfAName);
      osmium::builder::add_way(buffer, _id(1 + number), _nodes(nodes),
                               _tag("highway", KindOf(street)), _tag("name", name));
      Flush(buffer, writer);
    });
    writer(std::move(buffer));
  }

  /// In about the shares that cities have.
  static const char* KindOf(std::int64_t street) {
    if (street % 100 == 0) return "motorway";
    if (street % 33 == 0) return "primary";
    if (street % 20 == 0) return "secondary";
    if (street % 12 == 0) return "tertiary";
    return street % 3 == 0 ? "service" : "residential";
  }

  static void Flush(osmium::memory::Buffer& buffer, osmium::io::Writer& writer) {
    if (buffer.committed() < kBufferBytes / 2) return;
    osmium::memory::Buffer full(kBufferBytes, osmium::memory::Buffer::auto_grow::yes);
    std::swap(full, buffer);
    writer(std::move(full));
  }

  std::int64_t blocks_;
};

double PeakMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1e3;
}

/// Of this process, all threads together: other programs on the machine do not count.
double CpuS() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

template <typename Work>
double CpuSecondsOf(const Work& work) {
  const double begin_s = CpuS();
  work();
  return CpuS() - begin_s;
}

void Read(const std::string& path) {
  using namespace livemap;  // NOLINT: a short program.
  const double before_mb = PeakMb();
  double begin_s = CpuS();
  const std::int64_t begin_ns = SteadyNs();
  const streets::StreetMap map = streets::ReadStreetFile(path);
  std::printf(
      "read: %.1f s of CPU, %.1f s by the clock, %zu streets, %zu segments, %.0f MB kept, peak "
      "%.0f MB above %.0f MB\n",
      CpuS() - begin_s, static_cast<double>(SteadyNs() - begin_ns) / 1e9, map.streets(),
      map.segments(), static_cast<double>(map.bytes()) / 1e6, PeakMb() - before_mb, before_mb);
  begin_s = CpuS();
  const streets::StreetLines lines(map);
  std::printf("lines to be drawn: %.1f s of CPU, peak %.0f MB\n", CpuS() - begin_s,
              PeakMb() - before_mb);

  const geo::GeoBox bounds = map.Bounds();
  std::mt19937 random(2);
  const auto place = [&] {
    std::uniform_real_distribution<double> share(0.05, 0.95);
    const double north = share(random);
    const double east = share(random);
    return geo::GeoPoint{
        bounds.south_west.latitude_deg +
            north * (bounds.north_east.latitude_deg - bounds.south_west.latitude_deg),
        bounds.south_west.longitude_deg +
            east * (bounds.north_east.longitude_deg - bounds.south_west.longitude_deg)};
  };
  constexpr int kSpots = 100'000;
  std::size_t named = 0;
  const double spots_s = CpuSecondsOf([&] {
    for (int i = 0; i < kSpots; ++i) {
      named += streets::DescribeSpot(map, {place(), 3, 0.1 * i}).street.empty() ? 0 : 1;
    }
  });
  std::printf("words of a place: %.1f us of CPU each (n = %d, %zu on a named street)\n",
              1e6 * spots_s / kSpots, kSpots, named);
  for (const int zoom : {6, 9, 10, 11, 12, 13, 15, 17}) {
    constexpr int kTiles = 200;
    std::size_t found = 0;
    std::size_t truncated = 0;
    const double half_deg = 360 / std::pow(2, zoom);  // Half a tile of 512 pixels.
    const double tiles_s = CpuSecondsOf([&] {
      for (int i = 0; i < kTiles; ++i) {
        const geo::GeoPoint middle = place();
        const auto drawing =
            lines.Find({{middle.latitude_deg - half_deg, middle.longitude_deg - half_deg},
                        {middle.latitude_deg + half_deg, middle.longitude_deg + half_deg}},
                       zoom, 30'000);
        found += drawing.lines.size();
        truncated += drawing.is_truncated ? 1 : 0;
      }
    });
    std::printf("tile at zoom %d: %.2f ms of CPU, %.0f lines (mean of %d, %zu truncated)\n", zoom,
                1e3 * tiles_s / kTiles, static_cast<double>(found) / kTiles, kTiles, truncated);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  try {
    if (arguments.size() == 3 && arguments[0] == "write") {
      const std::int64_t ways = std::atoll(arguments[2].c_str());
      if (ways < 2 || ways > 4'000'000) {
        throw livemap::Error("WAYS is '" + arguments[2] + "', accepted are 2 to 4000000");
      }
      Metropolis(ways).Write(arguments[1]);
      return 0;
    }
    if (arguments.size() == 2 && arguments[0] == "read") {
      Read(arguments[1]);
      return 0;
    }
    std::fputs(kUsage, arguments.size() == 1 && arguments[0] == "--help" ? stdout : stderr);
    return arguments.size() == 1 && arguments[0] == "--help" ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "livemap_measure_streets: %s\n", error.what());
    return 1;
  }
}
