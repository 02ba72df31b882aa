#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "zone/store/decision_table.h"
#include "zone/store/desk_table.h"
#include "zone/store/event_log.h"
#include "zone/store/map_change_table.h"

namespace livemap::zone {

/// Reads events over a connection of its own, beside the one that writes: thread-safe. Whoever asks
/// for histories without pause keeps no commit waiting.
class StoredHistories {
 public:
  /// `connection` is SOCI's text for a database whose schema is up to date. Throws soci_error where
  /// it cannot be opened.
  explicit StoredHistories(const std::string& connection)
      : session_(soci::sqlite3, connection),
        events_(OnlyReading(session_)),
        map_changes_(session_),
        decisions_(session_),
        desk_(session_) {}

  /// EventLog::Load. Throws as that does.
  std::vector<StoredEvent> OfHazard(const Uuid& hazard, std::uint64_t sequence, std::size_t limit) {
    const MutexLock lock(mutex_);
    return events_.Load(hazard, sequence, limit);
  }
  /// MapChangeTable::LoadEvents. Throws as that does.
  std::vector<StoredMapChangeEvent> OfMapChange(std::uint64_t sequence, std::size_t limit) {
    const MutexLock lock(mutex_);
    return map_changes_.LoadEvents(sequence, limit);
  }
  /// DecisionTable::LoadAllDecisions. Throws as that does.
  std::vector<DecisionRecord> OfOfficials(std::uint64_t before, std::size_t limit) {
    const MutexLock lock(mutex_);
    return decisions_.LoadAllDecisions(before, limit);
  }
  /// DecisionTable::LoadDecisions. Throws as that does.
  std::vector<DecisionRecord> OfSubject(const std::string& subject, std::size_t limit) {
    const MutexLock lock(mutex_);
    return decisions_.LoadDecisions(subject, limit);
  }
  /// DeskTable::LoadAssignments. Throws as that does.
  std::vector<Assignment> Assignments() {
    const MutexLock lock(mutex_);
    return desk_.LoadAssignments();
  }
  /// DeskTable::LoadSightings. Throws as that does.
  std::vector<SightingRecord> Sightings(std::uint64_t hazard_id, const Uuid& hazard,
                                        std::size_t limit) {
    const MutexLock lock(mutex_);
    return desk_.LoadSightings(hazard_id, hazard, limit);
  }

  /// EventLog::LoadTurnsAfter. Throws as that does.
  std::vector<StoredEvent> TurnsAfter(std::uint64_t sequence, std::size_t limit) {
    const MutexLock lock(mutex_);
    return events_.LoadTurnsAfter(sequence, limit);
  }
  /// DecisionTable::LoadDecisionsAfter. Throws as that does.
  std::vector<DecisionRecord> DecisionsAfter(std::uint64_t id, std::size_t limit) {
    const MutexLock lock(mutex_);
    return decisions_.LoadDecisionsAfter(id, limit);
  }

 private:
  static soci::session& OnlyReading(soci::session& session) {
    session << "PRAGMA query_only=ON";
    return session;
  }

  Mutex mutex_;
  soci::session session_;
  EventLog events_ GUARDED_BY(mutex_);
  MapChangeTable map_changes_ GUARDED_BY(mutex_);
  DecisionTable decisions_ GUARDED_BY(mutex_);
  DeskTable desk_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
