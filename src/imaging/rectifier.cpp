#include "imaging/rectifier.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "common/error.h"

namespace livemap::imaging {
namespace {

template <int kRows, int kColumns>
bool IsFinite(const cv::Matx<double, kRows, kColumns>& matrix) {
  return std::all_of(std::begin(matrix.val), std::end(matrix.val),
                     [](double value) { return std::isfinite(value); });
}

template <int kRows, int kColumns>
std::string CalibrationMatrixText(const cv::Matx<double, kRows, kColumns>& matrix) {
  std::ostringstream text;
  text << matrix;
  return text.str();
}

bool IsFisheye(const CameraCalibration& calibration) {
  return calibration.distortion_model == "equidistant" || calibration.distortion_model == "fisheye";
}

void CheckRectifierDistortion(const CameraCalibration& calibration) {
  const std::vector<double>& d = calibration.distortion;
  if (!std::all_of(d.begin(), d.end(), [](double value) { return std::isfinite(value); })) {
    throw Error("the calibration has a distortion coefficient that is not a finite number");
  }
  const std::string& model = calibration.distortion_model;
  const std::size_t n = d.size();
  const bool pinhole = model.empty() || model == "plumb_bob" || model == "rational_polynomial";
  if (!pinhole && !IsFisheye(calibration)) {
    throw Error("the calibration's distortion model is '" + model +
                "', accepted are plumb_bob, rational_polynomial and equidistant");
  }
  const bool accepted = n == 0 || n == 4 || (pinhole && (n == 5 || n == 8 || n == 12 || n == 14));
  if (!accepted) {
    throw Error("the calibration has " + std::to_string(n) + " distortion coefficients, '" + model +
                "' takes " + (pinhole ? "0, 4, 5, 8, 12 or 14" : "0 or 4"));
  }
}

void CheckCalibration(const CameraCalibration& calibration) {
  const auto side_is_bad = [](int side) { return side <= 0 || side > Rectifier::kMaxSide; };
  if (side_is_bad(calibration.width) || side_is_bad(calibration.height)) {
    throw Error("the calibration's image size is " + std::to_string(calibration.width) + "x" +
                std::to_string(calibration.height) + ", accepted is 1 to " +
                std::to_string(Rectifier::kMaxSide) + " per side");
  }
  if (!IsFinite(calibration.k) || calibration.k(0, 0) <= 0 || calibration.k(1, 1) <= 0) {
    throw Error("the calibration's K is " + CalibrationMatrixText(calibration.k) +
                ", it must be finite with positive focal lengths");
  }
  if (!IsFinite(calibration.r) || std::abs(cv::determinant(calibration.r) - 1) > 0.01) {
    throw Error("the calibration's R is " + CalibrationMatrixText(calibration.r) +
                ", it must be a rotation");
  }
  if (!IsFinite(calibration.p))
    throw Error("the calibration's P holds a number that is not finite");
  CheckRectifierDistortion(calibration);
}

OutputSize CompleteOutputSize(OutputSize wanted, const CameraCalibration& calibration) {
  const double aspect = static_cast<double>(calibration.width) / calibration.height;
  if (wanted.width < 0 || wanted.height < 0 || wanted.width > Rectifier::kMaxSide ||
      wanted.height > Rectifier::kMaxSide) {
    throw Error("the output size is " + std::to_string(wanted.width) + "x" +
                std::to_string(wanted.height) + ", accepted is 0 (as the input) to " +
                std::to_string(Rectifier::kMaxSide) + " per side");
  }
  if (wanted.width == 0 && wanted.height == 0) return {calibration.width, calibration.height};
  if (wanted.width == 0) wanted.width = std::max(1, cvRound(wanted.height * aspect));
  if (wanted.height == 0) wanted.height = std::max(1, cvRound(wanted.width / aspect));
  return wanted;
}

}  // namespace

bool operator==(const CameraCalibration& a, const CameraCalibration& b) {
  return a.width == b.width && a.height == b.height && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion && a.k == b.k && a.r == b.r && a.p == b.p;
}

Rectifier::Rectifier(const CameraCalibration& calibration, OutputSize output_size)
    : input_(calibration) {
  CheckCalibration(calibration);
  const cv::Matx33d p_left = calibration.p.get_minor<3, 3>(0, 0);
  const bool has_p = p_left(0, 0) > 0 && p_left(1, 1) > 0;
  if (!has_p && cv::norm(calibration.p) > 0) {
    throw Error("the calibration's P is " + CalibrationMatrixText(calibration.p) +
                ", it must have positive focal lengths or be all zeros");
  }
  rectified_k_ = has_p ? p_left : calibration.k;
  const bool distorted = std::any_of(calibration.distortion.begin(), calibration.distortion.end(),
                                     [](double value) { return value != 0; });
  remaps_ = distorted || IsFisheye(calibration) ||
            cv::norm(rectified_k_ - calibration.k, cv::NORM_INF) > 1e-9 ||
            cv::norm(calibration.r - cv::Matx33d::eye(), cv::NORM_INF) > 1e-12;

  const OutputSize size = CompleteOutputSize(output_size, calibration);
  resizes_ = size.width != calibration.width || size.height != calibration.height;
  const double sx = static_cast<double>(size.width) / calibration.width;
  const double sy = static_cast<double>(size.height) / calibration.height;
  const cv::Matx33d scale(sx, 0, 0.5 * sx - 0.5, 0, sy, 0.5 * sy - 0.5, 0, 0, 1);
  output_.width = size.width;
  output_.height = size.height;
  output_.distortion_model = "plumb_bob";
  output_.distortion.assign(5, 0.0);
  output_.k = scale * rectified_k_;
  const cv::Vec3d baseline = has_p ? cv::Vec3d(calibration.p.col(3).val) : cv::Vec3d();
  const cv::Vec3d scaled(baseline[0] * sx, baseline[1] * sy, baseline[2]);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) output_.p(row, column) = output_.k(row, column);
    output_.p(row, 3) = scaled[row];
  }
  if (remaps_) ComputeMaps();
}

void Rectifier::ComputeMaps() {
  const cv::Size size(input_.width, input_.height);
  if (IsFisheye(input_)) {
    std::vector<double> distortion = input_.distortion;
    distortion.resize(4, 0.0);
    cv::fisheye::initUndistortRectifyMap(input_.k, distortion, input_.r, rectified_k_, size,
                                         CV_16SC2, map_xy_, map_fraction_);
    return;
  }
  cv::initUndistortRectifyMap(input_.k, input_.distortion, input_.r, rectified_k_, size, CV_16SC2,
                              map_xy_, map_fraction_);
}

cv::Mat Rectifier::Apply(const cv::Mat& image) const {
  cv::Mat rectified = image;
  if (remaps_) {
    cv::remap(image, rectified, map_xy_, map_fraction_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  }
  if (!resizes_) return rectified;
  cv::Mat resized;
  const bool shrinks = output_.width < input_.width || output_.height < input_.height;
  cv::resize(rectified, resized, cv::Size(output_.width, output_.height), 0, 0,
             shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
  return resized;
}

}  // namespace livemap::imaging
