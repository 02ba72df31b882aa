#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "imaging/box.h"

namespace livemap::zone {

/// What a picture of a vehicle may be, and what is made of it before anybody sees it.
struct PictureLimits {
  std::size_t max_bytes = 16 << 20;       ///< Of the vehicle's file.
  std::int64_t max_pixels = 20'000'000;   ///< By its header; larger ones are never decoded.
  std::int64_t max_work_px = 48'000'000;  ///< See DecodingWork; what costs more is never decoded.
  int longest_side_px = 1280;             ///< Of the picture that is served; never enlarged.
  int jpeg_quality = 85;                  ///< 1..100, of the picture that is served.
};

/// Decodes a picture of a vehicle and encodes its pixels anew, so that no byte of the vehicle's
/// file gets any further: no metadata, no comment, nothing behind the end of the image, no
/// orientation tag (the pixels stay as they lie). The answer is a JPEG without metadata.
///
/// The header is read first; what is larger than the limits, cut off, or not built as its format
/// says is refused without decoding. Pixels are decoded into cleared memory, so that a damaged file
/// never shows what was in memory before. Throws Error with one sentence that says what is wrong.
std::vector<std::uint8_t> RecodePicture(const std::vector<std::uint8_t>& file,
                                        const PictureLimits& limits = {});

/// What a thumbnail for drivers must keep to.
struct SmallPictureLimits {
  std::size_t max_bytes = 4096;  ///< Of the JPEG; at least 1000 leave something to see.
  int width_px = 192;            ///< Of the thumbnail, at most; its height is two thirds of it.
  PictureLimits picture;  ///< Of the vehicle's file; the served size and quality are not used.
};

/// The surroundings of `box` as a JPEG of at most `max_bytes`, with the box drawn on it in its
/// place. `box` is in pixels of the original image, of which `file` shows the region `shown`,
/// perhaps by fewer pixels. The view is 2.5 times as wide as the box, within the picture. Empty
/// when not even the smallest thumbnail keeps to the budget. Throws Error as RecodePicture does,
/// and for a box that lies outside the region or is empty.
std::vector<std::uint8_t> SmallPicture(const std::vector<std::uint8_t>& file,
                                       const imaging::Box& box, const imaging::PixelRegion& shown,
                                       const SmallPictureLimits& limits = {});

/// The whole picture as a thumbnail, where no box is known: pictures of vehicles are annotated.
std::vector<std::uint8_t> SmallPicture(const std::vector<std::uint8_t>& file,
                                       const SmallPictureLimits& limits = {});

/// What decoding `file` costs, by its header and segments: as many pixels of a plain picture take
/// as long. Every scan of a JPEG that has several goes over the whole image; a PNG costs by its
/// bytes per pixel, twice where it is interlaced. At most what an int64 holds, whatever the header
/// says. 0 for what is no JPEG or PNG. Decodes nothing.
std::int64_t DecodingWork(const std::vector<std::uint8_t>& file);

}  // namespace livemap::zone
