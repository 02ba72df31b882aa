#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"

namespace livemap::zone {

/// Pictures on disk, each in `<directory>/<first two hex digits>/<sha256>.<format>`, so that the
/// same picture is kept once. Thread-safe.
///
/// Pictures are written to temporary files, synchronised together and then renamed: a name always
/// has its whole content. Beyond the cap the oldest pictures go, those that no hazard refers to
/// first.
class ImageStore {
 public:
  /// Makes the directory when missing, takes stock of what is there, and removes what an
  /// interrupted write left. Throws StoreError when the directory cannot be used.
  ImageStore(std::string directory, std::uint64_t cap_bytes);

  /// Writes the picture and returns its SHA-256; it is there for others after Publish. `format` is
  /// the file's extension. Throws StoreError when it cannot be written.
  std::string Put(const std::vector<std::uint8_t>& bytes, const std::string& format);
  /// Brings what was put since the last call to disk, with one synchronisation for all of it, and
  /// under its names. Throws StoreError when that fails.
  void Publish();
  /// The file; none for what is not 64 lower-case hex digits, never stored or evicted.
  std::optional<std::string> Path(const std::string& sha256) const;

  /// A hazard shows this picture, or no longer does. Empty and unknown names are ignored.
  void Retain(const std::string& sha256);
  void Release(const std::string& sha256);
  /// Deletes pictures until the cap holds. Called between batches, when references are settled.
  void EvictBeyondCap();

  /// Deletes the picture, whoever refers to it. False where there is none.
  bool Remove(const std::string& sha256);
  /// Deletes the pictures that were stored before `before_ns`, by the system's clock, UTC ns since
  /// 1970, whoever refers to them: at most `limit`, the oldest first. How many those were.
  std::size_t RemoveOlder(std::int64_t before_ns, std::size_t limit);

  std::uint64_t total_bytes() const;

 private:
  struct Entry {
    std::string format;
    std::uint64_t bytes = 0;
    std::uint64_t age = 0;       ///< Rises with every stored picture.
    std::int64_t stored_ns = 0;  ///< When the file was written, system clock.
    std::uint32_t references = 0;
  };
  /// Written, but not yet under its name.
  struct Pending {
    std::string format;
    std::uint64_t bytes = 0;
  };
  /// Unreferenced pictures first, then by age.
  struct Rank {
    bool referenced;
    std::uint64_t age;
    std::string sha256;
    bool operator<(const Rank& other) const;
  };

  std::string FilePath(const std::string& sha256, const std::string& format) const;
  void TakeStock() REQUIRES(mutex_);
  void AddEntry(const std::string& sha256, const std::string& format, std::uint64_t bytes)
      REQUIRES(mutex_);
  void Drop(std::map<std::string, Entry>::iterator entry) REQUIRES(mutex_);
  void ChangeReferences(const std::string& sha256, bool retain);

  const std::string directory_;
  const std::uint64_t cap_bytes_;
  mutable Mutex mutex_;
  std::map<std::string, Entry> entries_ GUARDED_BY(mutex_);    ///< By SHA-256.
  std::map<std::string, Pending> pending_ GUARDED_BY(mutex_);  ///< By SHA-256.
  std::set<Rank> eviction_order_ GUARDED_BY(mutex_);
  /// By when it was stored.
  std::set<std::pair<std::int64_t, std::string>> by_time_ GUARDED_BY(mutex_);
  std::uint64_t total_bytes_ GUARDED_BY(mutex_) = 0;
  std::uint64_t next_age_ GUARDED_BY(mutex_) = 0;
};

}  // namespace livemap::zone
