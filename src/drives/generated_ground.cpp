#include "drives/generated_ground.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace livemap {
namespace {

constexpr double kPi = 3.14159265358979323846;
// The painted strip, metres left of the driven line; grass beyond.
constexpr double kStripRightM = -4.0;
constexpr double kStripLeftM = 7.6;
constexpr int kNoiseSide = 1024;

int StripWidth() {
  return static_cast<int>(
      std::lround((kStripLeftM - kStripRightM) / GeneratedGround::kResolutionM));
}
int TileLength() {
  return static_cast<int>(std::lround(GeneratedGround::kTileM / GeneratedGround::kResolutionM));
}

/// Noise without a seam: `cells` random values per side, smoothly enlarged with wrap-around.
cv::Mat PeriodicOctave(cv::RNG& generator, int cells) {
  cv::Mat small(cells, cells, CV_32F);
  generator.fill(small, cv::RNG::NORMAL, 0, 1);
  cv::Mat wrapped;
  constexpr int kPad = 4;
  cv::copyMakeBorder(small, wrapped, kPad, kPad, kPad, kPad, cv::BORDER_WRAP);
  const int scale = kNoiseSide / cells;
  cv::Mat large;
  cv::resize(wrapped, large, {}, scale, scale, cv::INTER_CUBIC);
  return large(cv::Rect(kPad * scale, kPad * scale, kNoiseSide, kNoiseSide)).clone();
}

cv::Mat PeriodicNoise(cv::RNG& generator, int first_cells, int octaves, float keep) {
  cv::Mat sum = cv::Mat::zeros(kNoiseSide, kNoiseSide, CV_32F);
  float weight = 1;
  for (int octave = 0; octave < octaves; ++octave, weight *= keep) {
    sum += weight * PeriodicOctave(generator, first_cells << octave);
  }
  cv::Scalar mean;
  cv::Scalar sigma;
  cv::meanStdDev(sum, mean, sigma);
  return (sum - mean[0]) / sigma[0];
}

std::vector<cv::Mat> BuildPyramid(const cv::Mat& image) {
  std::vector<cv::Mat> pyramid = {image};
  while (static_cast<int>(pyramid.size()) < GeneratedGround::kLevels) {
    cv::Mat half;
    const cv::Mat& last = pyramid.back();
    cv::resize(last, half, cv::Size((last.cols + 1) / 2, (last.rows + 1) / 2), 0, 0,
               cv::INTER_AREA);
    pyramid.push_back(half);
  }
  return pyramid;
}

cv::Vec3f Bilinear(const cv::Mat& image, double row, double column, bool wraps) {
  const double r = std::floor(row);
  const double c = std::floor(column);
  const auto fr = static_cast<float>(row - r);
  const auto fc = static_cast<float>(column - c);
  const auto index = [wraps](double at, int size) {
    const int i = static_cast<int>(at);
    return wraps ? ((i % size) + size) % size : std::clamp(i, 0, size - 1);
  };
  const int r0 = index(r, image.rows);
  const int r1 = index(r + 1, image.rows);
  const int c0 = index(c, image.cols);
  const int c1 = index(c + 1, image.cols);
  const auto* top = image.ptr<cv::Vec3b>(r0);
  const auto* bottom = image.ptr<cv::Vec3b>(r1);
  return (1 - fr) * ((1 - fc) * cv::Vec3f(top[c0]) + fc * cv::Vec3f(top[c1])) +
         fr * ((1 - fc) * cv::Vec3f(bottom[c0]) + fc * cv::Vec3f(bottom[c1]));
}

double SmoothStep(double from, double to, double value) {
  const double t = std::clamp((value - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

cv::Vec3b Clamp(const cv::Vec3f& colour) {
  return {cv::saturate_cast<uchar>(colour[0]), cv::saturate_cast<uchar>(colour[1]),
          cv::saturate_cast<uchar>(colour[2])};
}

cv::Mat PaintGrass(const cv::Mat& fine, const cv::Mat& coarse) {
  cv::Mat image(kNoiseSide, kNoiseSide, CV_8UC3);
  for (int row = 0; row < kNoiseSide; ++row) {
    for (int column = 0; column < kNoiseSide; ++column) {
      const float light = 1 + 0.22F * fine.at<float>(row, column);
      const float dry = std::clamp(0.35F + 0.3F * coarse.at<float>(row, column), 0.0F, 1.0F);
      const cv::Vec3f colour = (1 - dry) * cv::Vec3f(48, 102, 72) + dry * cv::Vec3f(82, 132, 138);
      image.at<cv::Vec3b>(row, column) = Clamp(light * colour);
    }
  }
  return image;
}

}  // namespace

PotholeShape::PotholeShape(const GeneratedHazard& hazard) {
  std::mt19937_64 generator(hazard.seed);
  across_m_ = hazard.radius_m;
  along_m_ = hazard.radius_m * Uniform(generator, 0.8, 1.5);
  for (int harmonic = 2; harmonic < 16; ++harmonic) {
    amplitude_.push_back(Uniform(generator, 0.3, 1.0) * 0.22 / std::pow(harmonic, 0.75));
    phase_.push_back(Uniform(generator, 0, 2 * kPi));
  }
  for (int i = 0; i < 360; ++i) max_radius_m_ = std::max(max_radius_m_, RadiusM(i * kPi / 180));
}

double PotholeShape::RadiusM(double angle_rad) const {
  const double along = std::cos(angle_rad) / along_m_;
  const double across = std::sin(angle_rad) / across_m_;
  double factor = 1;
  for (std::size_t i = 0; i < amplitude_.size(); ++i) {
    factor += amplitude_[i] * std::sin(static_cast<double>(i + 2) * angle_rad + phase_[i]);
  }
  return std::max(0.3, factor) / std::sqrt(along * along + across * across);
}

GeneratedGround::GeneratedGround(const GeneratedWorld& world) : world_(world) {
  cv::RNG generator(MixSeed(world.seed, 3));
  fine_ = PeriodicNoise(generator, 128, 4, 0.9F);
  coarse_ = PeriodicNoise(generator, 4, 6, 0.6F);
  grass_ = BuildPyramid(PaintGrass(fine_, coarse_));
}

float GeneratedGround::Noise(const cv::Mat& noise, double along_m, double left_m,
                             double scale) const {
  const auto wrap = [scale](double metres) {
    const auto i = static_cast<std::int64_t>(std::floor(metres / (kResolutionM * scale)));
    return static_cast<int>(((i % kNoiseSide) + kNoiseSide) % kNoiseSide);
  };
  return noise.at<float>(wrap(along_m), wrap(left_m));
}

void GeneratedGround::PaintAsphalt(std::int64_t tile, cv::Mat& image) const {
  for (int row = 0; row < image.rows; ++row) {
    const double along_m = static_cast<double>(tile) * kTileM + (row + 0.5) * kResolutionM;
    for (int column = 0; column < image.cols; ++column) {
      const double left_m = kStripRightM + (column + 0.5) * kResolutionM;
      const float fine = Noise(fine_, along_m, left_m, 1);
      const float coarse = Noise(coarse_, along_m, left_m, 1.7);
      const double verge_m = std::max(kRightVergeM - left_m, left_m - kLeftVergeM);
      const double grass = SmoothStep(-0.12, 0.12, verge_m + 0.12 * coarse + 0.05 * fine);
      const double lane_m = std::abs(left_m) < 1.75 ? left_m : left_m - 3.5;
      const double track = std::exp(-std::pow((std::abs(lane_m) - 0.8) / 0.3, 2));
      const float light =
          static_cast<float>((1 + 0.10 * fine + 0.035 * coarse) * (1 - 0.06 * track));
      const cv::Vec3f asphalt = light * cv::Vec3f(106, 108, 112);
      const cv::Vec3f green =
          Bilinear(grass_[0], along_m / kResolutionM, left_m / kResolutionM, true);
      const auto g = static_cast<float>(grass);
      image.at<cv::Vec3b>(row, column) = Clamp((1 - g) * asphalt + g * green);
    }
  }
}

void GeneratedGround::PaintMarkings(std::int64_t tile, cv::Mat& image) const {
  const auto paint = [&](double from_left_m, double to_left_m, const cv::Vec3f& colour,
                         bool dashed) {
    for (int row = 0; row < image.rows; ++row) {
      const double along_m = static_cast<double>(tile) * kTileM + (row + 0.5) * kResolutionM;
      if (dashed && std::fmod(along_m + 1e4, 12.0) > 4.0) continue;
      const int first = static_cast<int>((from_left_m - kStripRightM) / kResolutionM);
      const int last = static_cast<int>((to_left_m - kStripRightM) / kResolutionM);
      for (int column = first; column <= last; ++column) {
        const double left_m = kStripRightM + (column + 0.5) * kResolutionM;
        // Worn off where the grain is low.
        const float worn = 0.8F + 0.1F * Noise(fine_, along_m, left_m, 1) +
                           0.1F * Noise(coarse_, along_m, left_m, 0.7);
        const float cover = std::clamp(worn, 0.0F, 1.0F);
        auto& pixel = image.at<cv::Vec3b>(row, column);
        pixel = Clamp((1 - cover) * cv::Vec3f(pixel) + cover * colour);
      }
    }
  };
  const cv::Vec3f white(205, 208, 210);
  paint(kRightEdgeM - 0.06, kRightEdgeM + 0.06, white, false);
  paint(kLeftEdgeM - 0.06, kLeftEdgeM + 0.06, white, false);
  paint(kCentreM - 0.06, kCentreM + 0.06, cv::Vec3f(45, 150, 215), true);
}

void GeneratedGround::PaintWear(std::int64_t tile, cv::Mat& image) const {
  std::mt19937_64 generator(MixSeed(world_.seed, 1000 + static_cast<std::uint64_t>(tile + 1000)));
  const cv::Mat before = image.clone();
  for (int crack = 0; crack < 5; ++crack) {
    double along_m = Uniform(generator, 0, kTileM);
    double left_m = Uniform(generator, kRightEdgeM, kLeftEdgeM);
    double angle = Uniform(generator, -0.6, 0.6) + (crack % 2 == 0 ? 0 : kPi / 2);
    for (int step = 0; step < 40; ++step) {
      const cv::Point from(static_cast<int>((left_m - kStripRightM) / kResolutionM),
                           static_cast<int>(along_m / kResolutionM));
      angle += Uniform(generator, -0.5, 0.5);
      along_m += 0.05 * std::cos(angle);
      left_m += 0.05 * std::sin(angle);
      const cv::Point to(static_cast<int>((left_m - kStripRightM) / kResolutionM),
                         static_cast<int>(along_m / kResolutionM));
      cv::line(image, from, to, cv::Scalar(62, 62, 64), 1, cv::LINE_AA);
    }
  }
  cv::addWeighted(image, 0.7, before, 0.3, 0, image);
}

void GeneratedGround::PaintPothole(const GeneratedHazard& hazard, std::int64_t tile,
                                   cv::Mat& image) const {
  const PotholeShape shape(hazard);
  const double tile_m = static_cast<double>(tile) * kTileM;
  const double reach_m = shape.max_radius_m() * 1.5;
  const int first_row =
      std::max(0, static_cast<int>((hazard.along_m - reach_m - tile_m) / kResolutionM));
  const int last_row = std::min(
      image.rows - 1, static_cast<int>((hazard.along_m + reach_m - tile_m) / kResolutionM));
  const int first = static_cast<int>((hazard.left_m - reach_m - kStripRightM) / kResolutionM);
  const int last = static_cast<int>((hazard.left_m + reach_m - kStripRightM) / kResolutionM);
  // Inside is positive; in units of the local radius.
  const auto inside = [&](double along_m, double left_m) {
    const double x = along_m - hazard.along_m;
    const double y = left_m - hazard.left_m;
    const double ragged = 0.045 * Noise(fine_, along_m, left_m, 2.2);
    return 1 - std::hypot(x, y) / shape.RadiusM(std::atan2(y, x)) + ragged;
  };
  // The sun stands ahead to the right: the far rim throws its shadow towards the driver.
  const double shadow_m = 0.16 + 0.12 * hazard.radius_m;
  for (int row = first_row; row <= last_row; ++row) {
    const double along_m = tile_m + (row + 0.5) * kResolutionM;
    for (int column = std::max(0, first); column <= std::min(image.cols - 1, last); ++column) {
      const double left_m = kStripRightM + (column + 0.5) * kResolutionM;
      const double depth = inside(along_m, left_m);
      if (depth < -0.5) continue;
      auto& pixel = image.at<cv::Vec3b>(row, column);
      const float fine = Noise(fine_, along_m, left_m, 1.4);
      const float coarse = Noise(coarse_, along_m, left_m, 0.45);
      if (depth <= 0) {
        // Broken edge: darker towards the rim.
        const double dark = 0.3 * std::exp(depth * 9) * (0.8 + 0.5 * fine);
        pixel = Clamp(static_cast<float>(1 - std::max(0.0, dark)) * cv::Vec3f(pixel));
        continue;
      }
      const bool lit = inside(along_m + shadow_m, left_m - 0.45 * shadow_m) > 0;
      const double lip = SmoothStep(0.16, 0.0, inside(along_m - 0.05, left_m + 0.02));
      const cv::Vec3f floor_colour = cv::Vec3f(88, 108, 128) * (1 + 0.2F * fine + 0.14F * coarse);
      const cv::Vec3f shade = cv::Vec3f(30, 31, 34) * (1 + 0.3F * fine);
      cv::Vec3f colour = lit ? floor_colour : shade;
      if (lit) colour *= static_cast<float>(1 + 0.25 * lip);
      const auto cover = static_cast<float>(SmoothStep(0, 0.05, depth));
      pixel = Clamp((1 - cover) * cv::Vec3f(pixel) + cover * colour);
    }
  }
}

GeneratedGround::Pyramid GeneratedGround::PaintTile(std::int64_t tile) const {
  cv::Mat image(TileLength(), StripWidth(), CV_8UC3);
  PaintAsphalt(tile, image);
  PaintWear(tile, image);
  PaintMarkings(tile, image);
  for (const GeneratedHazard& hazard : world_.hazards) {
    const double tile_m = static_cast<double>(tile) * kTileM;
    if (hazard.class_name != "pothole" || hazard.along_m < tile_m - 3 ||
        hazard.along_m > tile_m + kTileM + 3) {
      continue;
    }
    PaintPothole(hazard, tile, image);
  }
  cv::GaussianBlur(image, image, {}, 0.7);
  return BuildPyramid(image);
}

void GeneratedGround::Prepare(double from_m, double to_m) {
  const auto first = static_cast<std::int64_t>(std::floor(from_m / kTileM));
  const auto last = static_cast<std::int64_t>(std::floor(to_m / kTileM));
  while (!tiles_.empty() && tiles_.begin()->first < first) tiles_.erase(tiles_.begin());
  for (std::int64_t tile = first; tile <= last; ++tile) {
    if (tiles_.count(tile) == 0) tiles_.emplace(tile, PaintTile(tile));
  }
}

cv::Vec3f GeneratedGround::At(double along_m, double left_m, int level) const {
  const double pixel_m = kResolutionM * static_cast<double>(1 << level);
  const auto l = static_cast<std::size_t>(level);
  const auto tile = tiles_.find(static_cast<std::int64_t>(std::floor(along_m / kTileM)));
  if (tile == tiles_.end() || left_m < kStripRightM || left_m > kStripLeftM) {
    return Bilinear(grass_[l], along_m / pixel_m - 0.5, left_m / pixel_m - 0.5, true);
  }
  const double row = (along_m - static_cast<double>(tile->first) * kTileM) / pixel_m - 0.5;
  return Bilinear(tile->second[l], row, (left_m - kStripRightM) / pixel_m - 0.5, false);
}

}  // namespace livemap
