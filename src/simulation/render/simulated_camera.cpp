#include "simulation/render/simulated_camera.h"

#include <array>
#include <cmath>

#include "simulation/objects/noise.h"

namespace livemap::simulation {
namespace {

constexpr int kToneSteps = 4096;
constexpr float kToneLimit = 16;

/// Camera-like response: a straight middle, a soft shoulder, then sRGB's transfer function.
float DevelopInCamera(float light) {
  const float x = 0.84F * light;
  const float film = (x * (2.2F * x + 0.10F)) / (x * (2.05F * x + 0.86F) + 0.12F);
  const float linear = Saturate(film);
  return linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
}

/// Over the square root of light, so that shadows have steps enough.
const std::array<float, kToneSteps + 1>& CameraToneTable() {
  static const std::array<float, kToneSteps + 1> table = [] {
    std::array<float, kToneSteps + 1> values{};
    for (int i = 0; i <= kToneSteps; ++i) {
      const float root = static_cast<float>(i) / kToneSteps;
      values[static_cast<std::size_t>(i)] = DevelopInCamera(kToneLimit * root * root);
    }
    return values;
  }();
  return table;
}

/// Nearly normal, standard deviation 1: the sum of four uniform bytes.
float CameraNoise(std::uint32_t bits) {
  const std::uint32_t sum =
      (bits & 255U) + ((bits >> 8U) & 255U) + ((bits >> 16U) & 255U) + (bits >> 24U);
  return (static_cast<float>(sum) - 510.0F) * (1.0F / 147.8F);
}

}  // namespace

Eigen::Vector3d SimulatedCamera::Ray(double column, double row) const {
  const double x = (column - intrinsics.cx) / intrinsics.fx;
  const double y = (row - intrinsics.cy) / intrinsics.fy;
  if (k1 == 0 && k2 == 0) return {x, y, 1};
  double ux = x;
  double uy = y;
  // The usual fixed-point inversion of the radial polynomial.
  for (int i = 0; i < 20; ++i) {
    const double r2 = ux * ux + uy * uy;
    const double factor = 1 + r2 * (k1 + r2 * k2);
    ux = x / factor;
    uy = y / factor;
  }
  return {ux, uy, 1};
}

Eigen::Vector2d SimulatedCamera::Project(const Eigen::Vector3d& point) const {
  const double x = point.x() / point.z();
  const double y = point.y() / point.z();
  const double r2 = x * x + y * y;
  const double factor = 1 + r2 * (k1 + r2 * k2);
  return {intrinsics.fx * x * factor + intrinsics.cx, intrinsics.fy * y * factor + intrinsics.cy};
}

float MeterExposure(const cv::Mat& light, float start, float key) {
  // The lower two thirds count: the sky would make the road dark.
  double sum = 0;
  std::size_t count = 0;
  for (int row = light.rows / 3; row < light.rows; row += 4) {
    const auto* pixels = light.ptr<cv::Vec3f>(row);
    for (int column = 0; column < light.cols; column += 4) {
      const cv::Vec3f& p = pixels[column];
      const float luminance = 0.2126F * p[0] + 0.7152F * p[1] + 0.0722F * p[2];
      sum += static_cast<double>(std::log(std::max(luminance * start, 0.01F)));
      ++count;
    }
  }
  const double mean = std::exp(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
  const double wanted = std::pow(static_cast<double>(key) / mean, 0.55);
  return start * static_cast<float>(std::min(std::max(wanted, 0.55), 1.9));
}

void DevelopRow(const SimulatedCamera& camera, const cv::Mat& light, int row, float gain,
                std::uint32_t noise_seed, cv::Mat& bgr) {
  const auto& table = CameraToneTable();
  const auto* pixels = light.ptr<cv::Vec3f>(row);
  auto* out = bgr.ptr<cv::Vec3b>(row);
  const float half_width = 0.5F * static_cast<float>(light.cols);
  const float half_height = 0.5F * static_cast<float>(light.rows);
  const float corner = half_width * half_width + half_height * half_height;
  const float shot = camera.shot_noise * camera.shot_noise;
  const float read = camera.read_noise * camera.read_noise;
  const float dy = static_cast<float>(row) - half_height;
  for (int column = 0; column < light.cols; ++column) {
    const float dx = static_cast<float>(column) - half_width;
    const float dim = gain * (1 - camera.vignetting * (dx * dx + dy * dy) / corner);
    std::uint32_t bits = HashLattice(column, row, noise_seed);
    for (int channel = 0; channel < 3; ++channel) {
      float value = pixels[column][channel] * dim;
      bits = HashBits(bits + 0x9e3779b9U);
      value += CameraNoise(bits) * std::sqrt(shot * std::max(value, 0.0F) + read);
      const float root = std::sqrt(Saturate(value / kToneLimit)) * kToneSteps;
      const auto step = std::min(static_cast<int>(root), kToneSteps - 1);
      const auto index = static_cast<std::size_t>(step);
      const float tone = Blend(table[index], table[index + 1], root - static_cast<float>(step));
      out[column][2 - channel] = static_cast<std::uint8_t>(FloorToInt(255.0F * tone + 0.5F));
    }
  }
}

}  // namespace livemap::simulation
