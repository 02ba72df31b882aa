#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "directory/zone_area.h"
#include "geo/wgs84.h"

namespace livemap::directory {

/// Where vehicles reach a zone's broker.
struct BrokerAddress {
  std::string host;  ///< Name or address, as in the broker's certificate.
  int port = 8883;
  /// SHA-256 of the broker's certificate in DER, 64 lower-case hex digits; empty: any certificate
  /// of the authority for this host is accepted.
  std::string fingerprint;
};

/// One zone of an authority.
struct ZoneEntry {
  std::string id;    ///< As in MQTT topics (transport::IsValidId).
  std::string name;  ///< For people; empty: none.
  ZoneArea area;
  std::vector<BrokerAddress> brokers;  ///< At least one; the first that answers is taken.
  std::string map_url;  ///< Of its live map, "https://zone.example"; empty: not told.
};

/// An authority's list of its zones (docs/reference/zone-directory.md): a GeoJSON
/// FeatureCollection (RFC 7946) with a version. This class reads what is signed already; it knows
/// nothing of signatures (OpenSignedDocument).
///
/// Typical usage:
///
///     const ZoneDirectory directory = ZoneDirectory::Parse(geojson, "zones.geojson");
///     if (const auto found = directory.Find(position, 2000)) {
///       Connect(directory.zones()[found->zone].brokers);
///     }
class ZoneDirectory {
 public:
  /// Throws Error that names `name`, the zone, the value and what is accepted. The text may be
  /// anything: it is at most kMaxBytes long, has at most kMaxZones zones and kMaxCorners corners.
  static ZoneDirectory Parse(const std::string& geojson, const std::string& name);

  /// A zone and how deep in it a point lies (ZoneArea::DepthM).
  struct Found {
    std::size_t zone;  ///< Its place in zones().
    double depth_m;
  };
  /// The zone that serves a point: of those that contain it, the one in which it lies deepest; in
  /// a gap, the nearest one, if that is no further than `max_gap_m` away. So the border between two
  /// zones that overlap runs in the middle of the overlap. Among equals the first one counts.
  std::optional<Found> Find(const geo::GeoPoint& point, double max_gap_m) const;
  /// The place in zones() of the zone of this id.
  std::optional<std::size_t> FindId(const std::string& id) const;

  const std::string& authority() const { return authority_; }
  /// Greater than that of every directory before.
  std::uint64_t version() const { return version_; }
  std::int64_t issued_ns() const { return issued_ns_; }    ///< Stamp.
  std::int64_t expires_ns() const { return expires_ns_; }  ///< Stamp; not used from then on.
  const std::vector<ZoneEntry>& zones() const { return zones_; }

  static constexpr std::size_t kMaxBytes = 2 << 20;
  static constexpr std::size_t kMaxZones = 5000;
  static constexpr std::size_t kMaxCorners = 50000;  ///< Of all zones.
  static constexpr std::size_t kMaxBrokers = 8;      ///< Of one zone.

 private:
  ZoneDirectory() = default;

  std::string authority_;
  std::uint64_t version_ = 0;
  std::int64_t issued_ns_ = 0;
  std::int64_t expires_ns_ = 0;
  std::vector<ZoneEntry> zones_;
};

/// Chooses the zone of a vehicle that moves. At a border it stays with its zone until another one
/// serves it better by `hysteresis_m`, so that a vehicle on the border does not change all the
/// time.
class ZoneChoice {
 public:
  struct Config {
    /// Another zone must be deeper by this, m.
    double hysteresis_m = 50;
    /// A vehicle that no zone contains takes the nearest one within this, m.
    double max_gap_m = 2000;
  };
  /// Throws Error for a number that is negative or not finite.
  explicit ZoneChoice(const Config& config);

  /// The zone for `point`, which becomes the present one; none where no zone is near. A present
  /// zone that `directory` no longer has counts for nothing.
  std::optional<std::size_t> Update(const ZoneDirectory& directory, const geo::GeoPoint& point);

 private:
  Config config_;
  std::string present_;  ///< Id; empty: none.
};

/// Two zones whose areas overlap by more than a border's width.
struct ZoneOverlap {
  std::size_t first;
  std::size_t second;
  geo::GeoPoint where;  ///< A place in both, on the border of one of them.
  double depth_m;       ///< How deep it lies in the other one.
};

/// The overlaps in which a place on the border of one zone lies deeper than `max_depth_m` in the
/// other; for each pair of zones the deepest place that was looked at, every 100 m of border. Who
/// signs a directory looks at these: a zone may not claim its neighbour's streets by mistake.
std::vector<ZoneOverlap> FindOverlaps(const ZoneDirectory& directory, double max_depth_m);

}  // namespace livemap::directory
