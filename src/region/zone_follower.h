#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "directory/zone_area.h"
#include "orders/senders/network_client.h"
#include "region/region_map.h"
#include "region/region_store.h"
#include "region/zone_answer.h"

namespace livemap::region {

/// What lies in an area, or not far beyond its border.
struct Surroundings {
  directory::ZoneArea area;
  double margin_m;  ///< Beyond the border.

  /// `position` is valid.
  bool Have(const geo::GeoPoint& position) const {
    return area.IsNear(position, margin_m) && area.DepthM(position) >= -margin_m;
  }
};

/// A zone of a region, and how it is reached.
struct RegionZone {
  std::string id;     ///< As transport::IsValidId accepts it.
  std::string name;   ///< For people; empty: none.
  std::string url;    ///< Of its live map, without a last '/', "https://zone.example".
  std::string token;  ///< Of an official, which is shown to the zone; empty: the region asks as
                      ///< anybody may.
  std::optional<directory::ZoneArea> area;  ///< None: it is not known.
  /// Of its hazards these alone count; none: all of them.
  std::optional<Surroundings> only = std::nullopt;
  bool with_candidates = false;  ///< Also hazards that drivers are not told of yet.
};

/// How a zone is, as far as the region knows.
struct ZoneStatus {
  bool is_up = false;            ///< It has answered the newest question.
  std::int64_t heard_ns = 0;     ///< When it answered last, UTC ns since 1970; 0: never.
  std::string trouble;           ///< Why it is not up, in one sentence; empty while it is up.
  std::size_t hazards = 0;       ///< Of which drivers are told, as it said last.
  std::uint64_t failures = 0;    ///< Questions without an acceptable answer.
  std::uint64_t refused = 0;     ///< Hazards that were left out.
  std::string refusal;           ///< Why the newest of them was; empty: there was none.
  std::uint64_t begun_anew = 0;  ///< How often its log was another one than before.
};

/// Follows the log of one zone by sequence. After an outage it resumes where it was. Where the log
/// is another one (ZoneAnswer::log), it reads all of it anew, and what the zone no longer has
/// leaves the map at the end; until then the last state stands. What it learns is on disk before it
/// is on the map.
///
/// Step is called by one thread at a time, status by any.
class ZoneFollower {
 public:
  /// One exchange by HTTP, as NetworkClient::Call.
  using Call = std::function<orders::HttpAnswer(const orders::HttpCall&)>;
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.

  /// A zone with more hazards than this is not believed.
  static constexpr std::size_t kMaxHazards = 200'000;
  /// A hazard further outside of the zone's area, m, is left out: no vehicle of the zone was there.
  static constexpr double kMaxBeyondM = 2000;

  /// Keeps references to `map` and `store`, and puts the zone's last state on the map.
  ZoneFollower(RegionZone zone, Call call, Clock now_ns, RegionMap& map, RegionStore& store);

  /// Asks the zone once. True where there is more to be asked at once. Throws StoreError when what
  /// the zone told cannot be kept: then it is not on the map either, and is asked for again.
  bool Step();

  ZoneStatus status() const;
  const RegionZone& zone() const { return zone_; }

 private:
  ZoneAnswer Ask(std::uint64_t after);
  /// The answer to the question what came after `after`.
  bool Take(ZoneAnswer answer, std::uint64_t after);
  void LeaveOutBeyond(ZoneAnswer& answer) const;
  void KeepSurroundings(std::vector<ToldHazard>& hazards) const;
  void BeginAnew(const Uuid& log);
  void SayUp(const ZoneAnswer& answer);
  void SayDown(const std::string& trouble);

  const RegionZone zone_;
  const Call call_;
  const Clock now_ns_;
  RegionMap& map_;
  RegionStore& store_;

  LogPlace place_;
  std::int64_t saved_heard_ns_ = 0;
  /// While a log is read anew: its name, up to where it is read, and what it has had.
  struct Reading {
    Uuid log;
    std::uint64_t sequence = 0;
    std::unordered_set<Uuid> there;
  };
  std::optional<Reading> reading_;

  mutable Mutex mutex_;
  ZoneStatus status_ GUARDED_BY(mutex_);
};

}  // namespace livemap::region
