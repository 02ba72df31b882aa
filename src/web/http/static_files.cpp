#include "web/http/static_files.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include "common/error.h"
#include "common/sha256.h"

namespace livemap::web {
namespace {

constexpr std::size_t kMaxFileBytes = 8 << 20;

bool IsNameCharacter(char c) {
  return ('a' <= c && c <= 'z') || ('A' <= c && c <= 'Z') || ('0' <= c && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

bool IsSafeRelativePath(std::string_view path) {
  for (;;) {
    const std::size_t end = path.find('/');
    const std::string_view segment = path.substr(0, end);
    if (segment.empty() || segment.front() == '.') return false;
    if (!std::all_of(segment.begin(), segment.end(), IsNameCharacter)) return false;
    if (end == std::string_view::npos) return true;
    path.remove_prefix(end + 1);
  }
}

std::optional<std::string> TypeByExtension(const std::filesystem::path& path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".map", "application/json"},
      {".webmanifest", "application/manifest+json"},
  }};
  const std::string extension = path.extension().string();
  for (const auto& [known, type] : kTypes) {
    if (extension == known) return std::string(type);
  }
  return std::nullopt;
}

}  // namespace

std::optional<StaticFile> StaticFiles::Find(std::string_view relative) const {
  if (root_.empty() || !IsSafeRelativePath(relative)) return std::nullopt;
  const std::filesystem::path path = std::filesystem::path(root_) / relative;
  const auto type = TypeByExtension(path);
  std::error_code failure;
  if (!type || !std::filesystem::is_regular_file(path, failure)) return std::nullopt;
  Kept now;
  now.bytes = std::filesystem::file_size(path, failure);
  if (failure) return std::nullopt;
  now.changed = std::filesystem::last_write_time(path, failure);
  if (failure) return std::nullopt;
  const MutexLock lock(mutex_);
  const auto known = kept_.find(path.string());
  if (known != kept_.end() && known->second.bytes == now.bytes &&
      known->second.changed == now.changed) {
    return known->second.file;
  }
  try {
    const std::string content = ReadFile(path.string(), kMaxFileBytes);
    now.file.content =
        std::make_shared<const std::vector<std::uint8_t>>(content.begin(), content.end());
    now.file.content_type = *type;
    now.file.etag = '"' + Sha256Hex(content).substr(0, 32) + '"';
    kept_[path.string()] = now;
    return now.file;
  } catch (const Error&) {
    return std::nullopt;  // Vanished between the two looks, unreadable, or too large.
  }
}

}  // namespace livemap::web
