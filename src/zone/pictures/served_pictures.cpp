#include "zone/pictures/served_pictures.h"

#include "common/error.h"

namespace livemap::zone {
namespace {

// What an entry costs besides its picture; it also bounds the refused ones.
constexpr std::size_t kEntryBytes = 256;

std::size_t CostOf(const ServedPictures::File& file) {
  return kEntryBytes + (file ? file->size() : 0);
}

/// None when it is not accepted.
ServedPictures::File Recoded(const std::string& content, const PictureLimits& limits) {
  try {
    return std::make_shared<const std::vector<std::uint8_t>>(
        RecodePicture({content.begin(), content.end()}, limits));
  } catch (const Error&) {
    return nullptr;
  }
}

}  // namespace

ServedPictures::File ServedPictures::Get(const std::string& sha256, const std::string& path) {
  File file;
  if (Find(sha256, file)) return file;
  const std::lock_guard<std::mutex> lock(encoding_);
  if (Find(sha256, file)) return file;  // Somebody else asked for it at the same time.
  std::string content;
  try {
    content = ReadFile(path, limits_.max_bytes);
  } catch (const Error&) {
    return nullptr;  // Evicted in between; it may come back.
  }
  file = Recoded(content, limits_);
  Keep(sha256, file);
  return file;
}

bool ServedPictures::Find(const std::string& sha256, File& file) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = entries_.find(sha256);
  if (found == entries_.end()) return false;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  file = found->second.file;
  return true;
}

void ServedPictures::Keep(const std::string& sha256, const File& file) {
  const std::lock_guard<std::mutex> lock(mutex_);
  uses_.push_front(sha256);
  entries_[sha256] = {file, uses_.begin()};
  total_bytes_ += CostOf(file);
  while (total_bytes_ > max_bytes_ && uses_.size() > 1) {
    const auto oldest = entries_.find(uses_.back());
    total_bytes_ -= CostOf(oldest->second.file);
    entries_.erase(oldest);
    uses_.pop_back();
  }
}

std::size_t ServedPictures::total_bytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return total_bytes_;
}

}  // namespace livemap::zone
