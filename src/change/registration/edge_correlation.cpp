#include "change/registration/edge_correlation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::change {
namespace {

constexpr int kOrientations = 4;
constexpr int kWorkingWidth = 320;  // Pixels.
constexpr double kSmoothingPx = 0.8;
const cv::Size kNeighbourhood(17, 17);  // Pixels within which an edge is measured by the others.
constexpr double kPlainGradient = 20;   // Grey levels: what is weaker everywhere is no edge.
constexpr int kLeadCells = 3;
constexpr double kMinEnergy = 1e-3;
constexpr int kBlockCells = 32;
constexpr int kParallaxCells = 5;

cv::Mat GreyForEdges(const cv::Mat& picture) {
  if (picture.channels() == 1) return picture;
  cv::Mat grey;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// Strength of the gradient against the gradients around it, and its direction.
struct Gradient {
  cv::Mat strength;
  cv::Mat x;  // Of unit length with y.
  cv::Mat y;
};

Gradient EdgeGradientOf(const cv::Mat& grey) {
  Gradient gradient;
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32FC1);
  cv::GaussianBlur(smooth, smooth, cv::Size(), kSmoothingPx);
  cv::Sobel(smooth, gradient.x, CV_32F, 1, 0);
  cv::Sobel(smooth, gradient.y, CV_32F, 0, 1);
  cv::Mat magnitude;
  cv::magnitude(gradient.x, gradient.y, magnitude);
  cv::Mat around = magnitude.mul(magnitude);
  // Nearly a Gaussian's window, at a tenth of its cost.
  for (int i = 0; i < 3; ++i) cv::blur(around, around, kNeighbourhood);
  cv::sqrt(cv::max(around, 0.0), around);  // Running sums end a little below 0.
  gradient.strength = magnitude / (around + kPlainGradient);
  const cv::Mat length = cv::max(magnitude, 1e-6);
  gradient.x /= length;
  gradient.y /= length;
  return gradient;
}

/// Sums of squares over any rectangle of cells.
class EdgeEnergy {
 public:
  explicit EdgeEnergy(const cv::Mat& cells) {
    cv::Mat squared;
    cv::transform(cells.mul(cells), squared, cv::Matx14f(1, 1, 1, 1));
    cv::integral(squared, sums_, CV_64F);
  }

  double In(const cv::Rect& cells) const {
    return sums_.at<double>(cells.y, cells.x) + sums_.at<double>(cells.br().y, cells.br().x) -
           sums_.at<double>(cells.y, cells.br().x) - sums_.at<double>(cells.br().y, cells.x);
  }

