#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The table `places`: where each vehicle was, as far as the rule of speed remembers it.
class PlaceTable {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit PlaceTable(StoreConnection& connection);
  PlaceTable(const PlaceTable&) = delete;
  PlaceTable& operator=(const PlaceTable&) = delete;

  /// See LoadPlaces, FindPlaces, WritePlace, DropPlace and PrunePlaces of ZoneStore.
  StoreDamage Load(const std::function<void(const std::string&, KnownPlace)>& take);
  std::vector<KnownPlace> Find(const std::string& vehicle_id, std::size_t limit);
  void Write(const std::string& vehicle_id, const KnownPlace& place);
  void Drop(const std::string& vehicle_id, std::int64_t stamp_ns);
  std::optional<std::string> Prune(const std::string& after, std::int64_t before_ns,
                                   std::size_t max_places);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string vehicle_id, after;
    double latitude = 0, longitude = 0, sigma_m = 0;
    long long stamp_ns = 0, count = 0, limit = 0;
  };

  static KnownPlace ToPlace(const Row& row);

  StoreConnection& connection_;
  Row row_;
  soci::statement find_;
  WriteStatement write_;
  WriteStatement drop_;
  soci::statement next_;
  soci::statement prune_;
};

}  // namespace livemap::zone
