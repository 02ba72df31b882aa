#include "directory/directory_file.h"

#include <system_error>
#include <utility>

#include "common/text_file.h"

namespace livemap::directory {

DirectoryFile::DirectoryFile(TrustedAuthority authority, std::string path,
                             DirectoryKeeper::Clock now_ns)
    : authority_(std::move(authority)), path_(std::move(path)), now_ns_(std::move(now_ns)) {}

bool DirectoryFile::ReadIfChanged() {
  std::error_code missing;
  const auto time = std::filesystem::last_write_time(path_, missing);
  if (missing || (has_read_ && time == read_time_)) return false;
  read_time_ = time;
  has_read_ = true;
  auto next = std::make_unique<DirectoryKeeper>(authority_, path_, now_ns_);
  damage_ = next->damage();
  const auto before = directory();
  const auto after = next->directory();
  if (!before || (after && after->version() >= before->version())) keeper_ = std::move(next);
  return true;
}

std::optional<std::string> DirectoryFile::Offer(const std::string& bytes) {
  ReadIfChanged();
  if (!keeper_) keeper_ = std::make_unique<DirectoryKeeper>(authority_, path_, now_ns_);
  if (auto reason = keeper_->Offer(bytes)) return reason;
  std::error_code unreadable;
  if (!damage_.empty() || !std::filesystem::exists(path_, unreadable)) {
    ReplaceTextFile(path_, keeper_->bytes());
    damage_.clear();
  }
  const auto time = std::filesystem::last_write_time(path_, unreadable);
  has_read_ = !unreadable;
  if (has_read_) read_time_ = time;
  return std::nullopt;
}

const std::string& DirectoryFile::bytes() const {
  static const std::string kNone;
  return keeper_ ? keeper_->bytes() : kNone;
}

std::shared_ptr<const ZoneDirectory> DirectoryFile::directory() const {
  return keeper_ ? keeper_->directory() : nullptr;
}

}  // namespace livemap::directory
