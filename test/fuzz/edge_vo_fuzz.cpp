// Odometry over frames of any size, type, stamp, calibration and content: every result is finite,
// or the frame is refused by a sentence.
#include <cmath>
#include <cstdint>

#include "common/error.h"
#include "odometry/edge/edge_odometry.h"
#include "test/fuzz/fuzz_bytes.h"

namespace {

/// An image of one of a few sizes and types whose pixels repeat some bytes of the input.
cv::Mat TakeImage(livemap::fuzz::FuzzBytes& bytes, const int (&types)[3]) {
  const auto kind = bytes.Any<std::uint8_t>();
  constexpr int kSizes[4][2] = {{64, 48}, {64, 48}, {1, 1}, {40, 64}};
  const auto& size = kSizes[kind & 3U];
  cv::Mat image(size[1], size[0], types[(kind >> 2U) % 3]);
  std::uint8_t pattern[61];
  for (std::uint8_t& byte : pattern) byte = bytes.Any<std::uint8_t>();
  for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i) {
    image.data[i] = pattern[(i + i / 97) % sizeof(pattern)];
  }
  return image;
}

void CheckFinite(const livemap::odometry::VoResult& result) {
  const bool finite = result.world_from_camera.matrix().allFinite() &&
                      result.covariance.allFinite() && result.twist_covariance.allFinite() &&
                      (!result.twist || result.twist->allFinite());
  if (!finite) __builtin_trap();
  if (!(result.covariance.diagonal().minCoeff() >= 0)) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzBytes bytes(data, size);
  livemap::geo::CameraIntrinsics camera{50, 50, 31.5, 23.5, 64, 48};
  const auto flags = bytes.Any<std::uint8_t>();
  if ((flags & 1U) != 0) camera.fx = bytes.Any<double>();
  if ((flags & 2U) != 0) camera.cy = bytes.Any<double>();
  livemap::odometry::EdgeOdometry::Config config;
  config.min_points = 10;
  config.edge_source = (flags & 4U) != 0 ? livemap::odometry::EdgeSource::kNewImage
                                         : livemap::odometry::EdgeSource::kKeyframe;
  config.edges.kind = static_cast<livemap::odometry::EdgeKind>((flags >> 3U) % 3);
  try {
    livemap::odometry::EdgeOdometry odometry(config, camera);
    for (std::int64_t stamp_ns = 1; !bytes.empty();) {
      stamp_ns += bytes.Any<std::int32_t>();
      livemap::odometry::RgbdFrame frame;
      frame.stamp_ns = stamp_ns;
      frame.grey = TakeImage(bytes, {CV_8UC1, CV_8UC1, CV_8UC3});
      frame.depth = TakeImage(bytes, {CV_32FC1, CV_16UC1, CV_8UC1});
      try {
        CheckFinite(odometry.Track(frame));
      } catch (const livemap::Error&) {
        // Refused by a sentence.
      }
    }
  } catch (const livemap::Error&) {
    // No calibration.
  }
  return 0;
}
