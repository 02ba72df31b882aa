#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace livemap::bench {

/// Clients of a zone's live stream, as browsers with its map open are, in one thread of their own.
/// Some are slow: they take a message in ten seconds, as a phone at the edge of its cell might,
/// until the zone closes them. Nobody connects again.
///
/// Typical usage:
///
///     MapViewers viewers({port, 500, 50});
///     ...
///     viewers.StartCounting();
///     ...
///     MapViewers::Result result = viewers.End();
class MapViewers {
 public:
  struct Config {
    int port = 0;  ///< Of the map's server on this machine.
    std::size_t viewers = 0;
    std::size_t slow = 0;  ///< Of them.
  };
  /// An event of the zone as one viewer that is not slow heard it.
  struct Heard {
    std::uint64_t sequence = 0;
    std::int64_t heard_ns = 0;  ///< SteadyNs.
  };
  struct Result {
    std::size_t connected = 0;    ///< At the end, of those that are not slow.
    std::size_t slow_closed = 0;  ///< Connections of slow ones that have ended.
    std::size_t lost = 0;         ///< The same of others.
    std::string first_loss;       ///< Why.
    std::vector<Heard> heard;     ///< While it counted.
  };

  /// Connects all of them. Throws Error when not all could in half a minute.
  explicit MapViewers(const Config& config);
  ~MapViewers();
  MapViewers(const MapViewers&) = delete;
  MapViewers& operator=(const MapViewers&) = delete;

  /// From now on what is heard is kept.
  void StartCounting();
  /// Ends the connections. Called once.
  Result End();

 private:
  class Crowd;
  const std::unique_ptr<Crowd> crowd_;
};

}  // namespace livemap::bench
