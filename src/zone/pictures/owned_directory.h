#pragma once

#include <string>

#include "common/sqlite.h"

namespace livemap::zone {

/// Another process has the directory for itself.
class DirectoryInUse : public StoreError {
 public:
  using StoreError::StoreError;
};

/// A directory that one process has for itself while this object lives: a second zone on the same
/// store would give out the same sequence numbers. The kernel frees it when the process dies.
class OwnedDirectory {
 public:
  /// Makes the directory when missing. Throws DirectoryInUse when it is taken, and StoreError when
  /// it cannot be used.
  explicit OwnedDirectory(const std::string& path);
  ~OwnedDirectory();
  OwnedDirectory(const OwnedDirectory&) = delete;
  OwnedDirectory& operator=(const OwnedDirectory&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int lock_file_ = -1;
};

}  // namespace livemap::zone
