#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "geo/geo_box.h"
#include "geo/spatial_grid.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/report.h"
#include "zone/belief/hazard_fusion.h"
#include "zone/model/hazard.h"
#include "zone/model/page.h"
#include "zone/registry/hazard_records.h"
#include "zone/registry/map_view.h"
#include "zone/registry/uuid_index.h"

namespace livemap::zone {

/// A stored picture by content; both empty without one.
struct PictureName {
  std::string sha256;
  std::string format;
};

/// What a hazard takes from a sighting of it.
enum class SightingSays {
  kNothing,  ///< No more than that there was one.
  kWhen,     ///< When it was seen, and the picture.
  kSurer,    ///< That, and its position in place of the hazard's.
  kWhere     ///< When it was seen, the picture; its position and confidence join the others'.
};

/// All hazards of the zone in memory: which known hazard a report belongs to, and what changed
/// since when. Knows no clock, no store and no threads; the same calls give the same state.
///
/// Changes between Begin and Commit can be taken back with Rollback, so that memory and store stay
/// the same when a commit fails. Without Begin every change is final.
class HazardRegistry {
 public:
  /// A hazard's place in memory; slots count from 0 in the order of arrival.
  using Slot = std::uint32_t;

  /// Radii come from the catalogue. `hash_seed`: see SpatialGrid.
  HazardRegistry(protocol::HazardCatalogue catalogue, std::uint64_t hash_seed,
                 FusionRule rule = {});

  /// Takes in a hazard as the store kept it under `id`; in ascending order of sequence. The life's
  /// state counts, the hazard's presence too. Throws Error when its uuid or sequence is not new.
  void Restore(const Hazard& hazard, const PresenceRecord& life, std::uint32_t id);
  /// New hazards get ids above `id`: the store has rows up to there.
  void SkipIdsTo(std::uint32_t id) { last_id_ = std::max(last_id_, id); }

  /// The class under which hazards of a name from outside are kept: the catalogue's heading
  /// (HazardCatalogue::HeadingOf), and protocol::kOtherClass once there are very many classes.
  std::string HeadingOf(const std::string& class_name) const;
  /// The nearest hazard of this class that is not gone within the class's radius (geodesic), the
  /// older one among equals. `position` must be valid.
  std::optional<Slot> FindMatch(const std::string& class_name, const geo::GeoPoint& position) const;
  /// The same among those for which `may_match` answers true.
  std::optional<Slot> FindMatch(const std::string& class_name, const geo::GeoPoint& position,
                                const std::function<bool(Slot)>& may_match) const;

  /// Puts in a new hazard of the report's class, or of `class_name`; SetLife gives it its life.
  Slot Add(const protocol::Report& report, const PictureName& picture, const Uuid& uuid,
           std::uint64_t sequence, std::int64_t now_ns) {
    return Add(report, report.class_name, picture, uuid, sequence, now_ns);
  }
  Slot Add(const protocol::Report& report, const std::string& class_name,
           const PictureName& picture, const Uuid& uuid, std::uint64_t sequence,
           std::int64_t now_ns);
  /// Counts the report as a sighting of `slot`, and takes from it what `says` names. The newer
  /// image's picture stays.
  void Merge(Slot slot, const protocol::Report& report, const PictureName& picture,
             std::uint64_t sequence, std::int64_t now_ns, SightingSays says = SightingSays::kWhere);
  /// Whether a further report of the vehicle of all sightings is to be merged with kSurer.
  bool IsSurer(Slot slot, const protocol::Report& report) const {
    return zone::IsSurer(records_[slot].estimate, report, rule_);
  }
  /// The hazard's life as it is at `now_ns`; one that is gone matches no report any more.
  void SetLife(Slot slot, const PresenceRecord& life, double presence, std::uint64_t sequence,
               std::int64_t now_ns);
  /// What the vehicle said of the hazard stands under another key from now on; nothing else
  /// changes. False when it has said nothing that is remembered.
  bool RenameVoice(Slot slot, std::uint64_t vehicle, std::uint64_t pseudonym);
  /// An official has said of which class the hazard is and where it lies.
  void Edit(Slot slot, const std::string& class_name, const HazardEstimate& estimate,
            std::uint64_t sequence, std::int64_t now_ns);
  /// In which direction the place is passed (Hazard::course_rad).
  void SetCourse(Slot slot, double course_rad);
  /// How vehicles passed the place (Hazard::trails). Rollback leaves them: the caller sets those of
  /// before.
  void SetTrails(Slot slot, std::vector<protocol::Trail> trails);
  /// Empty where none is known.
  const std::vector<protocol::Trail>& Trails(Slot slot) const;
  /// A newer picture.
  void SetPicture(Slot slot, const PictureName& picture);
  /// Drivers are told of the hazard as it is now.
  void MarkAnnounced(Slot slot);

