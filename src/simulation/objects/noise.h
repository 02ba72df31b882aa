#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {

using Vec2 = Eigen::Vector2f;
using Vec3 = Eigen::Vector3f;

inline float Saturate(float x) { return std::min(std::max(x, 0.0F), 1.0F); }
inline float Blend(float a, float b, float t) { return a + (b - a) * t; }
inline Vec3 Blend(const Vec3& a, const Vec3& b, float t) { return a + (b - a) * t; }

/// 0 below `low`, 1 above `high`, smooth between.
inline float SmoothStep(float low, float high, float x) {
  const float t = Saturate((x - low) / (high - low));
  return t * t * (3.0F - 2.0F * t);
}

/// std::floor without the library call.
inline std::int32_t FloorToInt(float x) {
  const auto whole = static_cast<std::int32_t>(x);
  return whole - (static_cast<float>(whole) > x ? 1 : 0);
}

/// Value noise in [-1, 1], wavelength about two units.
inline float Noise(float x, float y, std::uint32_t seed) {
  const std::int32_t ix = FloorToInt(x);
  const std::int32_t iy = FloorToInt(y);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const float sx = fx * fx * (3.0F - 2.0F * fx);
  const float sy = fy * fy * (3.0F - 2.0F * fy);
  // The four corners' hashes share their products: this is where a picture's time goes.
  const std::uint32_t west = static_cast<std::uint32_t>(ix) * 0x9e3779b1U;
  const std::uint32_t east = west + 0x9e3779b1U;
  const std::uint32_t south = static_cast<std::uint32_t>(iy) * 0x85ebca77U + seed * 0xc2b2ae3dU;
  const std::uint32_t north = south + 0x85ebca77U;
  const auto corner = [](std::uint32_t h) {
    h = (h ^ (h >> 15U)) * 0x2c1b3c6dU;
    h = (h ^ (h >> 12U)) * 0x297a2d39U;
    return static_cast<float>(static_cast<std::int32_t>(h)) * (1.0F / 2147483648.0F);
  };
  const float a = corner(west ^ south);
  const float b = corner(east ^ south);
  const float c = corner(west ^ north);
  const float d = corner(east ^ north);
  return Blend(Blend(a, b, sx), Blend(c, d, sx), sy);
}

/// How much of a detail of `size_m` is left when a pixel covers `footprint_m`: 1 when the pixel is
/// small against it, 0 when it is not, so that fine structure neither shimmers nor ends at an edge.
inline float DetailLeft(float size_m, float footprint_m) {
  return Saturate(1.6F - 1.1F * footprint_m / size_m);
}

/// Noise of several octaves, the largest `size_m`; octaves below the footprint fade out.
inline float FractalNoise(float x, float y, float size_m, int octaves, float footprint_m,
                          std::uint32_t seed) {
  float sum = 0;
  float amplitude = 0.55F;
  float frequency = 1.0F / size_m;
  for (int octave = 0; octave < octaves; ++octave) {
    const float left = Saturate(1.6F - 1.1F * footprint_m * frequency);
    if (left <= 0) break;
    sum += left * amplitude *
           Noise(x * frequency, y * frequency, seed + static_cast<std::uint32_t>(octave));
    amplitude *= 0.55F;
    frequency *= 2.13F;
  }
  return sum;
}

/// Share of a box-filtered pixel of width `footprint` at `x` that lies in [low, high].
inline float FilteredBand(float low, float high, float x, float footprint) {
  const float half = 0.5F * std::max(footprint, 1e-5F);
  return Saturate((std::min(x + half, high) - std::max(x - half, low)) / (2 * half));
}

/// The same for a band [0, width] that repeats every `period`.
inline float FilteredStripes(float width, float period, float x, float footprint) {
  const float half = 0.5F * std::max(footprint, 1e-5F);
  const auto integral = [&](float t) {
    const float turns = std::floor(t / period);
    return turns * width + std::min(t - turns * period, width);
  };
  return Saturate((integral(x + half) - integral(x - half)) / (2 * half));
}

/// What cellular noise says of a place: distances to the nearest and second nearest feature point
/// in cell widths, and the nearest one's hash.
struct Cell {
  float nearest = 8;
  float second = 8;
  std::uint32_t hash = 0;
};

inline Cell CellNoise(float x, float y, std::uint32_t seed) {
  const std::int32_t ix = FloorToInt(x);
  const std::int32_t iy = FloorToInt(y);
  Cell cell;
  float nearest = 64;
  float second = 64;
  for (std::int32_t dy = -1; dy <= 1; ++dy) {
    for (std::int32_t dx = -1; dx <= 1; ++dx) {
      const std::uint32_t h = HashLattice(ix + dx, iy + dy, seed);
      const float px = static_cast<float>(ix + dx) + static_cast<float>(h & 0xffffU) / 65536.0F - x;
      const float py = static_cast<float>(iy + dy) + static_cast<float>(h >> 16U) / 65536.0F - y;
      const float d = px * px + py * py;
      if (d < nearest) {
        second = nearest;
        nearest = d;
        cell.hash = h;
      } else if (d < second) {
        second = d;
      }
    }
  }
  cell.nearest = std::sqrt(nearest);
  cell.second = std::sqrt(second);
  return cell;
}

}  // namespace livemap::simulation
