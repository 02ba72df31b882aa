#include "zone/pictures/image_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <tuple>

#include "common/sha256.h"
#include "common/sqlite.h"

namespace livemap::zone {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporarySuffix[] = ".tmp";

bool IsStoredImageName(const std::string& text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

/// Writes a whole file. Returns errno's value, 0 for success.
int WriteStoredImage(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return errno;
  int error = 0;
  std::size_t written = 0;
  while (error == 0 && written < bytes.size()) {
    const ssize_t count = write(file, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno != EINTR) error = errno;
    if (count > 0) written += static_cast<std::size_t>(count);
  }
  if (close(file) != 0 && error == 0) error = errno;
  return error;
}

/// When the file was written, system clock, UTC ns since 1970; 0 where there is none.
std::int64_t StoredNs(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return 0;
  return static_cast<std::int64_t>(status.st_mtim.tv_sec) * 1'000'000'000 + status.st_mtim.tv_nsec;
}

/// Brings everything written to the directory's file system to disk. Returns errno's value.
int SynchroniseImageStore(const std::string& directory) {
  const int file = open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return errno;
  const int error = syncfs(file) == 0 ? 0 : errno;
  close(file);
  return error;
}

}  // namespace

bool ImageStore::Rank::operator<(const Rank& other) const {
  return std::tie(referenced, age, sha256) < std::tie(other.referenced, other.age, other.sha256);
}

ImageStore::ImageStore(std::string directory, std::uint64_t cap_bytes)
    : directory_(std::move(directory)), cap_bytes_(cap_bytes) {
  try {
    fs::create_directories(directory_);
    const MutexLock lock(mutex_);
    TakeStock();
  } catch (const fs::filesystem_error& error) {
    throw StoreError("store: picture directory '" + directory_ +
                     "' cannot be used: " + error.code().message());
  }
  EvictBeyondCap();
}

void ImageStore::TakeStock() {
  std::vector<std::tuple<fs::file_time_type, std::string, std::string, std::uint64_t>> found;
  for (const auto& item : fs::recursive_directory_iterator(directory_)) {
    if (!item.is_regular_file()) continue;
    const fs::path& path = item.path();
    if (path.extension() == kTemporarySuffix) {
      fs::remove(path);
      continue;
    }
    const std::string name = path.stem().string();
    const std::string extension = path.extension().string();
    if (!IsStoredImageName(name) || extension.size() < 2) continue;
    found.emplace_back(item.last_write_time(), name, extension.substr(1), item.file_size());
  }
  std::sort(found.begin(), found.end());
  for (const auto& [time, name, format, bytes] : found) AddEntry(name, format, bytes);
}

void ImageStore::AddEntry(const std::string& sha256, const std::string& format,
                          std::uint64_t bytes) {
  const std::int64_t stored_ns = StoredNs(FilePath(sha256, format));
  const bool is_new =
      entries_.emplace(sha256, Entry{format, bytes, next_age_, stored_ns, 0}).second;
  if (!is_new) return;
  by_time_.emplace(stored_ns, sha256);
  eviction_order_.insert({false, next_age_++, sha256});
  total_bytes_ += bytes;
}

std::string ImageStore::FilePath(const std::string& sha256, const std::string& format) const {
  return directory_ + "/" + sha256.substr(0, 2) + "/" + sha256 + "." + format;
}

std::string ImageStore::Put(const std::vector<std::uint8_t>& bytes, const std::string& format) {
  std::string sha256 = Sha256Hex(bytes.data(), bytes.size());
  const MutexLock lock(mutex_);
  if (entries_.count(sha256) != 0 || pending_.count(sha256) != 0) return sha256;
  const std::string path = FilePath(sha256, format);
  const std::string temporary = path + kTemporarySuffix;
  std::error_code ignored;
  fs::create_directory(directory_ + "/" + sha256.substr(0, 2), ignored);
  const int error = WriteStoredImage(temporary, bytes);
  if (error != 0) {
    fs::remove(temporary, ignored);
    throw StoreError("store: picture '" + path + "' cannot be written: " + std::strerror(error));
  }
  pending_[sha256] = {format, bytes.size()};
  return sha256;
}

void ImageStore::Publish() {
  std::map<std::string, Pending> pending;
  {
    const MutexLock lock(mutex_);
    pending.swap(pending_);
  }
  if (pending.empty()) return;
  // Without the lock: those who look for pictures need not wait for the disk.
  int error = SynchroniseImageStore(directory_);
  const MutexLock lock(mutex_);
  for (const auto& [sha256, picture] : pending) {
    const std::string path = FilePath(sha256, picture.format);
    const std::string temporary = path + kTemporarySuffix;
    if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
    if (error == 0) {
      AddEntry(sha256, picture.format, picture.bytes);
    } else {
      std::error_code ignored;
      fs::remove(temporary, ignored);
    }
  }
  if (error != 0) {
    throw StoreError("store: pictures in '" + directory_ +
                     "' cannot be written: " + std::strerror(error));
  }
}

std::optional<std::string> ImageStore::Path(const std::string& sha256) const {
  if (!IsStoredImageName(sha256)) return std::nullopt;
  const MutexLock lock(mutex_);
  const auto found = entries_.find(sha256);
  if (found == entries_.end()) return std::nullopt;
  return FilePath(sha256, found->second.format);
}

void ImageStore::ChangeReferences(const std::string& sha256, bool retain) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(sha256);
  if (found == entries_.end()) return;
  Entry& entry = found->second;
  if (!retain && entry.references == 0) return;
  eviction_order_.erase({entry.references > 0, entry.age, sha256});
  entry.references = retain ? entry.references + 1 : entry.references - 1;
  eviction_order_.insert({entry.references > 0, entry.age, sha256});
}

void ImageStore::Retain(const std::string& sha256) { ChangeReferences(sha256, true); }

void ImageStore::Release(const std::string& sha256) { ChangeReferences(sha256, false); }

void ImageStore::EvictBeyondCap() {
  const MutexLock lock(mutex_);
  while (total_bytes_ > cap_bytes_ && !eviction_order_.empty()) {
    Drop(entries_.find(eviction_order_.begin()->sha256));
  }
}

void ImageStore::Drop(std::map<std::string, Entry>::iterator entry) {
  const auto& [sha256, picture] = *entry;
  std::error_code ignored;
  fs::remove(FilePath(sha256, picture.format), ignored);
  eviction_order_.erase({picture.references > 0, picture.age, sha256});
  by_time_.erase({picture.stored_ns, sha256});
  total_bytes_ -= picture.bytes;
  entries_.erase(entry);
}

bool ImageStore::Remove(const std::string& sha256) {
  const MutexLock lock(mutex_);
  const auto entry = entries_.find(sha256);
  if (entry == entries_.end()) return false;
  Drop(entry);
  return true;
}

std::size_t ImageStore::RemoveOlder(std::int64_t before_ns, std::size_t limit) {
  const MutexLock lock(mutex_);
  std::size_t removed = 0;
  while (removed < limit && !by_time_.empty() && by_time_.begin()->first < before_ns) {
    Drop(entries_.find(by_time_.begin()->second));
    ++removed;
  }
  return removed;
}

std::uint64_t ImageStore::total_bytes() const {
  const MutexLock lock(mutex_);
  return total_bytes_;
}

}  // namespace livemap::zone
