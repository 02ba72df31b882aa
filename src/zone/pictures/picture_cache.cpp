#include "zone/pictures/picture_cache.h"

#include "common/error.h"

namespace livemap::zone {
namespace {

// What an entry costs besides its picture; it also bounds the refused ones.
constexpr std::size_t kEntryBytes = 256;

std::size_t PictureCacheCostOf(const PictureCache::File& file) {
  return kEntryBytes + (file ? file->size() : 0);
}

}  // namespace

PictureCache::File PictureCache::Get(const std::string& sha256, const std::string& path) {
  if (const auto kept = Find(sha256)) return *kept;
  const MutexLock lock(decoding_);
  // Another thread may have asked for it at the same time.
  if (const auto kept = Find(sha256)) return *kept;
  std::string content;
  try {
    content = ReadFile(path, config_.max_file_bytes);
  } catch (const Error&) {
    return nullptr;  // Evicted in between; it may come back.
  }
  File file;
  std::string refusal;
  try {
    file = std::make_shared<const std::vector<std::uint8_t>>(
        recode_({content.begin(), content.end()}));
  } catch (const Error& error) {  // Not accepted: the null pointer is kept.
    refusal = error.what();
  }
  Keep(sha256, file, refusal);
  return file;
}

std::optional<PictureCache::File> PictureCache::Find(const std::string& sha256) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(sha256);
  if (found == entries_.end()) return std::nullopt;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  return found->second.file;
}

void PictureCache::Keep(const std::string& sha256, const File& file, const std::string& refusal) {
  const MutexLock lock(mutex_);
  if (!file) {
    ++refused_;
    last_refusal_ = refusal;
  }
  uses_.push_front(sha256);
  entries_[sha256] = {file, uses_.begin()};
  total_bytes_ += PictureCacheCostOf(file);
  while (total_bytes_ > config_.max_bytes && uses_.size() > 1) {
    const auto oldest = entries_.find(uses_.back());
    total_bytes_ -= PictureCacheCostOf(oldest->second.file);
    entries_.erase(oldest);
    uses_.pop_back();
  }
}

std::size_t PictureCache::total_bytes() const {
  const MutexLock lock(mutex_);
  return total_bytes_;
}

std::uint64_t PictureCache::refused() const {
  const MutexLock lock(mutex_);
  return refused_;
}

std::string PictureCache::last_refusal() const {
  const MutexLock lock(mutex_);
  return last_refusal_;
}

}  // namespace livemap::zone
