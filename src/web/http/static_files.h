#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/mutex.h"

namespace livemap::web {

/// Content of one file to be served.
struct StaticFile {
  std::shared_ptr<const std::vector<std::uint8_t>> content;  ///< One copy for all who are served.
  std::string content_type;
  std::string etag;  ///< Quoted, changes with the content.
};

/// The files under one folder. A name is accepted only when each of its segments is made of
/// letters, digits, '.', '_' and '-' and does not start with '.', so no name leaves the folder.
/// Links inside the folder are followed: who can write there decides what is served. A file is read
/// when it is asked for first and when its size or time of change has changed since. Thread-safe.
class StaticFiles {
 public:
  explicit StaticFiles(std::string root) : root_(std::move(root)) {}

  /// The file at `relative` ("map.js", "icons/cone.svg"); none when the name is not accepted, there
  /// is no such regular file, its type is not one that the page needs, or it exceeds 8 MiB.
  std::optional<StaticFile> Find(std::string_view relative) const;

 private:
  struct Kept {
    StaticFile file;
    std::uintmax_t bytes = 0;
    std::filesystem::file_time_type changed;
  };

  std::string root_;
  mutable Mutex mutex_;
  /// By path; as many as the folder has files of types that the page needs.
  mutable std::map<std::string, Kept> kept_ GUARDED_BY(mutex_);
};

}  // namespace livemap::web
