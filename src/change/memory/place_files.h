#pragma once

#include <string>
#include <vector>

namespace livemap::change {

/// Files under the hash of their content, `<directory>/frames/<first two digits>/<sha256>.jpg`, in
/// a directory that one process has for itself while this object lives. A name always has its whole
/// content, whenever the process is killed. Not thread-safe.
class PlaceFiles {
 public:
  /// Makes the directory when missing and removes what an interrupted write left. Throws StoreError
  /// when it cannot be used or another process uses it.
  explicit PlaceFiles(std::string directory);
  ~PlaceFiles();
  PlaceFiles(const PlaceFiles&) = delete;
  PlaceFiles& operator=(const PlaceFiles&) = delete;

  /// Writes the file and returns its name, 64 hex digits; it survives the power's loss when this
  /// returns. Throws StoreError when it cannot be written.
  std::string Put(const std::string& bytes);
  /// The content. Throws Error when it is missing, too large or not what the name says.
  std::string Read(const std::string& sha256) const;
  /// Missing files are no mistake.
  void Remove(const std::string& sha256);
  /// Moves a file to `<directory>/set_aside`.
  void SetAside(const std::string& sha256);
  /// All names, sorted.
  std::vector<std::string> List() const;
  /// Where the file is or would be.
  std::string Path(const std::string& sha256) const;

 private:
  std::string directory_;
  int lock_file_ = -1;
};

}  // namespace livemap::change