  Hazard Get(Slot slot) const;
  const HazardRecord& Record(Slot slot) const { return records_[slot]; }
  const std::string& ClassName(Slot slot) const {
    return classes_[records_[slot].hazard_class].name;
  }
  HazardState State(Slot slot) const { return records_[slot].life.state; }
  std::optional<Slot> Find(const Uuid& uuid) const;
  std::size_t size() const { return records_.size(); }
  /// How many are in each state, by HazardState.
  const std::array<std::size_t, kHazardStates>& counts() const { return counts_; }
  /// On the officials' map.
  std::size_t on_map_count() const;
  /// On the map by the word of this vehicle (VehicleKey) alone (OnlyWitness).
  std::size_t CountRestingOn(std::uint64_t vehicle) const;

  /// As ZoneService::Query.
  std::vector<Hazard> Query(const std::optional<geo::GeoBox>& box, std::uint64_t since_sequence,
                            std::size_t limit, const HazardStates& states = {}) const;
  /// As ZoneService::ReadHazards.
  Page<Hazard> ReadPage(const Walk<HazardState>& walk, std::size_t limit) const;
  /// Those that are not gone and of which the vehicle (VehicleKey) has said something, from the
  /// slot `next` on: at most `max_found` of at most `max_looks` slots, so that one call is short.
  /// `next` becomes the first slot that was not looked at; size() when all were.
  std::vector<Slot> HazardsWithEvidenceFrom(std::uint64_t vehicle, Slot& next,
                                            std::size_t max_found, std::size_t max_looks) const;
  /// Every `step`-th hazard on the map from the slot `next` on, looking at `max_looks` slots;
  /// `next` and `on_map`, the number of hazards on the map before it, go on from call to call.
  void AppendToView(Slot& next, std::size_t& on_map, std::size_t step, std::size_t max_looks,
                    std::vector<ViewHazard>& view) const;
  /// As ZoneService::QueryNear.
  std::vector<Hazard> QueryNear(const geo::GeoPoint& centre, double radius_m,
                                std::size_t limit) const;

  /// As ZoneService::ChangedAround.
  std::vector<Hazard> ChangedAround(const geo::GeoPoint& centre, double radius_m,
                                    std::uint64_t since_sequence, std::size_t limit) const;

  void Begin();
  void Commit();
  void Rollback();

 private:
  struct Change {
    std::uint64_t sequence = 0;
    Slot slot = 0;
  };
  struct Undo {
    Slot slot = 0;
    bool is_new = false;
    HazardRecord before;  ///< Unless it is new.
  };
  struct Class {
    std::string name;
    double radius_m;
    geo::SpatialGrid grid;  ///< All that are not gone.
  };

  /// More than a catalogue that somebody reads through.
  static constexpr std::size_t kMaxClasses = 1000;

  std::uint32_t ClassOf(const std::string& class_name);
  Slot Append(const HazardRecord& record);
  void PutOnGrid(Slot slot);
  void TakeFromGrid(Slot slot);
  void CountWitness(const PresenceRecord& life, int change);
  void RememberForUndo(Slot slot);
  void NoteChange(Slot slot);
  void CompactChanges();
  void TakeBack(const Undo& undo);
  std::vector<Change>::const_iterator ChangesSince(std::uint64_t sequence) const;

  protocol::HazardCatalogue catalogue_;
  std::uint64_t hash_seed_;
  FusionRule rule_;
  HazardRecords records_;                                          ///< By slot.
  std::unordered_map<Slot, std::vector<protocol::Trail>> trails_;  ///< Of those that have any.
  UuidIndex slots_;
  std::vector<Class> classes_;
  std::unordered_map<std::string, std::uint32_t> class_places_;  ///< By name, in classes_.
  std::uint32_t last_id_ = 0;
  /// In ascending order of sequence; an entry is stale once its hazard has a newer sequence.
  std::vector<Change> changes_;
  std::array<std::size_t, kHazardStates> counts_{};
  /// Hazards that rest on one vehicle's word alone, by that vehicle; none of 0.
  std::unordered_map<std::uint64_t, std::size_t> resting_on_;
  bool in_transaction_ = false;
  std::size_t changes_at_begin_ = 0;
  std::vector<Undo> undo_;
};

}  // namespace livemap::zone
