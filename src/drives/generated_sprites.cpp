#include "drives/generated_sprites.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "drives/generated_world.h"

namespace livemap {
namespace {

const cv::Vec3f kHaze(214, 205, 196);

/// Leaves: many small ellipses, lighter towards the top right where the sun is.
void PaintCanopy(std::mt19937_64& generator, cv::Point2d centre, cv::Size2d half, int leaves,
                 cv::Mat& image) {
  for (int i = 0; i < leaves; ++i) {
    const double angle = Uniform(generator, 0, 6.28318);
    const double radius = std::sqrt(Uniform(generator, 0, 1));
    const double x = radius * std::cos(angle);
    const double y = radius * std::sin(angle);
    // Early leaves lie behind and are dark.
    const double depth = static_cast<double>(i) / leaves;
    const double light = 0.35 + 0.45 * depth + 0.18 * (x - y) + Uniform(generator, -0.1, 0.1);
    const cv::Scalar colour(50 * light, 118 * light, 86 * light, 255);
    cv::ellipse(image, cv::Point2d(centre.x + x * half.width, centre.y + y * half.height),
                cv::Size(static_cast<int>(Uniform(generator, 2, 7)),
                         static_cast<int>(Uniform(generator, 2, 5))),
                Uniform(generator, 0, 180), 0, 360, colour, cv::FILLED, cv::LINE_8);
  }
}

/// What part of the way from foot to tip shows white.
bool IsWhiteBand(double height) {
  return (height > 0.36 && height < 0.54) || (height > 0.68 && height < 0.82);
}

/// Colour of the cone where its side is cut by a ray at `x`, `up` in metres; false: beside it.
bool ConeColour(double x, double up, double tilt_rad, double grime, cv::Vec3f& colour) {
  constexpr double kBottomRadius = 0.15;
  constexpr double kTopRadius = 0.03;
  double height = up / std::cos(tilt_rad);
  double radius = 0;
  for (int i = 0; i < 3; ++i) {
    const double part = std::clamp(height / kConeHeightM, 0.0, 1.0);
    radius = kBottomRadius + (kTopRadius - kBottomRadius) * part;
    if (std::abs(x) > radius) return false;
    height = (up + std::sqrt(radius * radius - x * x) * std::sin(tilt_rad)) / std::cos(tilt_rad);
  }
  if (height < 0.02 || height > kConeHeightM) return false;
  const double side = x / radius;
  // Sun from the right: brightest at two thirds.
  const double light = 0.45 + 0.6 * std::max(0.0, std::cos(std::asin(side) - 0.7)) - 0.1 * grime;
  const cv::Vec3f base =
      IsWhiteBand(height / kConeHeightM) ? cv::Vec3f(228, 228, 226) : cv::Vec3f(32, 84, 236);
  colour = static_cast<float>(light) * base;
  return true;
}

}  // namespace

cv::Mat PaintTreeSprite(std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  cv::Mat image = cv::Mat::zeros(320, 260, CV_8UC4);
  cv::rectangle(image, cv::Rect(122, 200, 16, 120), cv::Scalar(38, 52, 64, 255), cv::FILLED);
  for (int clump = 0; clump < 9; ++clump) {
    const cv::Point2d centre(Uniform(generator, 75, 185), Uniform(generator, 70, 205));
    PaintCanopy(generator, centre, {Uniform(generator, 35, 70), Uniform(generator, 30, 60)}, 420,
                image);
  }
  return image;
}

cv::Mat PaintBushSprite(std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  cv::Mat image = cv::Mat::zeros(140, 240, CV_8UC4);
  for (int clump = 0; clump < 6; ++clump) {
    const cv::Point2d centre(Uniform(generator, 60, 180), Uniform(generator, 70, 110));
    PaintCanopy(generator, centre, {Uniform(generator, 30, 55), Uniform(generator, 25, 40)}, 300,
                image);
  }
  return image;
}

cv::Mat PaintPostSprite() {
  cv::Mat image = cv::Mat::zeros(200, 30, CV_8UC4);
  cv::rectangle(image, cv::Rect(3, 0, 24, 200), cv::Scalar(222, 224, 224, 255), cv::FILLED);
  cv::rectangle(image, cv::Rect(3, 30, 24, 40), cv::Scalar(35, 35, 35, 255), cv::FILLED);
  cv::rectangle(image, cv::Rect(10, 36, 10, 28), cv::Scalar(70, 130, 230, 255), cv::FILLED);
  return image;
}

cv::Mat PaintConeSprite(double tilt_rad, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  // 400 pixels per metre; the lower edge of the picture is the near edge of the foot.
  constexpr double kScale = 400;
  const double foot_rise = kConeFootM * std::sin(tilt_rad);
  const double total = kConeHeightM * std::cos(tilt_rad) + foot_rise / 2;
  const int rows = static_cast<int>(std::ceil(total * kScale));
  const int columns = static_cast<int>(std::ceil(kConeFootM * kScale));
  cv::Mat image = cv::Mat::zeros(rows, columns, CV_8UC4);
  const int plate = static_cast<int>(foot_rise * kScale);
  const int rim = static_cast<int>(0.03 * kScale);
  cv::rectangle(image, cv::Rect(0, rows - plate - rim, columns, plate),
                cv::Scalar(44, 66, 150, 255), cv::FILLED);
  cv::rectangle(image, cv::Rect(0, rows - rim, columns, rim), cv::Scalar(24, 30, 70, 255),
                cv::FILLED);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = (column + 0.5) / kScale - kConeFootM / 2;
      const double up = (rows - row - 0.5) / kScale - foot_rise / 2;
      cv::Vec3f colour;
      if (!ConeColour(x, up, tilt_rad, Uniform(generator, 0, 1), colour)) continue;
      image.at<cv::Vec4b>(row, column) = {cv::saturate_cast<uchar>(colour[0]),
                                          cv::saturate_cast<uchar>(colour[1]),
                                          cv::saturate_cast<uchar>(colour[2]), 255};
    }
  }
  return image;
}

