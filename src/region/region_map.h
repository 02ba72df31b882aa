#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "geo/geo_box.h"
#include "protocol/cross_zone_duplicates.h"
#include "protocol/hazard_catalogue.h"
#include "region/zone_answer.h"
#include "zone/registry/shared_view.h"
#include "zone/service/event_stream.h"
#include "zone/service/map_reader.h"

namespace livemap::region {

/// The id of a zone's hazard on the region's map: made of the zone's id and the hazard's own, so
/// that no zone can take the place of another one's hazard. It is the same in every region and
/// after every start (a UUID of version 8, RFC 9562).
Uuid RegionHazardId(const std::string& zone, const Uuid& hazard);

/// Where a hazard of the region's map comes from.
struct HazardOrigin {
  std::string zone;  ///< Its id.
  Uuid hazard;       ///< The zone's own id of the hazard.
  /// Since when it is in its present state, by the zone's sequence and by the region's.
  std::uint64_t zone_since = 0;
  std::uint64_t region_since = 0;
};

/// The hazards of many zones as one map: those that drivers are told of, and candidates, where they
/// are followed, for officials. Each change gets the next number of the region's own sequence. A
/// hazard that two zones hold at their border is on the map once, when drivers are told of it
/// (protocol::CrossZoneDuplicates); a candidate neither hides another hazard nor is hidden. Classes
/// that the catalogue does not name are under its heading for them
/// (protocol::HazardCatalogue::HeadingOf).
///
/// Hazards that left the map are remembered as gone, the newest kMaxGone of them, so that a page
/// that was away hears of it. Thread-safe.
class RegionMap : public zone::MapReader {
 public:
  /// Beyond it what left the map first is forgotten.
  static constexpr std::size_t kMaxGone = 100'000;

  /// The sequence goes on from `sequence`. `view` is where a map that is opened looks; without one
  /// it looks where most hazards are.
  RegionMap(const protocol::HazardCatalogue& catalogue, std::uint64_t sequence,
            std::optional<geo::GeoBox> view);

  /// What the zone of this id told: hazards that are there come or change, others leave.
  void Apply(const std::string& zone, const std::vector<ToldHazard>& hazards);
  /// The zone's own ids of its hazards that are there and not among `hazards`.
  std::vector<Uuid> NotAmong(const std::string& zone,
                             const std::unordered_set<Uuid>& hazards) const;
  /// These hazards of the zone, by its own ids, leave the map.
  void Remove(const std::string& zone, const std::vector<Uuid>& hazards);
  /// How many hazards of the zone are there, those included that are not shown because another zone
  /// has them, and candidates.
  std::size_t CountOf(const std::string& zone) const;
  /// The same without candidates.
  std::size_t ToldCountOf(const std::string& zone) const;
  /// Hazards that are not shown, because another zone has them.
  std::size_t hidden() const;
  /// Of a hazard that is on the map, or was and is remembered; none for any other.
  std::optional<HazardOrigin> OriginOf(const Uuid& id) const;

  std::uint64_t Sequence() const override;
  Uuid LogId() const override { return log_id_; }
  zone::Page<zone::Hazard> ReadHazards(const zone::Walk<zone::HazardState>& walk,
                                       std::size_t limit) const override;
  /// None: zones keep their map changes to themselves.
  zone::Page<zone::MapChangeFeature> ReadMapChanges(const zone::Walk<zone::MapChangeState>& walk,
                                                    std::size_t limit) const override;
  std::array<std::size_t, zone::kHazardStates> HazardCounts() const override;
  std::optional<zone::Hazard> Find(const Uuid& uuid) const override;
  std::optional<zone::MapChangeFeature> FindMapChange(const Uuid& uuid) const override;
  /// None: a zone's history stays there.
  std::vector<zone::StoredEvent> Events(const Uuid& hazard, std::size_t limit) const override;
  /// None: no vehicle is known beyond its zone.
  std::vector<zone::VehicleState> VehiclesAfter(const std::string& id,
                                                std::size_t limit) const override;
  std::optional<geo::GeoBox> View() const override;
  const streets::StreetMap* streets() const override { return nullptr; }
  /// As the hazard's zone told it.
  streets::StreetWords WordsOf(const zone::Hazard& hazard) const override;
  int Subscribe(Subscriber subscriber) override;
  void Unsubscribe(int id) override;

 private:
  /// What of a hazard decides whether it is another zone's, too.
  struct PlacedHazard {
    Uuid id;
    std::string class_name;
    geo::GeoPoint position;
  };
  using Duplicates = protocol::CrossZoneDuplicates<PlacedHazard>;

  /// A hazard that is on the map, or was.
  struct Shown {
    zone::Hazard hazard;
    streets::StreetWords words;
    HazardOrigin origin;
  };

  void Put(const std::string& zone, const ToldHazard& told) REQUIRES(writer_mutex_);
  void RemoveOne(const std::string& zone, const Uuid& hazard) REQUIRES(writer_mutex_);
  /// Brings what is shown up to date and tells subscribers.
  void Show(const Duplicates::Changes& changes) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  void HideUnshown(const Uuid& id) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  void ShowCandidate(const Uuid& id) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  /// A candidate that is on the map leaves it.
  void WithdrawCandidate(const Uuid& id) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  void CountCandidate(const std::string& zone, const Uuid& id, bool is_candidate)
      REQUIRES(writer_mutex_);
  zone::HazardEvent PutShown(const Shown& shown) REQUIRES(data_mutex_);
  std::optional<zone::HazardEvent> RemoveShown(const Uuid& id) REQUIRES(data_mutex_);
  void ForgetOldest() REQUIRES(data_mutex_);

  const protocol::HazardCatalogue catalogue_;
  const std::optional<geo::GeoBox> bounds_;
  const Uuid log_id_;
  mutable zone::SharedView view_;
  zone::EventStream stream_;

  /// One writer at a time; events are told under it, in the order of their sequence.
  mutable Mutex writer_mutex_ ACQUIRED_BEFORE(data_mutex_);
  Duplicates duplicates_ GUARDED_BY(writer_mutex_);
  /// What zones have told, by the region's id, and whether it is shown or not.
  std::unordered_map<Uuid, Shown> told_ GUARDED_BY(writer_mutex_);
  /// The zone's own ids of its hazards that are there, by zone.
  std::map<std::string, std::unordered_set<Uuid>> by_zone_ GUARDED_BY(writer_mutex_);
  /// How many of them are candidates.
  std::map<std::string, std::size_t> candidates_ GUARDED_BY(writer_mutex_);

  /// Of what readers see. Never held while subscribers are told: they read.
  mutable SharedMutex data_mutex_;
  std::uint64_t sequence_ GUARDED_BY(data_mutex_);
  std::unordered_map<Uuid, Shown> shown_ GUARDED_BY(data_mutex_);
  std::map<std::uint64_t, Uuid> by_sequence_ GUARDED_BY(data_mutex_);
  std::map<std::uint64_t, Uuid> gone_ GUARDED_BY(data_mutex_);  ///< Of these, those that left.
  std::array<std::size_t, zone::kHazardStates> counts_ GUARDED_BY(data_mutex_){};
};

}  // namespace livemap::region
