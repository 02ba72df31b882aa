#pragma once

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace livemap::change {

/// A road of asphalt with painted marks, CV_8UC3; another `seed` is another road.
inline cv::Mat RoadPicture(std::uint64_t seed, cv::Size size = {960, 480}) {
  cv::RNG draw(seed);
  cv::Mat noise(size.height / 4, size.width / 4, CV_8UC3);
  draw.fill(noise, cv::RNG::NORMAL, 110, 12);
  cv::Mat picture;
  cv::resize(noise, picture, size, 0, 0, cv::INTER_CUBIC);
  for (int i = 0; i < 60; ++i) {
    const cv::Point at(draw.uniform(0, size.width), draw.uniform(size.height * 2 / 5, size.height));
    const cv::Size mark(draw.uniform(4, 40), draw.uniform(2, 8));
    cv::rectangle(picture, cv::Rect(at, mark), cv::Scalar::all(draw.uniform(40, 220)), cv::FILLED);
  }
  cv::GaussianBlur(picture, picture, {}, 1.0);
  return picture;
}

/// How the road of a second drive lies that stood somewhat further back and beside.
inline cv::Matx33d RoadWarp() { return {1.04, 0.06, -45, 0.002, 1.05, -7, 0, 0.0001, 1}; }

}  // namespace livemap::change
