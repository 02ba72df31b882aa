#include "zone/pictures/owned_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace livemap::zone {

OwnedDirectory::OwnedDirectory(const std::string& path) : path_(path) {
  if (path.empty()) throw Error("zone directory is empty, accepted is the path of a directory");
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) {
    throw StoreError("store: directory '" + path + "' cannot be made: " + error.message());
  }
  const std::string lock_path = path + "/zone.lock";
  lock_file_ = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_file_ < 0) {
    throw StoreError("store: '" + lock_path + "' cannot be opened: " + std::strerror(errno));
  }
  if (flock(lock_file_, LOCK_EX | LOCK_NB) != 0) {
    close(lock_file_);
    throw DirectoryInUse("store: directory '" + path + "' is in use by another zone");
  }
}

OwnedDirectory::~OwnedDirectory() { close(lock_file_); }

}  // namespace livemap::zone
