#include "directory/directory_keeper.h"

#include <filesystem>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "common/time.h"
#include "common/utc_text.h"

namespace livemap::directory {

DirectoryKeeper::DirectoryKeeper(TrustedAuthority authority, std::string path, Clock now_ns)
    : authority_(std::move(authority)), path_(std::move(path)), now_ns_(std::move(now_ns)) {
  std::error_code unreadable;
  if (!std::filesystem::exists(path_, unreadable) && !unreadable) return;
  try {
    std::string bytes = ReadFile(path_, kMaxBytes);
    // It was in time when it was accepted. Though its signature be too old by now, nothing older
    // than it may be accepted.
    kept_ = Open(bytes, std::nullopt, path_);
    bytes_ = std::move(bytes);
  } catch (const Error& error) {
    damage_ = error.what();
  }
}

std::shared_ptr<const ZoneDirectory> DirectoryKeeper::Open(const std::string& bytes,
                                                           std::optional<std::int64_t> now_ns,
                                                           const std::string& name) const {
  const std::string text =
      OpenSignedDocument(bytes, authority_, kDirectorySigner, now_ns, kMaxBytes, name);
  return std::make_shared<const ZoneDirectory>(ZoneDirectory::Parse(text, name));
}

std::optional<std::string> DirectoryKeeper::Offer(const std::string& bytes) {
  const std::int64_t now_ns = now_ns_();
  std::shared_ptr<const ZoneDirectory> offered;
  try {
    offered = Open(bytes, now_ns, "the offered zone directory");
  } catch (const Error& error) {
    return error.what();
  }
  const std::string version =
      "the offered zone directory has version " + std::to_string(offered->version());
  if (offered->expires_ns() <= now_ns) {
    return version + ", which expired at " + Rfc3339Seconds(offered->expires_ns());
  }
  if (offered->issued_ns() > now_ns + Nanoseconds(kMaxAheadS)) {
    return version + ", which is issued at " + Rfc3339Seconds(offered->issued_ns()) +
           ", after now, " + Rfc3339Seconds(now_ns);
  }
  if (kept_ && offered->version() < kept_->version()) {
    return version + ", accepted is " + std::to_string(kept_->version()) + " or newer";
  }
  if (kept_ && offered->version() == kept_->version()) {
    if (bytes == bytes_) return std::nullopt;
    return version + ", as the kept one, and says something else";
  }
  ReplaceTextFile(path_, bytes);
  bytes_ = bytes;
  kept_ = std::move(offered);
  return std::nullopt;
}

std::shared_ptr<const ZoneDirectory> DirectoryKeeper::directory() const {
  if (!kept_ || kept_->expires_ns() <= now_ns_()) return nullptr;
  return kept_;
}

}  // namespace livemap::directory
