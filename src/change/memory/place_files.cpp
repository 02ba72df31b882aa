#include "change/memory/place_files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "change/memory/place_record.h"
#include "common/sha256.h"
#include "common/sqlite.h"

namespace livemap::change {
namespace {

namespace fs = std::filesystem;

constexpr char kSuffix[] = ".jpg";
constexpr char kUnfinished[] = ".tmp";

bool IsPlaceFileName(const std::string& text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

[[noreturn]] void FailForPlaceFile(const std::string& path, const char* what, int error) {
  throw StoreError("place memory: '" + path + "' cannot be " + what + ": " + std::strerror(error));
}

/// Brings a file or a directory's entries to disk.
void SynchronisePlaceFile(const std::string& path, int flags) {
  const int file = open(path.c_str(), flags | O_CLOEXEC);
  if (file < 0) FailForPlaceFile(path, "opened", errno);
  const int error = fsync(file) == 0 ? 0 : errno;
  close(file);
  if (error != 0) FailForPlaceFile(path, "brought to disk", error);
}

void WriteWholePlaceFile(const std::string& path, const std::string& bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) FailForPlaceFile(path, "written", errno);
  int error = 0;
  std::size_t written = 0;
  while (error == 0 && written < bytes.size()) {
    const ssize_t count = write(file, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno != EINTR) error = errno;
    if (count > 0) written += static_cast<std::size_t>(count);
  }
  if (error == 0 && fsync(file) != 0) error = errno;
  if (close(file) != 0 && error == 0) error = errno;
  if (error == 0) return;
  unlink(path.c_str());
  FailForPlaceFile(path, "written", error);
}

/// Calls `visit` with every file below the frames' folder.
template <typename Visit>
void ForEachPlaceFile(const std::string& frames, const Visit& visit) {
  try {
    for (const auto& item : fs::recursive_directory_iterator(frames)) {
      if (item.is_regular_file()) visit(item.path());
    }
  } catch (const fs::filesystem_error& error) {
    throw StoreError("place memory: directory '" + frames +
                     "' cannot be read: " + error.code().message());
  }
}

}  // namespace

PlaceFiles::PlaceFiles(std::string directory) : directory_(std::move(directory)) {
  if (directory_.empty()) {
    throw Error("place memory's directory is empty, accepted is the path of a directory");
  }
  std::error_code error;
  fs::create_directories(directory_ + "/frames", error);
  if (error) {
    throw StoreError("place memory: directory '" + directory_ +
                     "' cannot be made: " + error.message());
  }
  const std::string lock_path = directory_ + "/places.lock";
  lock_file_ = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_file_ < 0) FailForPlaceFile(lock_path, "opened", errno);
  if (flock(lock_file_, LOCK_EX | LOCK_NB) != 0) {
    close(lock_file_);
    throw StoreError("place memory: directory '" + directory_ + "' is in use by another process");
  }
  try {
    ForEachPlaceFile(directory_ + "/frames", [](const fs::path& path) {
      std::error_code ignored;
      if (path.extension() == kUnfinished) fs::remove(path, ignored);
    });
  } catch (...) {
    close(lock_file_);
    throw;
  }
}

PlaceFiles::~PlaceFiles() { close(lock_file_); }

std::string PlaceFiles::Path(const std::string& sha256) const {
  return directory_ + "/frames/" + sha256.substr(0, 2) + "/" + sha256 + kSuffix;
}

std::string PlaceFiles::Put(const std::string& bytes) {
  std::string sha256 = Sha256Hex(bytes);
  const std::string path = Path(sha256);
  const std::string folder = fs::path(path).parent_path().string();
  std::error_code error;
  if (fs::create_directory(folder, error))
    SynchronisePlaceFile(directory_ + "/frames", O_DIRECTORY);
  const std::string unfinished = path + kUnfinished;
  WriteWholePlaceFile(unfinished, bytes);
  if (std::rename(unfinished.c_str(), path.c_str()) != 0) {
    const int reason = errno;
    unlink(unfinished.c_str());
    FailForPlaceFile(path, "written", reason);
  }
  SynchronisePlaceFile(folder, O_DIRECTORY);
  return sha256;
}

std::string PlaceFiles::Read(const std::string& sha256) const {
  const std::string path = Path(sha256);
  std::string bytes = ReadFile(path, kMaxRecordBytes);
  if (Sha256Hex(bytes) != sha256) {
    throw Error("'" + path + "' is corrupt: its content is not what its name says");
  }
  return bytes;
}

void PlaceFiles::Remove(const std::string& sha256) {
  std::error_code ignored;
  fs::remove(Path(sha256), ignored);
}

void PlaceFiles::SetAside(const std::string& sha256) {
  std::error_code ignored;
  fs::create_directory(directory_ + "/set_aside", ignored);
  fs::rename(Path(sha256), directory_ + "/set_aside/" + sha256 + kSuffix, ignored);
}

std::vector<std::string> PlaceFiles::List() const {
  std::vector<std::string> names;
  ForEachPlaceFile(directory_ + "/frames", [&](const fs::path& path) {
    const std::string name = path.stem().string();
    // What lies elsewhere is not ours.
    if (IsPlaceFileName(name) && path == Path(name)) names.push_back(name);
  });
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace livemap::change
