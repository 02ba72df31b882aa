#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/geo_box.h"
#include "streets/street_map.h"
#include "streets/street_place.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"
#include "zone/model/page.h"
#include "zone/model/vehicle_state.h"
#include "zone/service/event_stream.h"

namespace livemap::zone {

/// What a map, its API and its feeds read: of one zone (ZoneService), or of the zones of a region
/// together. Thread-safe.
class MapReader {
 public:
  using Subscriber = EventStream::Subscriber;

  MapReader() = default;
  virtual ~MapReader() = default;
  MapReader(const MapReader&) = delete;
  MapReader& operator=(const MapReader&) = delete;

  /// Of the newest event; 0 when nothing ever happened. Waits for nothing.
  virtual std::uint64_t Sequence() const = 0;
  /// Names the log of which Sequence() is the newest number. It is another one after every start,
  /// because the store may then be another one or an older copy: whoever follows the log by
  /// sequence begins anew.
  virtual Uuid LogId() const = 0;
  /// The next page, of at most `limit`, of a walk over the hazards. Whoever walks until Sequence()
  /// as it was at the start is told each hazard once; those that change meanwhile may be left out
  /// and have a newer sequence.
  virtual Page<Hazard> ReadHazards(const Walk<HazardState>& walk, std::size_t limit) const = 0;
  /// As ReadHazards.
  virtual Page<MapChangeFeature> ReadMapChanges(const Walk<MapChangeState>& walk,
                                                std::size_t limit) const = 0;
  /// How many hazards are in each state, by HazardState.
  virtual std::array<std::size_t, kHazardStates> HazardCounts() const = 0;
  /// Also one that is gone or rejected.
  virtual std::optional<Hazard> Find(const Uuid& uuid) const = 0;
  virtual std::optional<MapChangeFeature> FindMapChange(const Uuid& uuid) const = 0;
  /// The newest `limit` events of a hazard, oldest of them first; empty for an unknown one. Throws
  /// StoreError.
  virtual std::vector<StoredEvent> Events(const Uuid& hazard, std::size_t limit) const = 0;
  /// The first `limit` vehicles whose id comes after `id`.
  virtual std::vector<VehicleState> VehiclesAfter(const std::string& id,
                                                  std::size_t limit) const = 0;
  /// What a map shows that is opened; none while there is nothing.
  virtual std::optional<geo::GeoBox> View() const = 0;
  /// The streets that are known; null: none. They do not change.
  virtual const streets::StreetMap* streets() const = 0;
  /// Where on the streets the hazard lies. Quick, any thread.
  virtual streets::StreetWords WordsOf(const Hazard& hazard) const = 0;

  /// `subscriber` is called one call at a time, in the order of the events' sequence. It may read
  /// from this reader but must not (un)subscribe.
  virtual int Subscribe(Subscriber subscriber) = 0;
  /// When this returns the subscriber is not running and will not be called again.
  virtual void Unsubscribe(int id) = 0;
};

}  // namespace livemap::zone
