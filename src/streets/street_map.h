#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "geo/geo_box.h"
#include "geo/wgs84.h"

namespace livemap::streets {

/// Importance of a street, after OpenStreetMap's key "highway".
enum class StreetKind : std::uint8_t {
  kMotorway,
  kTrunk,
  kPrimary,
  kSecondary,
  kTertiary,
  kResidential,  ///< And unclassified ones: minor streets that join places.
  kService,      ///< Living streets, drives to houses, car parks.
};

/// One street of the map: what all of its segments share.
struct Street {
  std::int64_t id = 0;     ///< Of the way in OpenStreetMap.
  std::uint32_t name = 0;  ///< Number of its name, see StreetMap::NameOf.
  float width_m = 0;       ///< Of the carriageway; 0: not told.
  StreetKind kind = StreetKind::kResidential;
  std::uint8_t lanes = 0;   ///< Of both directions together; 0: not told.
  std::int8_t layer = 0;    ///< Above (positive) or below what it crosses.
  bool forward = true;      ///< May be driven in the order of its nodes.
  bool backward = true;     ///< May be driven against that order.
  bool link = false;        ///< A ramp that joins two streets.
  bool bridge = false;      ///< It lies on a bridge.
  bool tunnel = false;      ///< It lies in a tunnel.
  bool roundabout = false;  ///< It is the ring of a roundabout.

  bool one_way() const { return forward != backward; }
  /// Half the width of the carriageway, m: by width, else by lanes, else of two lanes (one for
  /// ramps and service drives with one direction). A lane has 3.5 m.
  double HalfWidthM() const;
};

/// A segment of a street, driven in one direction.
struct Travel {
  std::uint32_t segment = 0;
  bool forward = true;  ///< In the order of the street's nodes.

  bool operator==(const Travel& other) const {
    return segment == other.segment && forward == other.forward;
  }
};

/// A turn at a junction that the law restricts, by the ids of OpenStreetMap.
struct TurnRestriction {
  std::int64_t from = 0;  ///< The way on which one comes.
  std::int64_t via = 0;   ///< The node of the junction.
  std::int64_t to = 0;    ///< The way onto which one turns.
  bool only = false;      ///< It is the only way on; else it is forbidden.
};

/// How many of each a street map may have; StreetMapBuilder refuses more.
struct StreetLimits {
  std::size_t max_streets = 4'000'000;
  std::size_t max_nodes = 40'000'000;     ///< Nodes in the streets, one in two streets twice.
  std::size_t max_segments = 20'000'000;  ///< Less than 1.5 GB in memory.
  std::size_t max_restrictions = 4'000'000;
  double max_segment_m = 20'000;  ///< A longer one is left out.
};

/// The drivable streets of an area: a graph of straight segments between nodes, with an index by
/// place. It takes some 70 bytes per segment. It does not change after StreetMapBuilder::Build,
/// and threads may share it.
class StreetMap {
 public:
  struct Segment {
    std::uint32_t from;    ///< Node.
    std::uint32_t to;      ///< Node.
    std::uint32_t street;  ///< Number of its street.
  };
  /// What was left out of the streets, for who reads the log.
  struct Counters {
    std::size_t missing_nodes = 0;  ///< Places in streets whose node the file does not have.
    std::size_t long_segments = 0;  ///< Longer than max_segment_m, or across the antimeridian.
    std::size_t off_range = 0;      ///< Nodes beyond 85 degrees of latitude.
  };

  std::size_t streets() const { return streets_.size(); }
  std::size_t segments() const { return segments_.size(); }
  std::size_t nodes() const { return places_.size(); }
  const Counters& counters() const { return counters_; }
  /// Bytes in memory.
  std::size_t bytes() const;
  /// The smallest box in degrees, west <= east, with all segments; of size 0 where there are none.
  geo::GeoBox Bounds() const;

  /// `number` is less than segments().
  const Segment& SegmentAt(std::uint32_t number) const { return segments_[number]; }
  /// The street of a segment.
  const Street& StreetOf(std::uint32_t segment) const {
    return streets_[segments_[segment].street];
  }
  /// Name of a street; empty where it has none.
  const std::string& NameOf(const Street& street) const { return names_[street.name]; }
  /// Place of a node, to 1e-7 degrees.
  geo::GeoPoint PlaceOf(std::uint32_t node) const;
  /// Node at which a travel begins, and the one at which it ends.
  std::uint32_t StartOf(const Travel& travel) const {
    return travel.forward ? segments_[travel.segment].from : segments_[travel.segment].to;
  }
  std::uint32_t EndOf(const Travel& travel) const {
    return travel.forward ? segments_[travel.segment].to : segments_[travel.segment].from;
  }
  /// Whether the street may be driven in that direction.
  bool IsLegal(const Travel& travel) const {
    const Street& street = StreetOf(travel.segment);
    return travel.forward ? street.forward : street.backward;
  }

