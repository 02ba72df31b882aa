#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/uuid.h"
#include "geo/spatial_grid.h"
#include "geo/wgs84.h"
#include "web/feeds/feed_hazard.h"

namespace livemap::web {

/// Finds work zones: cones, barriers, signs and machines that stand together, each within 60 m of
/// another one. Devices of which it is known that they are passed on different streets or in
/// different directions are not joined. A lone cone is no work zone.
///
/// It keeps some 200 bytes per device, names of streets once.
class WorkZones {
 public:
  /// What a work zone is made of.
  struct Device {
    Uuid id;
    geo::GeoPoint position;
    std::int64_t first_seen_ns = 0;
    std::int64_t updated_ns = 0;
    std::int64_t ends_ns = 0;
    double course_rad = 0;        ///< NaN: not known.
    std::uint32_t street = 0;     ///< For name(); 0: not known.
    std::uint32_t direction = 0;  ///< The same.
    std::uint32_t near = 0;       ///< The same.
    WorkDeviceKind kind = WorkDeviceKind::kNone;
  };
  /// Devices of one work zone in the order in which traffic passes them, as far as that is known;
  /// at least one.
  using Zone = std::vector<Device>;

  WorkZones();

  /// Takes a hazard; nothing where its class is no device of a work zone. Quick.
  void Add(const FeedHazard& hazard);
  /// No more are added. Before the first Next.
  void Close();
  /// The next work zone, by the order in which its first device was added; empty: there are no
  /// more.
  Zone Next();
  /// A name that a device refers to; the empty one is number 0.
  const std::string& name(std::uint32_t number) const { return names_[number]; }

 private:
  std::uint32_t Intern(const std::string& text);
  std::size_t RootOf(std::size_t device);
  bool MayJoin(const Device& a, const Device& b) const;

  std::vector<Device> devices_;
  std::vector<std::size_t> parents_;       ///< Of a forest; a root is the first device of its zone.
  std::vector<std::size_t> next_in_zone_;  ///< After Close; devices_.size(): none.
  geo::SpatialGrid grid_;
  std::vector<std::string> names_{""};
  std::unordered_map<std::string, std::uint32_t> numbers_;
  std::size_t next_ = 0;
};

}  // namespace livemap::web
