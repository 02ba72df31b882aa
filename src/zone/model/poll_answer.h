#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"

namespace livemap::zone {

/// What a vehicle answers.
struct PollAnswer {
  enum class Answer { kYes, kNo, kCantSee };
  Uuid poll;
  Uuid hazard;
  std::string vehicle_id;  ///< The proven identity.
  Answer answer = Answer::kCantSee;
  std::string reason;     ///< Of "can't see"; printable UTF-8 of at most 64 bytes or empty.
  double confidence = 0;  ///< 0..1.
  geo::GeoPoint vehicle_position;
  std::int64_t stamp_ns = 0;  ///< Of the image, vehicle clock (UTC).
  std::string image_format;
  std::vector<std::uint8_t> image;  ///< A compressed file; may be empty.
};

}  // namespace livemap::zone