  /// Segments that may come within `radius_m` of a place, each once, by number: all that do, and
  /// some that lie up to a cell (some 200 m) further; at most 20 000. Nothing for a place that is
  /// not valid, or a radius that is not in 0 to 5000 m.
  std::vector<std::uint32_t> SegmentsNear(const geo::GeoPoint& place, double radius_m) const;
  /// Segments that begin or end at a node, by number; at most 64 of them.
  std::vector<std::uint32_t> SegmentsAt(std::uint32_t node) const;
  /// How one may legally drive on at the end of a travel, by number of the segment: in the
  /// directions of the streets and by the restrictions of turns. Turning back counts only where
  /// there is nothing else. At most 64 segments at a node count.
  std::vector<Travel> Continuations(const Travel& travel) const;
  /// The only other segment at the travel's end, driven onwards whether that is legal or not;
  /// `travel` itself where there is none or a choice.
  Travel OnlyContinuation(const Travel& travel) const;

 private:
  friend class StreetMapBuilder;

  struct Place {
    std::int32_t latitude;   // 1e-7 degrees.
    std::int32_t longitude;  // The same.
  };
  /// A restriction by the numbers of node and streets.
  struct Restricted {
    std::uint32_t via;
    std::uint32_t from;
    std::uint32_t to;
    bool only;
  };

  bool IsForbidden(std::uint32_t node, std::uint32_t from, std::uint32_t to) const;

  std::vector<Street> streets_;
  std::vector<std::string> names_{""};
  std::vector<Place> places_;  // By node.
  std::vector<Segment> segments_;
  std::vector<std::uint32_t> incident_begin_;  // By node, one more than nodes.
  std::vector<std::uint32_t> incident_;        // Segments at the nodes.
  std::vector<Restricted> restricted_;         // By node and street.
  std::vector<std::uint64_t> cells_;           // Sorted keys of cells that have segments.
  std::vector<std::uint32_t> cell_begin_;      // By cell, one more than cells.
  std::vector<std::uint32_t> in_cells_;        // Segments in the cells.
  Counters counters_;
};

/// Makes a StreetMap: first all streets with the ids of their nodes, then the nodes' places, then
/// Build. Places of nodes that no street has are ignored, so that a file is read twice instead of
/// kept. Memory while building: 20 bytes per node of a street and 40 per segment above the map's.
class StreetMapBuilder {
 public:
  explicit StreetMapBuilder(const StreetLimits& limits = {}) : limits_(limits) {}

  /// `street.name` is ignored; `name` counts, its first 256 bytes. Throws Error for more streets or
  /// nodes than the limits accept.
  void AddStreet(const Street& street, const std::string& name,
                 const std::vector<std::int64_t>& nodes);
  /// Of streets that are not added, or a node that they do not have, it is ignored. Throws Error
  /// for more than the limits accept.
  void AddRestriction(const TurnRestriction& restriction);
  /// The first call ends the adding of streets. The place of a node counts once, the first one. One
  /// that is not valid is ignored, as if the node were missing.
  void SetPlace(std::int64_t node, const geo::GeoPoint& place);
  /// Throws Error for more segments than the limits accept. The builder is empty afterwards.
  StreetMap Build();

 private:
  void SortNodes();
  void MakeSegments();
  void IndexNodes();
  void IndexRestrictions();
  void IndexCells();

  StreetLimits limits_;
  StreetMap map_;
  std::unordered_map<std::string, std::uint32_t> name_numbers_;
  std::vector<std::int64_t> street_nodes_;  // Of all streets, one after the other.
  std::vector<std::size_t> street_ends_;    // In street_nodes_.
  std::vector<TurnRestriction> restrictions_;
  bool sorted_ = false;
  std::vector<std::int64_t> node_ids_;  // Sorted.
  std::vector<bool> placed_;
};

}  // namespace livemap::streets
