#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "imaging/box.h"
namespace livemap::placement {

/// One thing that the detector saw in an image.
struct Sighting {
  std::string class_name;
  float confidence = 0;
  imaging::Box box;
};

/// What the detector saw in one image.
struct SightingFrame {
  std::int64_t stamp_ns = 0;
  std::string frame_id;  ///< Optical frame of the image.
  std::uint32_t image_width = 0;
  std::uint32_t image_height = 0;
  std::vector<Sighting> sightings;
};

}  // namespace livemap::placement
