#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "change/memory/place_files.h"
#include "change/memory/place_index.h"
#include "change/memory/place_record.h"
#include "common/sqlite.h"

namespace livemap::change {

/// Remembers pictures of earlier drives by where they were taken, and finds the one that shows the
/// present place best (thesis 4.3).
///
/// Every frame is one file with all that is known about it; `places.sqlite3` is a durable index of
/// them, which can be built again from the files. No row is without its file and no file without a
/// row once a memory is open, whenever its process was killed. Not thread-safe.
class PlaceMemory {
 public:
  struct Config {
    std::string directory;  ///< Made when missing.
    /// The map's cells: squares of about this edge, metres, 2 to 1000, times so many sectors of
    /// heading, 1 to 64.
    double cell_m = 20;
    int heading_sectors = 8;
    /// Bytes of frames per cell. Beyond it frames go, those with the least `quality * 0.5 ^ (age /
    /// half_life_days)` first; age counts from the cell's newest frame, which always stays.
    double max_cell_bytes = 3e6;
    double half_life_days = 60;
    /// Bytes of frames altogether; beyond it the oldest go, wherever they are.
    double max_bytes = 20e9;
    PlaceReach reach;                ///< Of Nearest.
    double match_ratio = 0.8;        ///< Of Rank's ratio test.
    double max_cached_bytes = 64e6;  ///< Of features kept in memory.
  };

  /// What opening had to mend.
  struct Recovery {
    std::string set_aside;         ///< Where a corrupt index was moved; else empty.
    std::size_t rebuilt = 0;       ///< Frames read back from their files.
    std::size_t unreadable = 0;    ///< Files that are no sound frames, moved to set_aside/.
    std::size_t lost_files = 0;    ///< Rows dropped because their file is missing.
    std::size_t orphan_files = 0;  ///< Files removed because they had no row: a kill while adding.
  };

  struct Ranked {
    PlaceMatch candidate;
    std::size_t matches = 0;  ///< Of SIFT features.
  };

  /// Opens or creates the memory. A corrupt index is renamed to `places.sqlite3.corrupt-<now_ns>`
  /// and built again from the files; so is a missing one. Throws Error for a Config value that is
  /// not accepted, StoreError when the directory cannot be used.
  PlaceMemory(const Config& config, std::int64_t now_ns);

  const Recovery& recovery() const { return recovery_; }
  std::size_t size() const { return entries_.size(); }
  double bytes() const { return bytes_; }
  /// Frames whose file turned out to be damaged after opening; they are set aside.
  std::size_t damaged() const { return damaged_; }
  double cached_bytes() const { return cached_bytes_; }

  /// Remembers a frame durably, and forgets what its cell or the whole has no room for. Returns its
  /// id; none when it was itself the one to go. The same frame again is the same id. Throws Error
  /// for a frame that is not as PlaceRecord wants it or larger than a cell may hold; StoreError
  /// when the store fails, then nothing has changed.
  std::optional<std::int64_t> Add(const PlaceRecord& record);

  /// See PlaceIndex.
  std::vector<PlaceMatch> Nearest(const PlaceQuery& query) const { return index_.Nearest(query); }

  /// The candidates by how many of their features match `features`, most first; reads the features
  /// of those that are not cached. What cannot be read is left out and set aside.
  std::vector<Ranked> Rank(const ImageFeatures& features,
                           const std::vector<PlaceMatch>& candidates);

  /// The whole frame; none when it is gone or was just found damaged (then it is set aside).
  std::optional<PlaceRecord> Load(std::int64_t id);

 private:
  struct Entry {
    std::uint32_t bytes = 0;
    std::string sha256;
  };
  struct Cached {
    std::int64_t id;
    std::shared_ptr<const ImageFeatures> features;
  };

  std::string IndexPath() const { return config_.directory + "/places.sqlite3"; }
  void Open();
  void Rebuild();
  void LoadIndex();
  void Reconcile();
  std::int64_t CellOf(const PlaceFrame& frame) const;
  std::int64_t InsertRow(const PlaceRecord& record, const std::string& sha256, std::size_t bytes);
  std::vector<std::int64_t> CellVictims(std::int64_t cell);
  std::vector<std::int64_t> OverallVictims(double excess_bytes, std::int64_t added);
  void DeleteRows(const std::vector<std::int64_t>& ids);
  void Show(std::int64_t id, const PlaceFrame& frame, const std::string& sha256, std::size_t bytes);
  void Hide(std::int64_t id);
  void DropDamaged(std::int64_t id);
  std::shared_ptr<const ImageFeatures> Features(std::int64_t id);
  void Cache(std::int64_t id, std::shared_ptr<const ImageFeatures> features);
  void Uncache(std::int64_t id);

  Config config_;
  PlaceFiles files_;
  std::unique_ptr<SqliteDatabase> database_;
  Recovery recovery_;
  PlaceIndex index_;
  std::unordered_map<std::int64_t, Entry> entries_;
  double bytes_ = 0;
  std::size_t damaged_ = 0;
  std::list<Cached> cache_;  ///< The most recently used first.
  std::unordered_map<std::int64_t, std::list<Cached>::iterator> cached_;
  double cached_bytes_ = 0;
};

}  // namespace livemap::change
