#include "odometry/edge/edge_extractor.h"

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc/structured_edge_detection.hpp>

#include "common/error.h"

namespace livemap::odometry {
namespace {

constexpr double kNarrowSigmaPx = 1.0;
constexpr double kWideSigmaPx = 1.6;  // At this ratio the difference is nearest to a Laplacian.
constexpr float kMinLikelihood = 0.1F;

int EdgeGradientL1(const cv::Mat& dx, const cv::Mat& dy, int y, int x) {
  return std::abs(dx.ptr<short>(y)[x]) + std::abs(dy.ptr<short>(y)[x]);
}

cv::Ptr<cv::ximgproc::StructuredEdgeDetection> LoadEdgeForest(const std::string& path) {
  if (path.empty() || !std::filesystem::is_regular_file(path)) {
    throw Error("structured edges need their model file (structured_model), there is none at '" +
                path + "'");
  }
  try {
    return cv::ximgproc::createStructuredEdgeDetection(path);
  } catch (const cv::Exception& error) {
    throw Error("structured_model '" + path + "' cannot be read: " + error.err);
  }
}

}  // namespace

EdgeKind ParseEdgeKind(const std::string& name) {
  for (const EdgeKind kind : {EdgeKind::kCanny, EdgeKind::kLaplacianOfGaussian, EdgeKind::kSobel,
                              EdgeKind::kStructured}) {
    if (name == EdgeKindName(kind)) return kind;
  }
  throw Error("edge kind is '" + name + "'; accepted are canny, log, sobel, structured");
}

const char* EdgeKindName(EdgeKind kind) {
  switch (kind) {
    case EdgeKind::kCanny:
      return "canny";
    case EdgeKind::kLaplacianOfGaussian:
      return "log";
    case EdgeKind::kSobel:
      return "sobel";
    case EdgeKind::kStructured:
      return "structured";
  }
  return "";
}

EdgeExtractor::EdgeExtractor(const Config& config) : config_(config) {
  if (config_.kind == EdgeKind::kStructured) forest_ = LoadEdgeForest(config_.structured_model);
}
EdgeExtractor::~EdgeExtractor() = default;
EdgeExtractor::EdgeExtractor(EdgeExtractor&&) noexcept = default;
EdgeExtractor& EdgeExtractor::operator=(EdgeExtractor&&) noexcept = default;

const cv::Mat& EdgeExtractor::Extract(const cv::Mat& grey) {
  switch (config_.kind) {
    case EdgeKind::kCanny:
      return canny_.Extract(grey, config_.strong_share, config_.min_gradient);
    case EdgeKind::kLaplacianOfGaussian:
      ExtractLaplacian(grey);
      break;
    case EdgeKind::kSobel:
      ExtractSobel(grey);
      break;
    case EdgeKind::kStructured:
      ExtractStructured(grey);
      break;
  }
  return edges_;
}

void EdgeExtractor::ExtractSobel(const cv::Mat& grey) {
  canny_.Differentiate(grey);
  const int threshold = canny_.StrongThreshold(config_.strong_share, config_.min_gradient);
  edges_.create(grey.size(), CV_8UC1);
  for (int y = 0; y < grey.rows; ++y) {
    std::uint8_t* row = edges_.ptr(y);
    for (int x = 0; x < grey.cols; ++x) {
      row[x] = EdgeGradientL1(canny_.dx(), canny_.dy(), y, x) > threshold ? 255 : 0;
    }
  }
}

void EdgeExtractor::ExtractLaplacian(const cv::Mat& grey) {
  canny_.Differentiate(grey);
  const auto threshold =
      static_cast<int>(CannyDetector::kWeakOfStrong *
                       canny_.StrongThreshold(config_.strong_share, config_.min_gradient));
  cv::GaussianBlur(grey, narrow_, {}, kNarrowSigmaPx);
  cv::GaussianBlur(grey, wide_, {}, kWideSigmaPx);
  edges_.create(grey.size(), CV_8UC1);
  edges_.setTo(0);
  const auto difference = [this](int y, int x) {
    return int{narrow_.ptr(y)[x]} - int{wide_.ptr(y)[x]};
  };
  for (int y = 1; y < grey.rows - 1; ++y) {
    for (int x = 1; x < grey.cols - 1; ++x) {
      const int here = difference(y, x);
      const bool crossing = here >= 0 && (difference(y, x + 1) < 0 || difference(y, x - 1) < 0 ||
                                          difference(y + 1, x) < 0 || difference(y - 1, x) < 0);
      if (crossing && EdgeGradientL1(canny_.dx(), canny_.dy(), y, x) > threshold)
        edges_.ptr(y)[x] = 255;
    }
  }
}

void EdgeExtractor::ExtractStructured(const cv::Mat& grey) {
  cv::cvtColor(grey, colour_, cv::COLOR_GRAY2RGB);
  colour_.convertTo(colour_float_, CV_32F, 1.0 / 255);
  forest_->detectEdges(colour_float_, likelihood_);
  forest_->computeOrientation(likelihood_, orientation_);
  forest_->edgesNms(likelihood_, orientation_, thinned_);
  cv::compare(thinned_, kMinLikelihood, edges_, cv::CMP_GT);
}

}  // namespace livemap::odometry