void DrawSprite(const cv::Mat& sprite, const cv::Rect2d& target, double haze, cv::Mat& image) {
  const int first_row = std::max(0, static_cast<int>(std::floor(target.y)));
  const int last_row = std::min(image.rows - 1, static_cast<int>(std::floor(target.br().y)));
  const int first = std::max(0, static_cast<int>(std::floor(target.x)));
  const int last = std::min(image.cols - 1, static_cast<int>(std::floor(target.br().x)));
  const double scale_x = sprite.cols / target.width;
  const double scale_y = sprite.rows / target.height;
  // Box filter over the sprite's pixels under one of the image, at most 5x5 of them.
  const int taps = std::clamp(static_cast<int>(std::ceil(std::max(scale_x, scale_y))), 2, 5);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first; column <= last; ++column) {
      cv::Vec3f sum(0, 0, 0);
      float cover = 0;
      for (int tap = 0; tap < taps * taps; ++tap) {
        const double x = column + (tap % taps + 0.5) / taps - target.x;
        const int tap_row = tap / taps;
        const double y = row + (tap_row + 0.5) / taps - target.y;
        const int sx = static_cast<int>(std::floor(x * scale_x));
        const int sy = static_cast<int>(std::floor(y * scale_y));
        if (sx < 0 || sy < 0 || sx >= sprite.cols || sy >= sprite.rows) continue;
        const auto& pixel = sprite.at<cv::Vec4b>(sy, sx);
        const float alpha = static_cast<float>(pixel[3]) / 255.0F;
        sum += alpha * cv::Vec3f(pixel[0], pixel[1], pixel[2]);
        cover += alpha;
      }
      if (cover == 0) continue;
      const auto h = static_cast<float>(haze);
      const cv::Vec3f colour = (1 - h) * (sum / cover) + h * kHaze;
      cover /= static_cast<float>(taps * taps);
      auto& pixel = image.at<cv::Vec3b>(row, column);
      const cv::Vec3f mixed = (1 - cover) * cv::Vec3f(pixel) + cover * colour;
      pixel = {cv::saturate_cast<uchar>(mixed[0]), cv::saturate_cast<uchar>(mixed[1]),
               cv::saturate_cast<uchar>(mixed[2])};
    }
  }
}

cv::Mat PaintSky(std::uint64_t seed, int rows, int columns) {
  cv::RNG generator(seed);
  cv::Mat clouds = cv::Mat::zeros(rows, columns, CV_32F);
  for (int octave = 0; octave < 4; ++octave) {
    cv::Mat small(3 << octave, 6 << octave, CV_32F);
    generator.fill(small, cv::RNG::NORMAL, 0, 1);
    cv::Mat large;
    cv::resize(small, large, clouds.size(), 0, 0, cv::INTER_CUBIC);
    clouds += large * (1.0 / (1 << octave));
  }
  cv::Mat ridge(1, 24, CV_32F);
  generator.fill(ridge, cv::RNG::UNIFORM, 3, 15);
  cv::resize(ridge, ridge, cv::Size(columns, 1), 0, 0, cv::INTER_CUBIC);
  cv::Mat sky(rows, columns, CV_8UC3);
  for (int row = 0; row < rows; ++row) {
    const auto up = static_cast<float>(rows - row) / static_cast<float>(rows);
    for (int column = 0; column < columns; ++column) {
      const float cloud = std::clamp(0.3F + 0.35F * clouds.at<float>(row, column), 0.0F, 1.0F);
      const cv::Vec3f blue = up * cv::Vec3f(222, 176, 128) + (1 - up) * kHaze;
      cv::Vec3f colour = (1 - 0.7F * cloud) * blue + 0.7F * cloud * cv::Vec3f(240, 238, 236);
      const float wood =
          ridge.at<float>(0, column) + static_cast<float>(generator.uniform(-1.5, 1.5));
      if (static_cast<float>(rows - row) < wood) {
        colour = cv::Vec3f(112, 126, 108) * static_cast<float>(generator.uniform(0.85, 1.1));
      }
      sky.at<cv::Vec3b>(row, column) = {cv::saturate_cast<uchar>(colour[0]),
                                        cv::saturate_cast<uchar>(colour[1]),
                                        cv::saturate_cast<uchar>(colour[2])};
    }
  }
  return sky;
}

}  // namespace livemap
