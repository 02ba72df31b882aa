#include "change/methods/change_probabilities.h"

#include "common/error.h"

namespace livemap::change {

std::string SizeText(cv::Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

void CheckProbabilities(const ChangeProbabilities& probabilities, cv::Size size,
                        const std::string& name) {
  const std::size_t count = probabilities.of_class.size();
  if (count != 2 && count != protocol::kChangeClasses) {
    throw Error("prediction '" + name + "' has " + std::to_string(count) +
                " classes, accepted are 2 and " + std::to_string(protocol::kChangeClasses));
  }
  for (const cv::Mat& image : probabilities.of_class) {
    if (image.type() != CV_32FC1 || image.size() != size) {
      throw Error("prediction '" + name + "' is " + SizeText(image.size()) +
                  ", accepted is the size of its pair, " + SizeText(size));
    }
    // Unlike checkRange this refuses NaN and says nothing to stderr.
    for (int row = 0; row < image.rows; ++row) {
      const auto* values = image.ptr<float>(row);
      for (int column = 0; column < image.cols; ++column) {
        if (values[column] >= 0.0F && values[column] <= 1.0F) continue;
        throw Error("prediction '" + name + "' holds " + std::to_string(values[column]) +
                    ", accepted are probabilities from 0 to 1");
      }
    }
  }
}

cv::Mat MostLikely(const ChangeProbabilities& probabilities) {
  const cv::Mat& first = probabilities.of_class.at(0);
  cv::Mat classes = cv::Mat::zeros(first.size(), CV_8UC1);
  cv::Mat best = first.clone();
  for (std::size_t i = 1; i < probabilities.of_class.size(); ++i) {
    const cv::Mat& image = probabilities.of_class[i];
    const cv::Mat higher = image > best;
    classes.setTo(cv::Scalar(static_cast<double>(i)), higher);
    image.copyTo(best, higher);
  }
  return classes;
}

}  // namespace livemap::change
