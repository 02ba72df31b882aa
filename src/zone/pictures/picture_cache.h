#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/mutex.h"

namespace livemap::zone {

/// Pictures of vehicles as one kind of reader sees them: each is encoded anew when it is first
/// asked for, then kept in memory up to a bound; the pictures not asked for longest go first. Each
/// purpose (the map, drivers' notices) has a cache of its own. Thread-safe.
///
/// Encoding happens here and not where reports are committed because it costs milliseconds and a
/// commit has microseconds for each report, and because few of the pictures are ever looked at.
/// One picture is decoded at a time, so that hostile ones cannot multiply their memory, and only
/// once however many ask for it. A kept picture never waits for a decode.
///
/// Typical usage:
///   PictureCache pictures([](const auto& file) { return RecodePicture(file); }, config);
///   if (const PictureCache::File jpeg = pictures.Get(sha256, path)) Serve(*jpeg);
class PictureCache {
 public:
  using File = std::shared_ptr<const std::vector<std::uint8_t>>;
  /// Makes the picture to be served from a vehicle's file. Throws Error when the file is not
  /// accepted.
  using Recode = std::function<std::vector<std::uint8_t>(const std::vector<std::uint8_t>& file)>;

  struct Config {
    std::size_t max_file_bytes = 16 << 20;  ///< Of a vehicle's file; larger ones are not read.
    std::size_t max_bytes = 64 << 20;       ///< Of the encoded pictures that are kept.
  };

  PictureCache(Recode recode, const Config& config) : recode_(std::move(recode)), config_(config) {}

  /// Returns the picture of this content hash, stored at `path`; null when the file cannot be read
  /// or is not accepted. The latter is remembered. Takes milliseconds when the picture is not kept.
  File Get(const std::string& sha256, const std::string& path);
  /// Returns the picture if Get needs no file and no decoding for it; null inside for one that is
  /// known not to be accepted.
  std::optional<File> Find(const std::string& sha256);

  /// Bytes of the pictures that are kept now, with what the entries themselves take.
  std::size_t total_bytes() const;
  /// How often a file was not accepted since the start.
  std::uint64_t refused() const;
  /// Why the last of them was not accepted, in one sentence; empty when none was.
  std::string last_refusal() const;

 private:
  struct Entry {
    File file;  ///< Null: not accepted.
    std::list<std::string>::iterator use;
  };

  void Keep(const std::string& sha256, const File& file, const std::string& refusal);

  const Recode recode_;
  const Config config_;
  Mutex decoding_ ACQUIRED_BEFORE(mutex_);  ///< Held while a picture is decoded.
  mutable Mutex mutex_;
  std::unordered_map<std::string, Entry> entries_ GUARDED_BY(mutex_);
  /// Content hashes, the one asked for last in front.
  std::list<std::string> uses_ GUARDED_BY(mutex_);
  std::size_t total_bytes_ GUARDED_BY(mutex_) = 0;
  std::uint64_t refused_ GUARDED_BY(mutex_) = 0;
  std::string last_refusal_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
