#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace livemap {

/// Pictures of upright things, CV_8UC4 (BGR and cover), drawn from a seed.
cv::Mat PaintTreeSprite(std::uint64_t seed);
cv::Mat PaintBushSprite(std::uint64_t seed);
/// A white reflector post with its black band.
cv::Mat PaintPostSprite();
/// An orange traffic cone with two white bands on a square foot, seen from `tilt_rad` above.
cv::Mat PaintConeSprite(double tilt_rad, std::uint64_t seed);

/// Size of a cone, metres.
constexpr double kConeHeightM = 0.75;
constexpr double kConeFootM = 0.42;

/// Draws `sprite` scaled into `target` of `image`, which may reach past its edges; `haze` from 0
/// (none) to 1. Sub-pixel exact, filtered when it shrinks.
void DrawSprite(const cv::Mat& sprite, const cv::Rect2d& target, double haze, cv::Mat& image);

/// Sky with clouds over a hilly, wooded horizon: `rows` x `columns`, the last row at the horizon.
cv::Mat PaintSky(std::uint64_t seed, int rows, int columns);

}  // namespace livemap
