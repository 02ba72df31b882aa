#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "common/clock.h"
#include "directory/directory_keeper.h"
#include "directory/signed_document.h"
#include "directory/zone_directory.h"

namespace livemap::directory {

/// The zone directory in a file that others write, too (another DirectoryFile, or a person). The
/// file is read again when it has changed. What is forged, half written, or older than what was
/// read before takes nothing away from that. Not thread-safe.
///
/// Typical usage:
///
///     DirectoryFile file(TrustedAuthority::Read("identity/ca.pem"), folder + "/zones.cms");
///     if (file.ReadIfChanged() && !file.damage().empty()) ROS_WARN("%s", file.damage().c_str());
///     if (const auto directory = file.directory()) zone = directory->Find(position, 2000);
class DirectoryFile {
 public:
  /// The file `path` need not be there yet; nothing is read until ReadIfChanged.
  DirectoryFile(TrustedAuthority authority, std::string path,
                DirectoryKeeper::Clock now_ns = SystemNs);

  /// Whether there was another file than at the last call, which has been read. A file that is gone
  /// says nothing against what it said.
  bool ReadIfChanged();
  /// Puts a signed directory into the file if it is newer than what is known, as
  /// DirectoryKeeper::Offer. It counts at once. The known one again is accepted; it comes back into
  /// a file that is gone or damaged. Returns why it is refused, in one sentence. Throws Error when
  /// the file cannot be written.
  std::optional<std::string> Offer(const std::string& bytes);
  /// The newest directory that was read, while it is not expired; null: none.
  std::shared_ptr<const ZoneDirectory> directory() const;
  /// That directory as it is signed, also an expired one; empty: none.
  const std::string& bytes() const;
  /// What was wrong with the file that was read last; empty: nothing.
  const std::string& damage() const { return damage_; }

 private:
  const TrustedAuthority authority_;
  const std::string path_;
  const DirectoryKeeper::Clock now_ns_;
  std::filesystem::file_time_type read_time_{};  // Of the file that was read last.
  bool has_read_ = false;
  std::unique_ptr<DirectoryKeeper> keeper_;
  std::string damage_;
};

}  // namespace livemap::directory
