#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "odometry/edge/canny_detector.h"

namespace cv::ximgproc {
class StructuredEdgeDetection;
}

namespace livemap::odometry {

enum class EdgeKind {
  kCanny,                ///< Thresholds from the gradients' distribution.
  kLaplacianOfGaussian,  ///< Zero crossings of a difference of Gaussians (Marr, Hildreth).
  kSobel,                ///< Gradients above the threshold, not thinned.
  kStructured,           ///< Structured forests (Dollar, Zitnick), OpenCV ximgproc.
};

/// "canny", "log", "sobel", "structured"; Error names what is accepted.
EdgeKind ParseEdgeKind(const std::string& name);
const char* EdgeKindName(EdgeKind kind);

/// Finds the edge pixels of one grey image. Keeps its buffers from image to image; not thread-safe.
class EdgeExtractor {
 public:
  struct Config {
    EdgeKind kind = EdgeKind::kCanny;
    /// Share of the pixels whose gradient counts as strong; the weak threshold is 0.4 of the
    /// strong.
    double strong_share = 0.08;
    /// Gradients below this are noise, grey levels per px.
    double min_gradient = 4.0;
    /// Model of kStructured (OpenCV's model.yml.gz).
    std::string structured_model;
  };

  /// Throws Error when kStructured's model is missing or cannot be read.
  explicit EdgeExtractor(const Config& config);
  ~EdgeExtractor();
  EdgeExtractor(EdgeExtractor&&) noexcept;
  EdgeExtractor& operator=(EdgeExtractor&&) noexcept;

  /// Memory for images up to this size (Canny and Sobel; the other kinds are OpenCV's business).
  void Reserve(cv::Size size) { canny_.Reserve(size); }

  /// CV_8UC1 of the image's size, non-zero at edges; valid until the next call.
  const cv::Mat& Extract(const cv::Mat& grey);

 private:
  void ExtractSobel(const cv::Mat& grey);
  void ExtractLaplacian(const cv::Mat& grey);
  void ExtractStructured(const cv::Mat& grey);

  Config config_;
  CannyDetector canny_;
  cv::Mat edges_;
  cv::Mat narrow_, wide_;
  cv::Mat colour_, colour_float_, likelihood_, orientation_, thinned_;
  cv::Ptr<cv::ximgproc::StructuredEdgeDetection> forest_;
};

}  // namespace livemap::odometry
