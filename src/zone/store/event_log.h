#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The table `events`: the history of every hazard.
class EventLog {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit EventLog(StoreConnection& connection);
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  /// See ZoneStore::LoadEvents and WriteEvent.
  std::vector<StoredEvent> Load(const Uuid& hazard, std::uint64_t sequence, std::size_t limit);
  /// See ZoneStore::LoadTurnsAfter.
  std::vector<StoredEvent> LoadTurnsAfter(std::uint64_t sequence, std::size_t limit);
  void Write(const HazardEvent& event, std::uint64_t hazard_id, std::uint64_t previous_sequence);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string reason, hazard_uuid;
    long long hazard_id = 0, sequence = 0, previous_sequence = 0, updated_ns = 0;
    int state = 0, action = 0, from_state = 0, announced = 0;
    soci::indicator has_from = soci::i_ok;
  };

  StoreConnection& connection_;
  Row row_;
  soci::statement find_;
  WriteStatement write_;
};

}  // namespace livemap::zone
