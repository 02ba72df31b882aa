#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstdint>
#include <functional>
#include <string>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The tables `lives` and `trust`: what the zone has learned of classes and of vehicles.
class LearnedTables {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit LearnedTables(StoreConnection& connection);
  LearnedTables(const LearnedTables&) = delete;
  LearnedTables& operator=(const LearnedTables&) = delete;

  /// See the functions of ZoneStore with these names.
  StoreDamage LoadLives(const std::function<void(const std::string&, LearnedLifetime)>& take);
  StoreDamage LoadTrust(const std::function<void(std::uint64_t, const TrustRecord&)>& take);
  void WriteLife(const std::string& class_name, const LearnedLifetime& learned);
  void WriteTrust(std::uint64_t vehicle, const TrustRecord& record);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string class_name, vouchers;
    double ended = 0, stood_s = 0, suspicion = 0;
    long long vehicle_key = 0, updated_ns = 0;
  };

  StoreConnection& connection_;
  Row row_;
  WriteStatement write_life_;
  WriteStatement write_trust_;
};

}  // namespace livemap::zone
