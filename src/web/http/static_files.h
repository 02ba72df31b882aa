#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace livemap::web {

/// Content of one file to be served.
struct StaticFile {
  std::string content;
  std::string content_type;
  std::string etag;  ///< Quoted, changes with the content.
};

/// The files under one folder. A name is accepted only when each of its segments is made of
/// letters, digits, '.', '_' and '-' and does not start with '.', so no name leaves the folder.
/// Links inside the folder are followed: who can write there decides what is served.
class StaticFiles {
 public:
  explicit StaticFiles(std::string root) : root_(std::move(root)) {}

  /// The file at `relative` ("map.js", "icons/cone.svg"); none when the name is not accepted, there
  /// is no such regular file, its type is not one that the page needs, or it exceeds 8 MiB.
  std::optional<StaticFile> Find(std::string_view relative) const;

 private:
  std::string root_;
};

}  // namespace livemap::web
