#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace livemap::zone {

/// Segments of a JPEG, one marker after the other. The file must outlive the walk.
class JpegWalk {
 public:
  explicit JpegWalk(const std::vector<std::uint8_t>& file) : file_(file) {}

  /// The next marker's code; 0 where none stands. Fill bytes before it are skipped.
  int TakeMarker() {
    if (at_ >= file_.size() || file_[at_] != 0xff) return 0;
    while (at_ < file_.size() && file_[at_] == 0xff) ++at_;
    return at_ < file_.size() ? file_[at_++] : 0;
  }
  /// Skips a segment's content; false when it reaches beyond the file.
  bool SkipSegment() {
    if (file_.size() - at_ < 2) return false;
    const std::size_t length = static_cast<std::size_t>(file_[at_]) << 8 | file_[at_ + 1];
    if (length < 2 || file_.size() - at_ < length) return false;
    at_ += length;
    return true;
  }
  /// Skips entropy-coded data, stuffed bytes and restart markers, up to the next marker.
  void SkipEntropyCoded() {
    for (; at_ + 1 < file_.size(); ++at_) {
      if (file_[at_] != 0xff) continue;
      const std::uint8_t next = file_[at_ + 1];
      if (next != 0 && next != 0xff && (next < 0xd0 || next > 0xd7)) return;
    }
    at_ = file_.size();
  }

 private:
  const std::vector<std::uint8_t>& file_;
  std::size_t at_ = 0;
};

/// Why `file` is not built as a JPEG must be (ITU-T T.81 annex B): segments within the file, one
/// frame header, at most `max_scans` scans, an end marker behind the last. None when it is.
/// Decoding a progressive file costs time for each scan over the whole image: a few kilobytes could
/// ask for thousands.
std::optional<std::string> WhyNoWholeJpeg(const std::vector<std::uint8_t>& file, int max_scans);

/// How many scans the JPEG has, at least 1; of a file that WhyNoWholeJpeg refuses those up to where
/// it is not built as it must be.
int CountJpegScans(const std::vector<std::uint8_t>& file);

}  // namespace livemap::zone
