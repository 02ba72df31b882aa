#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/queues/token_bucket.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::zone {

/// Why the zone keeps no picture of a report or answer that it accepts otherwise.
enum class PictureRefusal {
  kTooCostly,  ///< To decode it would take too long, by its header.
  kTooMany     ///< The vehicle has sent as many pixels or bytes as it may in an hour.
};
constexpr std::size_t kPictureRefusals = 2;
/// "too_costly" or "too_many".
const char* PictureRefusalName(PictureRefusal refusal);

/// What it costs to keep pictures.
struct PictureCost {
  std::int64_t px = 0;     ///< By what decoding them takes.
  std::int64_t bytes = 0;  ///< On disk.

  PictureCost& operator+=(const PictureCost& other) {
    px += other.px;
    bytes += other.bytes;
    return *this;
  }
};

/// Decides which pictures of vehicles are kept at all: a picture costs when somebody looks at it,
/// and it takes its place on the disk from others, and a vehicle must not be able to make that
/// costly. Counts what it refuses. Not thread-safe, but for refused().
class PictureAllowance {
 public:
  struct Config {
    double pixels_per_hour = 2e9;  ///< Of one vehicle, >= 1.
    std::size_t max_vehicles = 50000;
    double bytes_per_hour = 100e6;  ///< Of one vehicle, >= 1.
  };

  explicit PictureAllowance(const Config& config);

  /// What it costs to keep this picture, which WhyPictureRefused accepts; none when the zone does
  /// not keep it. Nothing is taken yet: `reserved` is what other pictures of the vehicle are about
  /// to take. By its size, header and segments alone; nothing is decoded. `now_ns` is the zone's
  /// clock.
  std::optional<PictureCost> Ask(const std::string& vehicle_id,
                                 const std::vector<std::uint8_t>& image,
                                 const PictureCost& reserved, std::int64_t now_ns);
  /// Takes what Ask had room for: its report or answer is committed.
  void Spend(const std::string& vehicle_id, const PictureCost& cost, std::int64_t now_ns);

  /// How many it did not take since the start, by PictureRefusal. Any thread.
  std::array<std::uint64_t, kPictureRefusals> refused() const;

 private:
  std::nullopt_t Refuse(PictureRefusal refusal);

  const PictureLimits limits_;
  KeyedTokenBuckets<2> buckets_;  ///< Of pixels and of bytes.
  std::array<std::atomic<std::uint64_t>, kPictureRefusals> refused_{};
};

}  // namespace livemap::zone
