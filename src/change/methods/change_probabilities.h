#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "protocol/change_class.h"

namespace livemap::change {

/// In masks of the truth: nobody says what this pixel shows.
constexpr std::uint8_t kLeftOutPixel = 255;

/// What a method says about each pixel: one CV_32FC1 image per class, [0, 1], together 1. Either
/// kChangeClasses images, in the order of ChangeClass, or two: no change, change.
struct ChangeProbabilities {
  std::vector<cv::Mat> of_class;

  bool tells_classes() const { return of_class.size() == protocol::kChangeClasses; }
};

/// "640x480", for messages.
std::string SizeText(cv::Size size);

/// Throws Error, with `name` in it, when the images are not two or ten, not of `size`, not
/// CV_32FC1, or hold a value that is not within [0, 1].
void CheckProbabilities(const ChangeProbabilities& probabilities, cv::Size size,
                        const std::string& name);
/// The most likely class per pixel, CV_8UC1; of two images 1 stands for change. The first among
/// equals.
cv::Mat MostLikely(const ChangeProbabilities& probabilities);

}  // namespace livemap::change