 private:
  cv::Mat sums_;
};

/// The cells that a picture fills when it is scaled about its middle, as far as they are its own.
cv::Rect EdgeCellsFilledBy(double scale, cv::Size size) {
  const int left = std::max(0, cvCeil((1 - scale) * (size.width - 1) / 2));
  const int top = std::max(0, cvCeil((1 - scale) * (size.height - 1) / 2));
  return {left, top, size.width - 2 * left, size.height - 2 * top};
}

/// One correlation for every shift up to `most`, at one scale of the earlier picture.
cv::Mat EdgeCorrelations(const cv::Mat& before, double scale, const cv::Mat& after_padded,
                         const EdgeEnergy& after_energy, const cv::Point& most) {
  const cv::Matx23d about_the_middle{scale, 0,     (1 - scale) * (before.cols - 1) / 2,
                                     0,     scale, (1 - scale) * (before.rows - 1) / 2};
  cv::Mat scaled;
  cv::warpAffine(before, scaled, about_the_middle, before.size());
  const EdgeEnergy before_energy(scaled);
  const cv::Rect filled = EdgeCellsFilledBy(scale, before.size());
  cv::Mat correlations;
  cv::matchTemplate(after_padded, scaled, correlations, cv::TM_CCORR);
  for (int row = 0; row < correlations.rows; ++row) {
    for (int column = 0; column < correlations.cols; ++column) {
      const cv::Point shift = cv::Point(column, row) - most;
      const cv::Rect overlap = (filled + shift) & cv::Rect(cv::Point(), before.size());
      const double energy = before_energy.In(overlap - shift) * after_energy.In(overlap);
      correlations.at<float>(row, column) /=
          static_cast<float>(std::sqrt(std::max(energy, kMinEnergy)));
    }
  }
  return correlations;
}

/// Where a parabola through three values a step apart is highest, in steps from the middle one.
double CorrelationVertex(double before, double here, double after) {
  const double curvature = before - 2 * here + after;
  if (curvature >= 0) return 0;
  return std::clamp((before - after) / (2 * curvature), -0.5, 0.5);
}

/// Best of all scales and shifts, as indices.
struct Peak {
  int scale = 0;
  cv::Point shift;
  double correlation = -1;
};

Peak FindCorrelationPeak(const std::vector<cv::Mat>& correlations) {
  Peak peak;
  for (std::size_t i = 0; i < correlations.size(); ++i) {
    double highest = 0;
    cv::Point at;
    cv::minMaxLoc(correlations[i], nullptr, &highest, nullptr, &at);
    if (highest > peak.correlation) peak = {static_cast<int>(i), at, highest};
  }
  return peak;
}

/// The highest correlation away from the peak's shift, at any scale.
double BestCorrelationElsewhere(const std::vector<cv::Mat>& correlations, const Peak& peak) {
  const cv::Size size = correlations[0].size();
  cv::Mat elsewhere(size, CV_8UC1, cv::Scalar(255));
  cv::rectangle(elsewhere, peak.shift - cv::Point(kLeadCells, kLeadCells),
                peak.shift + cv::Point(kLeadCells, kLeadCells), 0, cv::FILLED);
  double best = -1;
  for (const cv::Mat& correlation : correlations) {
    double highest = 0;
    cv::minMaxLoc(correlation, nullptr, &highest, nullptr, nullptr, elsewhere);
    best = std::max(best, highest);
  }
  return best;
}

/// The peak's place to a fraction of a step: x, y of the shift and index of the scale.
cv::Vec3d RefinedCorrelationPeak(const std::vector<cv::Mat>& correlations, const Peak& peak) {
  const auto at = [&](int scale, int x, int y) {
    const cv::Mat& values = correlations[static_cast<std::size_t>(scale)];
    return static_cast<double>(values.at<float>(y, x));
  };
  const auto [x, y] = peak.shift;
  const int scale = peak.scale;
  cv::Vec3d refined(x, y, scale);
  if (x > 0 && x + 1 < correlations[0].cols) {
    refined[0] += CorrelationVertex(at(scale, x - 1, y), peak.correlation, at(scale, x + 1, y));
  }
  if (y > 0 && y + 1 < correlations[0].rows) {
    refined[1] += CorrelationVertex(at(scale, x, y - 1), peak.correlation, at(scale, x, y + 1));
  }
  if (scale > 0 && scale + 1 < static_cast<int>(correlations.size())) {
    refined[2] += CorrelationVertex(at(scale - 1, x, y), peak.correlation, at(scale + 1, x, y));
  }
  return refined;
}

/// The index-th of `search.scales` that rise from one over max_scale to max_scale by one ratio.
double CorrelationScaleAt(double index, const EdgeSearch& search) {
  return std::pow(search.max_scale, 2 * index / (search.scales - 1) - 1);
}

void CheckEdgeCellsAlike(const EdgeCells& before, const EdgeCells& after) {
  if (before.picture != after.picture || before.cells.size() != after.cells.size()) {
    throw Error("edges of pictures of different sizes cannot be compared");
  }
}

}  // namespace

bool HasEdgeCells(cv::Size picture) {
  constexpr int kMinSide = 32;
  const int shorter = std::min(picture.width, picture.height);
  return shorter >= kMinSide && std::max(picture.width, picture.height) / 4.0 <= shorter;
}

EdgeCells ExtractEdgeCells(const cv::Mat& picture, EdgeDetail detail) {
  if (!HasEdgeCells(picture.size()) || (picture.type() != CV_8UC1 && picture.type() != CV_8UC3)) {
    throw Error("edges are looked for in a picture of " + std::to_string(picture.cols) + "x" +
                std::to_string(picture.rows) +
                ", accepted are 8 bit grey or colour, 32 pixels and more, a side up to four times "
                "the other");
  }
  const int columns = static_cast<int>(detail);
  const int cell_px = kWorkingWidth / columns;
  const int rows = static_cast<int>(std::lround(1.0 * columns * picture.rows / picture.cols));
  cv::Mat grey;
  cv::resize(GreyForEdges(picture), grey, cv::Size(kWorkingWidth, rows * cell_px), 0, 0,
             picture.cols > kWorkingWidth ? cv::INTER_AREA : cv::INTER_LINEAR);
  const Gradient gradient = EdgeGradientOf(grey);
  // Twice the angle: an edge may be dark on the left by day and on the right in snow.
  const cv::Mat cosine = gradient.x.mul(gradient.x) - gradient.y.mul(gradient.y);
  const cv::Mat sine = 2 * gradient.x.mul(gradient.y);
  std::vector<cv::Mat> orientations;
  for (int k = 0; k < kOrientations; ++k) {
    const double angle = 2 * CV_PI * k / kOrientations;
    cv::Mat part = cv::max(std::cos(angle) * cosine + std::sin(angle) * sine, 0);
    part = part.mul(gradient.strength);
    cv::GaussianBlur(part, part, cv::Size(), 0.6 * cell_px);
    cv::resize(part, part, cv::Size(columns, rows), 0, 0, cv::INTER_AREA);
    orientations.push_back(part - cv::mean(part)[0]);
  }
  EdgeCells edges;
  edges.picture = picture.size();
  cv::merge(orientations, edges.cells);
  return edges;
}

