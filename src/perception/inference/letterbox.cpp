#include "perception/inference/letterbox.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "common/text.h"

namespace livemap::perception {

Letterbox::Letterbox(const ModelManifest::Input& input,
                     const ModelManifest::Normalisation& normalisation)
    : input_(input) {
  source_channel_ = input_.channels == ChannelOrder::kRgb ? std::array<int, 3>{2, 1, 0}
                                                          : std::array<int, 3>{0, 1, 2};
  for (std::size_t plane = 0; plane < 3; ++plane) {
    for (std::size_t pixel = 0; pixel < 256; ++pixel) {
      normalised_[plane][pixel] =
          (static_cast<float>(pixel) - normalisation.mean[plane]) / normalisation.std[plane];
    }
  }
}

double Letterbox::Scale(cv::Size size) const {
  return std::min(static_cast<double>(input_.width) / size.width,
                  static_cast<double>(input_.height) / size.height);
}

cv::Size Letterbox::Fitted(cv::Size size) const {
  const double scale = Scale(size);
  // A side of a very long image would round to nothing.
  return {std::clamp(cvRound(size.width * scale), 1, input_.width),
          std::clamp(cvRound(size.height * scale), 1, input_.height)};
}

cv::Mat Letterbox::Scaled(const cv::Mat& bgr) {
  if (bgr.empty()) throw Error("an image is empty, accepted is at least 1 x 1 pixel");
  if (bgr.dims != 2 || bgr.type() != CV_8UC3) {
    throw Error("an image has " + PixelText(static_cast<int>(8 * bgr.elemSize1()), bgr.channels()) +
                ", accepted are " + PixelText(8, 3) + " (BGR)");
  }
  const cv::Size fitted = Fitted(bgr.size());
  if (fitted == bgr.size()) return bgr;
  cv::resize(bgr, scaled_, fitted, 0, 0, cv::INTER_LINEAR);
  return scaled_;
}

const cv::Mat& Letterbox::FillPixels(const cv::Mat& bgr) {
  const cv::Mat source = Scaled(bgr);
  const cv::Size size(input_.width, input_.height);
  pixels_.create(size, CV_8UC3);
  if (source.size() != size) pixels_.setTo(cv::Scalar::all(input_.pad_value));
  cv::Mat filled = pixels_(cv::Rect({}, source.size()));
  if (input_.channels == ChannelOrder::kRgb) {
    cv::cvtColor(source, filled, cv::COLOR_BGR2RGB);
  } else {
    source.copyTo(filled);
  }
  return pixels_;
}

const cv::Mat& Letterbox::Fill(const cv::Mat& bgr) {
  const cv::Mat source = Scaled(bgr);
  const int shape[] = {1, 3, input_.height, input_.width};
  tensor_.create(4, shape, CV_32F);
  for (std::size_t plane = 0; plane < 3; ++plane) {
    const std::array<float, 256>& normalised = normalised_[plane];
    const float padding = normalised[static_cast<std::size_t>(input_.pad_value)];
    const int channel = source_channel_[plane];
    for (int row = 0; row < input_.height; ++row) {
      float* target = tensor_.ptr<float>(0, static_cast<int>(plane)) +
                      static_cast<std::ptrdiff_t>(row) * input_.width;
      const int filled = row < source.rows ? source.cols : 0;
      if (filled > 0) {
        const std::uint8_t* pixel = source.ptr<std::uint8_t>(row) + channel;
        for (int column = 0; column < filled; ++column) {
          target[column] = normalised[pixel[std::ptrdiff_t{3} * column]];
        }
      }
      std::fill(target + filled, target + input_.width, padding);
    }
  }
  return tensor_;
}

}  // namespace livemap::perception
