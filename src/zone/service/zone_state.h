#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "common/uuid.h"
#include "zone/belief/survival_model.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/desk/redirects.h"
#include "zone/model/store_damage.h"
#include "zone/registry/hazard_registry.h"
#include "zone/registry/map_change_registry.h"
#include "zone/service/zone_config.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// Everything that the zone keeps on disk and holds in memory beside it. Changes go through a
/// ZoneTransaction, so that memory and disk stay the same.
///
/// Not thread-safe; ZoneService guards it with two locks. Whoever holds the writer's lock owns
/// `store` and `generator`, and may read the rest. The rest is changed only while the data lock is
/// held exclusively as well, so that everybody else may read it with the data lock shared. The
/// thread-safety analysis checks this where ZoneService reaches the state; those that get a
/// reference to it say in their docstrings which locks their callers hold.
struct ZoneState {
  /// Opens or makes the database in `directory` and loads it. `uuid_seed` seeds the generator; the
  /// same seed gives other ids after a restart, because the ids of before are taken. Throws
  /// StoreError for a database that cannot be used.
  ZoneState(const ZoneConfig& config, const std::string& directory, std::uint64_t uuid_seed);

  mutable ZoneStore store;  ///< Mutable: a reader runs its statements, too.
  SurvivalModel survival;
  VehicleTrust trust;
  std::uint64_t sequence;       ///< Sequence of the newest event; 0 without one.
  std::uint64_t announced = 0;  ///< Sequence of the newest announced event; 0 without one.
  std::mt19937_64 generator;    ///< Makes uuids and the seeds of hashes.
  HazardRegistry hazards;
  MapChangeRegistry map_changes;
  Redirects redirects;  ///< The writer's, as `store`: changed after their commit.
  StoreDamage damage;   ///< Rows that were found invalid while loading.

 private:
  void Load();
};

}  // namespace livemap::zone
