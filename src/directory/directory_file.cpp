#include "directory/directory_file.h"

#include <system_error>
#include <utility>

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

std::shared_ptr<const ZoneDirectory> DirectoryFile::directory() const {
  return keeper_ ? keeper_->directory() : nullptr;
}

}  // namespace livemap::directory
