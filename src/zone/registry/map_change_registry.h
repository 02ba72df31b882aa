#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "geo/geo_box.h"
#include "geo/spatial_grid.h"
#include "protocol/map_change_report.h"
#include "zone/belief/hazard_fusion.h"
#include "zone/model/erasure.h"
#include "zone/model/map_change.h"
#include "zone/model/page.h"

namespace livemap::zone {

/// All map changes of the zone in memory: which of them a vehicle speaks of, and what follows.
/// Knows no clock, no store and no threads; the same calls give the same state. Words count in the
/// order of the calls, "later" and "older" are about the stamps of images.
///
/// Changes between Begin and Commit can be taken back with Rollback, so that memory and store stay
/// the same when a commit fails. Without Begin every change is final.
class MapChangeRegistry {
 public:
  using Id = std::uint32_t;  ///< Of a row in the store; rises from 1.

  struct Rule {
    double join_m = 6;                ///< A word belongs to a feature within this (geodesic), > 0,
    double join_sigmas = 3;           ///< and this many sigmas of both positions together, > 0.
    std::uint32_t confirmations = 2;  ///< Distinct vehicles that make it confirmed.
    std::uint32_t denying_vehicles = 2;  ///< Distinct vehicles that undo a confirmed one.
    double closed_memory_s = 7776000;    ///< An undone or dismissed one is known for so long.
    std::size_t max_features = 100000;   ///< Beyond it the oldest undone or dismissed one goes.
    FusionRule fusion;
  };

  enum class Outcome { kAdded, kMerged, kDenied, kKnown };
  /// What a word did. `id` is that of the feature it is about.
  struct Effect {
    Outcome outcome = Outcome::kKnown;
    Id id = 0;
    MapChangeEvent event;  ///< Unless kKnown.
  };
  /// What an event gets: all of it is the caller's.
  struct Stamp {
    Uuid fresh;  ///< Id of the feature, should it be new; not in use yet.
    std::uint64_t sequence = 0;
    std::int64_t now_ns = 0;  ///< Zone clock.
  };

  /// `hash_seed`: see SpatialGrid. Throws Error for an impossible rule.
  MapChangeRegistry(const Rule& rule, std::uint64_t hash_seed);

  /// Takes in a feature as the store kept it. Throws Error when its id, uuid or sequence is not
  /// new.
  void Restore(Id id, const MapChangeFeature& feature);
  /// New features get ids above `id`.
  void SkipIdsTo(Id id);

  /// A vehicle tells of a change; `report` is acceptable (WhyMapChangeRefused). It speaks for the
  /// nearest open feature of its class and direction, or against the nearest one of the other
  /// direction: that one is undone by one vehicle while it is proposed, by Rule::denying_vehicles
  /// while it is confirmed, and a word for it that is newer than those against it takes them back.
  /// Else it is a new feature.
  ///
  /// Nothing new (kKnown, no event) is a word of a vehicle that does not count (`counts` false)
  /// about a known feature; against a feature that was seen later; for one that was undone later;
  /// for one that an official dismissed; what undid a feature, told once more.
  ///
  /// None when there is no room for a new feature: only open ones are left.
  std::optional<Effect> Tell(const protocol::MapChangeReport& report, bool counts,
                             const Stamp& stamp);

  /// An official confirms the feature (kConfirmed; also a dismissed one, which is open again) or
  /// dismisses it (kDismissed, an open one). None when there is no such feature to decide about.
  std::optional<MapChangeEvent> Decide(const Uuid& uuid, MapChangeState to, std::string reason,
                                       const Stamp& stamp);

  /// An official's decision is taken back: the feature has the state of `before`, and the denials
  /// that a confirmation had made void count again; what was told since counts on top. None when
  /// there is no such feature, or it is undone.
  std::optional<MapChangeEvent> TakeDecisionBack(const Uuid& uuid, const MapChangeFeature& before,
                                                 std::string reason, const Stamp& stamp);

  /// What the vehicle said stands under its pseudonyms from now on, in those of `max_looks`
  /// features from the id `next` on; nothing else changes. `next` becomes the first id that was not
  /// looked at. How many features changed.
  std::size_t RenameWitness(const Pseudonyms& names, Id& next, Id max_looks);
  /// The greatest id that a feature has or had.
  Id last_id() const { return last_id_; }

  const MapChangeFeature* Find(const Uuid& uuid) const;
  const MapChangeFeature& Get(Id id) const { return features_.at(id); }
  /// As ZoneService::QueryMapChanges.
  std::vector<MapChangeFeature> Query(const std::optional<geo::GeoBox>& box,
                                      std::uint64_t since_sequence, std::size_t limit,
                                      const MapChangeStates& states = {}) const;
  /// As ZoneService::ReadMapChanges.
  Page<MapChangeFeature> ReadPage(const Walk<MapChangeState>& walk, std::size_t limit) const;
  std::size_t size() const { return features_.size(); }
  /// How many are in each state, by MapChangeState.
  const std::array<std::size_t, kMapChangeStates>& counts() const { return counts_; }
  std::optional<Id> IdOf(const Uuid& uuid) const;

  void Begin();
  void Commit();
  void Rollback();
  /// Since Begin: the features that are new or changed, and those that are no more.
  struct Touched {
    std::vector<Id> written;
    std::vector<Id> dropped;
  };
  Touched TouchedSinceBegin() const;

 private:
  struct Undo {
    Id id = 0;
    std::optional<MapChangeFeature> before;  ///< None: it is new.
  };

  template <typename Accepts>
  std::optional<Id> Nearest(const protocol::MapChangeReport& report, const Accepts& accepts) const;
  bool IsAnswered(const MapChangeFeature& feature, const protocol::MapChangeReport& report,
                  std::int64_t now_ns) const;
  Effect Support(Id id, const protocol::MapChangeReport& report, const Stamp& stamp);
  Effect Deny(Id id, const protocol::MapChangeReport& report, const Stamp& stamp);
  std::optional<Effect> Add(const protocol::MapChangeReport& report, bool counts,
                            const Stamp& stamp);
  void FuseInto(MapChangeFeature& feature, const protocol::MapChangeReport& report) const;
  MapChangeEvent Settle(Id id, MapChangeFeature feature, std::string reason, const Stamp& stamp);
  bool MakeRoom();
  void Put(Id id, MapChangeFeature feature);
  void Drop(Id id);
  void Index(Id id, const MapChangeFeature& feature);
  void Unindex(Id id, const MapChangeFeature& feature);

  Rule rule_;
  std::unordered_map<Id, MapChangeFeature> features_;
  std::unordered_map<Uuid, Id> ids_;
  std::map<std::uint64_t, Id> by_sequence_;
  std::map<std::uint64_t, Id> closed_by_sequence_;  ///< Undone and dismissed ones, oldest first.
  geo::SpatialGrid grid_;
  std::array<std::size_t, kMapChangeStates> counts_{};
  Id last_id_ = 0;
  bool in_transaction_ = false;
  Id last_id_at_begin_ = 0;
  std::vector<Undo> undo_;
};

}  // namespace livemap::zone
