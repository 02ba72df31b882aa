#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "common/mutex.h"
#include "zone/model/erasure.h"

namespace livemap {
class SqliteDatabase;
}

namespace livemap::zone {

/// The vehicles that a zone is asked to forget, in a SQLite file beside its store that `livemap
/// zone forget` writes and the running zone reads. A request names its vehicle until it is done;
/// then the name leaves the file. Thread-safe. Everything throws StoreError when the file cannot be
/// read or written.
///
/// Typical usage:
///   ErasureRequests requests(ErasureRequests::PathIn("/var/lib/livemap/zone"));
///   if (const auto request = requests.Next()) ...
class ErasureRequests {
 public:
  struct Request {
    std::int64_t id = 0;
    std::string vehicle_id;
    std::string secret;  ///< Of the pseudonyms: random, 64 hexadecimal digits.
    std::string by;      ///< Who asked.
  };
  /// What became of one.
  struct Outcome {
    ErasureCounts counts;
    std::string refusal;  ///< Why nothing was done; empty when it was.
  };

  static std::string PathIn(const std::string& directory) { return directory + "/erasures.sqlite"; }

  /// Opens the file, or makes one that only its owner may read.
  explicit ErasureRequests(const std::string& path);
  ~ErasureRequests();
  ErasureRequests(const ErasureRequests&) = delete;
  ErasureRequests& operator=(const ErasureRequests&) = delete;

  /// Its id. Throws Error for a vehicle's name, or one of who asks, that none can have.
  std::int64_t Add(const std::string& vehicle_id, const std::string& by, std::int64_t now_ns);
  /// The oldest one that is not done; none when all are.
  std::optional<Request> Next() const;
  void Finish(std::int64_t id, const Outcome& outcome, std::int64_t now_ns);
  /// None while the request is not done.
  std::optional<Outcome> Find(std::int64_t id) const;

 private:
  mutable Mutex mutex_;
  const std::unique_ptr<SqliteDatabase> database_ PT_GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