EdgeAlignment AlignByEdges(const EdgeCells& before, const EdgeCells& after,
                           const EdgeSearch& search) {
  CheckEdgeCellsAlike(before, after);
  const cv::Size size = after.cells.size();
  const cv::Point most(static_cast<int>(search.max_shift_x * size.width),
                       static_cast<int>(search.max_shift_y * size.height));
  cv::Mat padded;
  cv::copyMakeBorder(after.cells, padded, most.y, most.y, most.x, most.x, cv::BORDER_CONSTANT);
  const EdgeEnergy after_energy(after.cells);
  std::vector<cv::Mat> correlations(static_cast<std::size_t>(search.scales));
  cv::parallel_for_(cv::Range(0, search.scales), [&](const cv::Range& scales) {
    for (int i = scales.start; i < scales.end; ++i) {
      correlations[static_cast<std::size_t>(i)] =
          EdgeCorrelations(before.cells, CorrelationScaleAt(i, search), padded, after_energy, most);
    }
  });
  const Peak peak = FindCorrelationPeak(correlations);
  const cv::Vec3d refined = RefinedCorrelationPeak(correlations, peak);

  EdgeAlignment alignment;
  alignment.correlation = peak.correlation;
  alignment.lead = peak.correlation - BestCorrelationElsewhere(correlations, peak);
  // Cells to pixels; a cell's middle lies half a cell from its edge.
  const double scale = CorrelationScaleAt(refined[2], search);
  const cv::Vec2d cell_px(1.0 * before.picture.width / size.width,
                          1.0 * before.picture.height / size.height);
  for (int axis = 0; axis < 2; ++axis) {
    const double cells = axis == 0 ? size.width : size.height;
    const double shift = refined[axis] - (axis == 0 ? most.x : most.y);
    const double shift_cells = (1 - scale) * (cells - 1) / 2 + shift;
    const double half_px = (cell_px[axis] - 1) / 2;
    alignment.after_from_before(axis, axis) = scale;
    alignment.after_from_before(axis, 2) = shift_cells * cell_px[axis] + (1 - scale) * half_px;
  }
  return alignment;
}

double EdgeAgreement(const EdgeCells& before, const EdgeCells& after) {
  CheckEdgeCellsAlike(before, after);
  const cv::Rect all(cv::Point(), after.cells.size());
  const int columns = all.width / kBlockCells;
  const int blocks = columns * (all.height / kBlockCells);
  std::vector<cv::Vec2d> found(static_cast<std::size_t>(blocks));  // Weighted best, and weight.
  cv::parallel_for_(cv::Range(0, blocks), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const cv::Rect block(i % columns * kBlockCells, i / columns * kBlockCells, kBlockCells,
                           kBlockCells);
      const double weight = cv::norm(after.cells(block));
      if (weight * weight < kMinEnergy) continue;
      const cv::Point margin(kParallaxCells, kParallaxCells);
      const cv::Rect near = cv::Rect(block.tl() - margin, block.br() + margin) & all;
      cv::Mat correlations;
      cv::matchTemplate(before.cells(near), after.cells(block), correlations, cv::TM_CCORR_NORMED);
      double best = 0;
      cv::minMaxLoc(correlations, nullptr, &best);
      found[static_cast<std::size_t>(i)] = {weight * best, weight};
    }
  });
  const cv::Vec2d sum = std::accumulate(found.begin(), found.end(), cv::Vec2d());
  return sum[1] > 0 ? sum[0] / sum[1] : 0;
}

}  // namespace livemap::change
