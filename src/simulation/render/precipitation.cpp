#include "simulation/render/precipitation.h"

#include <cmath>

namespace livemap::simulation {
namespace {

/// A soft elliptical spot, upright, that blends towards `colour`.
void SplatDrop(const Vec3& colour, float x, float y, float half_width, float half_height,
               float share, float distance, const cv::Mat& depth, cv::Mat& light) {
  const int top = std::max(0, static_cast<int>(std::floor(y - half_height)));
  const int bottom = std::min(light.rows - 1, static_cast<int>(std::ceil(y + half_height)));
  const int first = std::max(0, static_cast<int>(std::floor(x - half_width)));
  const int last = std::min(light.cols - 1, static_cast<int>(std::ceil(x + half_width)));
  for (int row = top; row <= bottom; ++row) {
    const auto* depths = depth.ptr<float>(row);
    auto* pixels = light.ptr<cv::Vec3f>(row);
    for (int column = first; column <= last; ++column) {
      if (depths[column] > 0 && depths[column] < distance) continue;
      const float dx = (static_cast<float>(column) - x) / half_width;
      const float dy = (static_cast<float>(row) - y) / half_height;
      const float falloff = 1 - dx * dx - dy * dy;
      if (falloff <= 0) continue;
      const float part = share * falloff;
      for (int channel = 0; channel < 3; ++channel) {
        pixels[column][channel] = Blend(pixels[column][channel], colour[channel], part);
      }
    }
  }
}

}  // namespace

void AddPrecipitation(const Lighting& lighting, const geo::CameraIntrinsics& camera,
                      std::uint32_t frame_number, const cv::Mat& depth, cv::Mat& light) {
  const bool snow = lighting.condition == Condition::kSnow;
  if (!snow && lighting.condition != Condition::kRain) return;
  CounterRandom random(lighting.seed, 8, frame_number);
  const auto width = static_cast<float>(camera.width);
  const auto height = static_cast<float>(camera.height);
  const auto focal = static_cast<float>(camera.fx);
  const Vec3 colour = snow ? Vec3(lighting.horizon * 1.15F) : Vec3(lighting.horizon * 0.95F);
  const int count = snow ? 3200 : 700;
  for (int i = 0; i < count; ++i) {
    // Equal density in space: most drops are far away.
    const float distance = 1.3F + 24.0F * std::cbrt(random.Uniform(0.0F, 1.0F));
    const float x = random.Uniform(0.0F, width);
    const float y = random.Uniform(0.0F, height);
    const float scale = focal / distance;
    if (snow) {
      const float radius = 0.021F * scale * random.Uniform(0.6F, 1.3F);
      const float visible = std::min(1.0F, radius * radius / 0.35F);
      const float drawn = std::max(radius, 0.8F);
      SplatDrop(colour, x, y, drawn, drawn * 1.25F, 0.85F * visible, distance, depth, light);
    } else {
      const float length = std::min(0.030F * scale, 26.0F);
      const float share = std::min(0.30F, 0.0060F * scale);
      SplatDrop(colour, x, y, 0.85F, length + 1.0F, share, distance, depth, light);
    }
  }
}

}  // namespace livemap::simulation
