#pragma once

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "change/measures/community_change_scores.h"
#include "change/measures/pooled_change_scores.h"
#include "change/objects/change_tracker.h"

namespace livemap::change {

/// Figures of one order of the two pictures.
struct ChangeFigures {
  PooledChangeScores pooled;
  CommunityChangeScores community;
};

/// What became of the directions of the regions that are changes in truth.
struct DirectionCounts {
  std::size_t right = 0;
  std::size_t wrong = 0;
  std::size_t unknown = 0;
};

/// Counts the regions of one pair: those where at least two in five of their `classes` (CV_8UC1,
/// ChangedClasses') have a direction in truth (ChangePair::direction), three in four of these the
/// same. The others are false, or several things at once.
void CountDirections(const std::vector<ChangeRegion>& regions, const cv::Mat& classes,
                     const cv::Mat& truth, DirectionCounts& counts);

/// The result of `livemap evaluate change`.
struct ChangeReport {
  std::string method;                    ///< Its name, or the folder of predictions.
  std::vector<std::string> directories;  ///< Absolute paths of the data.
  std::string registration;              ///< "none", "given", "edges", "homography" or "both".
  std::string region = "all";            ///< Of ChangeRegionNames.
  std::size_t refused = 0;               ///< Pairs that could not be registered: no change is said.
  std::vector<std::string> refusals;     ///< "NAME: why", in order.
  std::size_t hardly_changed = 0;        ///< Pairs left out as too little of them has changed.
  std::size_t unknown_colour_pixels = 0;
  /// Wall time of the method alone, ms; none where it did not run, as for predictions.
  std::optional<double> method_ms_p50;
  std::optional<double> registration_ms_p50;  ///< Of a pair, with its warp.
  ChangeFigures forward;
  /// Of `forward`'s pixels those that both pictures show, and those that no earlier picture shows,
  /// where a network guesses; none where the method did not run.
  std::optional<PooledChangeScores> compared;
  std::optional<PooledChangeScores> unseen;
  std::optional<double> on_board_threshold;   ///< A network's, from its manifest.
  std::optional<DirectionCounts> directions;  ///< None where no pair has them in truth.
  bool has_reversed = false;
  ChangeFigures reversed;  ///< The two aligned pictures swapped.
};

/// Why nothing was measured: no pixel of any pair counts. None where one does.
std::optional<std::string> WhyNothingMeasured(const ChangeReport& report);

/// docs/reference/measures.md names the keys; figures that are not defined are null, and where
/// nothing was measured "reason" says so. With `curve_points` above 0 the curves of Figures 4.4
/// to 4.6 too.
nlohmann::ordered_json ToJson(const ChangeReport& report, std::size_t curve_points);

/// A table for people.
std::string ToText(const ChangeReport& report);

}  // namespace livemap::change
