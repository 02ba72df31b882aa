#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/clock.h"
#include "directory/signed_document.h"
#include "directory/zone_directory.h"

namespace livemap::directory {

/// Keeps the newest directory of an authority on disk, whoever hands it over: what is forged,
/// older than the kept one, expired or issued in the future is refused. Not thread-safe.
///
/// Typical usage:
///
///     DirectoryKeeper keeper(TrustedAuthority::Read("identity/ca.pem"), folder + "/zones.cms");
///     if (const auto why_not = keeper.Offer(payload)) ROS_WARN("%s", why_not->c_str());
///     if (keeper.directory()) zone = choice.Update(*keeper.directory(), position);
class DirectoryKeeper {
 public:
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.

  /// Reads what is kept in the file `path`, where there is one. What is there and is no valid
  /// directory is left alone, counts for nothing, and is told by `damage`.
  DirectoryKeeper(TrustedAuthority authority, std::string path, Clock now_ns = SystemNs);

  /// Takes a signed directory (OpenSignedDocument) if it is newer than the kept one: it is on disk
  /// when this returns. The kept one again is accepted and changes nothing. Returns why it is
  /// refused, in one sentence. Throws Error when the file cannot be written: then the one before
  /// stays.
  std::optional<std::string> Offer(const std::string& bytes);

  /// The kept directory while it is not expired; null: none.
  std::shared_ptr<const ZoneDirectory> directory() const;
  /// The kept directory as it is signed, also an expired one; empty: none.
  const std::string& bytes() const { return bytes_; }
  /// What was wrong with the file at the start; empty: nothing.
  const std::string& damage() const { return damage_; }

  /// A signature and its certificates come on top of the text.
  static constexpr std::size_t kMaxBytes = ZoneDirectory::kMaxBytes + (16 << 10);
  /// So far an authority's clock may be ahead, s.
  static constexpr double kMaxAheadS = 3600;

 private:
  std::shared_ptr<const ZoneDirectory> Open(const std::string& bytes,
                                            std::optional<std::int64_t> now_ns,
                                            const std::string& name) const;

  const TrustedAuthority authority_;
  const std::string path_;
  const Clock now_ns_;
  std::string bytes_;  ///< Of kept_.
  std::shared_ptr<const ZoneDirectory> kept_;
  std::string damage_;
};

}  // namespace livemap::directory
