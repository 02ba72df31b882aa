#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "imaging/image_header.h"

namespace livemap::datasets {

/// An image file's bytes as they are, checked.
struct ImageFile {
  std::vector<std::uint8_t> bytes;
  imaging::ImageHeader header;
};

/// Reads a JPEG or PNG and decodes it once to know that it is whole. Throws Error naming the file
/// and what is wrong with it: missing, above 64 MiB or 64 megapixels, corrupt, or not `width` x
/// `height` when those are positive.
ImageFile ReadImageFile(const std::string& path, int width, int height);

}  // namespace livemap::datasets
