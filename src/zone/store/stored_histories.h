#pragma once

// Part of ZoneStore; nobody else includes this.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/sqlite.h"
#include "zone/store/answer_picture_table.h"
#include "zone/store/decision_table.h"
#include "zone/store/desk_table.h"
#include "zone/store/event_log.h"
#include "zone/store/map_change_table.h"
#include "zone/store/queries.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {

/// Reads events over a connection of its own, beside the one that writes: thread-safe. Whoever asks
/// for histories without pause keeps no commit waiting.
class StoredHistories {
 public:
  /// Of a database whose schema is up to date. Throws as StoreConnection does.
  explicit StoredHistories(std::string database)
      : database_(std::move(database)), reader_(std::make_unique<Reader>(database_)) {}

  /// EventLog::Load. Throws as that does.
  std::vector<StoredEvent> OfHazard(const Uuid& hazard, std::uint64_t sequence, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.events.Load(hazard, sequence, limit); });
  }
  /// MapChangeTable::LoadEvents. Throws as that does.
  std::vector<StoredMapChangeEvent> OfMapChange(std::uint64_t sequence, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.map_changes.LoadEvents(sequence, limit); });
  }
  /// DecisionTable::LoadAllDecisions. Throws as that does.
  std::vector<DecisionRecord> OfOfficials(std::uint64_t before, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.decisions.LoadAllDecisions(before, limit); });
  }
  /// DecisionTable::LoadDecisions. Throws as that does.
  std::vector<DecisionRecord> OfSubject(const std::string& subject, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.decisions.LoadDecisions(subject, limit); });
  }
  /// DeskTable::LoadAssignments. Throws as that does.
  std::vector<Assignment> Assignments() {
    return Ask([&](Reader& reader) { return reader.desk.LoadAssignments(); });
  }
  /// DeskTable::LoadSightings. Throws as that does.
  std::vector<SightingRecord> Sightings(std::uint64_t hazard_id, const Uuid& hazard,
                                        std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.desk.LoadSightings(hazard_id, hazard, limit); });
  }

  /// AnswerPictureTable::LoadAnswerPictures. Throws as that does.
  std::vector<AnswerPicture> AnswerPictures(std::uint64_t hazard_id, std::size_t limit) {
    return Ask([&](Reader& reader) {
      return reader.answer_pictures.LoadAnswerPictures(hazard_id, limit);
    });
  }

  /// EventLog::LoadTurnsAfter. Throws as that does.
  std::vector<StoredEvent> TurnsAfter(std::uint64_t sequence, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.events.LoadTurnsAfter(sequence, limit); });
  }
  /// DecisionTable::LoadDecisionsAfter. Throws as that does.
  std::vector<DecisionRecord> DecisionsAfter(std::uint64_t id, std::size_t limit) {
    return Ask([&](Reader& reader) { return reader.decisions.LoadDecisionsAfter(id, limit); });
  }

 private:
  struct Reader {
    explicit Reader(const std::string& database)
        : connection(database, StoreConnection::Use::kRead),
          events(connection),
          map_changes(connection),
          decisions(connection),
          desk(connection),
          answer_pictures(connection) {}

    StoreConnection connection;
    EventLog events;
    MapChangeTable map_changes;
    DecisionTable decisions;
    DeskTable desk;
    AnswerPictureTable answer_pictures;
  };

  /// Once more over a new connection where the old one has broken.
  template <typename Body>
  auto Ask(const Body& body) -> decltype(body(std::declval<Reader&>())) {
    const MutexLock lock(mutex_);
    if (reader_ && !reader_->connection.IsLost()) {
      try {
        return body(*reader_);
      } catch (const StoreError&) {
        if (!reader_->connection.IsLost()) throw;
      }
    }
    reader_ = nullptr;
    reader_ = ExplainStore("connecting again", [&] { return std::make_unique<Reader>(database_); });
    return body(*reader_);
  }

  Mutex mutex_;
  const std::string database_;
  std::unique_ptr<Reader> reader_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
