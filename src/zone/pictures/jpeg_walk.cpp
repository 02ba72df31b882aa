#include "zone/pictures/jpeg_walk.h"

#include <algorithm>

namespace livemap::zone {
namespace {

/// The last of the frame headers that are accepted: baseline, extended and progressive.
constexpr int kProgressive = 0xc2;
constexpr int kStartOfImage = 0xd8, kEndOfImage = 0xd9, kStartOfScan = 0xda;

bool IsJpegFrameMarker(int marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

/// What a walk over a JPEG's segments finds, up to the first that must not be there.
struct JpegOutline {
  int scans = 0;
  std::optional<std::string> fault;  ///< Why it is not built as it must be.
};

std::optional<std::string> JpegFault(int marker, int frames) {
  if (marker == 0) return "is cut off or no JPEG: there is no marker where one must be";
  if (marker == kStartOfImage) return "holds an image within the image";
  if (IsJpegFrameMarker(marker) && frames > 0) return "has more than one frame header";
  if (IsJpegFrameMarker(marker) && marker > kProgressive) {
    return "is coded as no camera does: lossless, hierarchical or arithmetic";
  }
  if (marker == kStartOfScan && frames == 0) return "has a scan before its frame header";
  return std::nullopt;
}

JpegOutline OutlineOfJpeg(const std::vector<std::uint8_t>& file) {
  JpegOutline outline;
  JpegWalk walk(file);
  if (walk.TakeMarker() != kStartOfImage) return {0, "does not begin as a JPEG"};
  int frames = 0;
  while (true) {
    const int marker = walk.TakeMarker();
    if (marker == kEndOfImage) break;
    if (marker == 1 || (marker >= 0xd0 && marker <= 0xd7)) continue;  // They have no content.
    outline.fault = JpegFault(marker, frames);
    if (!outline.fault && !walk.SkipSegment()) {
      outline.fault = "is cut off: a segment reaches beyond its end";
    }
    if (outline.fault) return outline;
    if (IsJpegFrameMarker(marker)) ++frames;
    if (marker != kStartOfScan) continue;
    ++outline.scans;
    walk.SkipEntropyCoded();
  }
  if (outline.scans == 0) outline.fault = "has no scan";
  return outline;
}

}  // namespace

std::optional<std::string> WhyNoWholeJpeg(const std::vector<std::uint8_t>& file, int max_scans) {
  const JpegOutline outline = OutlineOfJpeg(file);
  if (outline.scans > max_scans) return "has more than " + std::to_string(max_scans) + " scans";
  return outline.fault;
}

int CountJpegScans(const std::vector<std::uint8_t>& file) {
  return std::max(1, OutlineOfJpeg(file).scans);
}

}  // namespace livemap::zone
