#pragma once

#include <opencv2/core.hpp>

namespace livemap::change {

/// How strong the edges of a picture are and how they run, in coarse cells: what a street shows by
/// day, at dusk, in rain and in snow alike. Four orientations, each edge measured by the edges
/// around it (as N. Dalal, B. Triggs, "Histograms of Oriented Gradients", CVPR 2005).
struct EdgeCells {
  cv::Size picture;  ///< Pixels.
  cv::Mat cells;     ///< CV_32FC4; each orientation's mean is 0.
};

/// How many cells a picture is wide.
enum class EdgeDetail { kCoarse = 80, kFine = 160 };

/// Whether pictures of this size have cells: at least 32x32 pixels, and at most four times as wide
/// as they are high or the reverse.
bool HasEdgeCells(cv::Size picture);

/// `picture`: CV_8UC1 or CV_8UC3 (BGR) of a size that HasEdgeCells; Error otherwise.
EdgeCells ExtractEdgeCells(const cv::Mat& picture, EdgeDetail detail);

/// What AlignByEdges looks through.
struct EdgeSearch {
  double max_shift_x = 0.2;   ///< Share of the width, to either side.
  double max_shift_y = 0.15;  ///< Share of the height.
  double max_scale = 1.3;     ///< And its inverse.
  int scales = 9;             ///< From one to the other, at least 3.
};

/// The best of all shifts and scales.
struct EdgeAlignment {
  cv::Matx33d after_from_before = cv::Matx33d::eye();  ///< Pixels: a scale and a shift.
  double correlation = 0;                              ///< -1 to 1, over what overlaps.
  /// By how much it exceeds the best that lies more than three cells from it: little where the
  /// pictures fit anywhere or nowhere.
  double lead = 0;
};

/// Correlates the coarse edges of two pictures of one size (Error otherwise) for every scale and
/// shift of `search`; the best is placed to a fraction of a cell by a parabola.
EdgeAlignment AlignByEdges(const EdgeCells& before, const EdgeCells& after,
                           const EdgeSearch& search = {});

/// How well the fine edges of two aligned pictures agree, 0 to 1: block by block the best
/// correlation within five cells, for parallax, averaged by the strength of a block's edges. Two
/// streets of one shape align; their windows and lamps do not agree.
double EdgeAgreement(const EdgeCells& before, const EdgeCells& after);

}  // namespace livemap::change
