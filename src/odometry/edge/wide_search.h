#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "odometry/edge/aligner.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/edge/keyframe.h"
#include "odometry/edge/shift_search.h"
#include "odometry/edge/surface_points.h"

namespace livemap::odometry {

/// Motions to begin an alignment with, new_from_reference.
class MotionProposals {
 public:
  static constexpr std::size_t kMost = 112;
  /// More than kMost are passed over.
  void Add(const Eigen::Isometry3d& motion) {
    if (count_ < kMost) motions_[count_++] = motion;
  }
  void Add(const MotionProposals& others) {
    for (const Eigen::Isometry3d& motion : others) Add(motion);
  }
  const Eigen::Isometry3d* begin() const { return motions_.data(); }
  const Eigen::Isometry3d* end() const { return motions_.data() + count_; }

 private:
  std::array<Eigen::Isometry3d, kMost> motions_;
  std::size_t count_ = 0;
};

/// Motions that are at least so far apart on the finest level are rivals, px; nearer ones are one
/// motion with its error.
inline constexpr double kRivalPx = 10;

/// Looks for a motion of which nothing is known: many alignments on the coarsest level, of which
/// the best go on to the finer ones. The winner is who explains the largest share of the edges,
/// times the share of the surfaces that agree, so that a false minimum loses to the true one even
/// where both are minima; what counts as explained depends on how little the best leave. Keeps its
/// buffers; not thread-safe.
class WideSearch {
 public:
  struct Outcome {
    AlignmentResult best;
    /// Another motion explains nearly as much: the picture repeats itself.
    bool ambiguous = false;
    AlignmentResult rival;  ///< That motion.
    /// Up to so many grey levels a residual was noise, see ExplainedAt of Aligner.
    double noise = kNoiseGrey;
    int iterations = 0;
  };
  /// What is aligned with the images.
  struct Reference {
    /// The points to align on a level; asked for once per level.
    std::function<const EdgePoints&(int level)> points_of;
    SurfaceConstraint surfaces;
    const PicturePoints* picture = nullptr;  ///< None: edges and surfaces alone.
    double picture_noise = 0;                ///< How its pixels usually differ, grey levels.
    int finest_level = 0;                    ///< The last one that is aligned.
  };

  WideSearch(const AlignmentConfig& config, const LevelCameras& cameras)
      : aligner_(config), cameras_(cameras) {}

  /// Memory for so many points and for thumbnails of so many pixels.
  void Reserve(std::size_t points, std::size_t thumbnail_pixels);

  /// Adds what the thumbnails say, each of their best shifts as a turn and as a move, and moves
  /// along the optical axis. False when there is nothing to see.
  bool ProposeShifts(const Keyframe& keyframe, const ImagePyramid& images,
                     MotionProposals& proposals);

  /// Adds turns around a motion: by as much as a repeated pattern is left by one of its periods,
  /// more than an alignment can mend and less than a thumbnail shows.
  static void ProposeAround(const Eigen::Isometry3d& motion, MotionProposals& proposals);

  /// Adds turns to either side of a motion, up to 0.52 rad, half of a usual view: where a pattern
  /// repeats itself, the thumbnails show its periods and not the turn.
  static void ProposeFan(const Eigen::Isometry3d& motion, MotionProposals& proposals);

  /// Adds the motions near these starts for which the surfaces lie on each other, those where most
  /// agree, and one of those that hardly differ: a pattern that repeats itself does not mislead
  /// depth. What no surface shows stays as it was at the start. To be called after a search.
  void ProposeOnSurfaces(const SurfaceConstraint& surfaces, const MotionProposals& starts,
                         MotionProposals& proposals) const;

  /// Adds moves sideways, up and down from a motion, by as much as a pattern on a wall at that mean
  /// depth, m, repeats itself.
  static void ProposeMoves(const Eigen::Isometry3d& motion, double depth_m,
                           MotionProposals& proposals);

  /// Adds what the motions that the last search could hardly tell apart say of a pattern's periods:
  /// each difference between two of them, taken from every one of them. False where there is one
  /// motion only.
  bool ProposePeriods(MotionProposals& proposals) const;

  Outcome Search(const MotionProposals& proposals, const ImagePyramid& images,
                 const Reference& reference);

 private:
  struct Candidate {
    AlignmentResult result;
    double score = 0;
  };

  void AskSurfaces(const SurfaceConstraint& surfaces, double bound);
  void AskPicture(const Reference& reference, const ImagePyramid& images, bool is_finest);
  void AskNoise(const EdgePoints& points, const cv::Mat& grey, const geo::CameraIntrinsics& camera);
  void Refine(const EdgePoints& points, const ImagePyramid& images, int level,
              const Reference& reference);

  Aligner aligner_;
  LevelCameras cameras_;
  ShiftSearch shifts_;
  std::array<Candidate, MotionProposals::kMost> candidates_;
  std::vector<PicturePoints::Differences> differences_;  // Of each candidate.
  std::size_t count_ = 0;
  double mean_inverse_depth_ = 0;  // Of the points of the last level, 1/m.
  double noise_ = kNoiseGrey;      // Of this search.
};

/// Share of the points that an alignment explains; those out of view count in part, so that looking
/// away explains nothing.
double ExplainedScore(const AlignmentResult& result);

/// Whether a motion leaves the points in sight: from far away all of them fall into one pixel,
/// which explains any of low contrast.
bool IsBelievableMove(const Eigen::Isometry3d& motion, double mean_inverse_depth);

/// Whether the light changed by so little that the picture shows the same: light that fades further
/// is a covered lens, or explains any picture of low contrast.
bool IsBelievableLight(const AlignmentState& state);

/// How far points at `mean_inverse_depth` (1/m) move over the image between two motions, px.
double PixelsBetween(const Eigen::Isometry3d& one, const Eigen::Isometry3d& other,
                     double mean_inverse_depth, double focal_px);

}  // namespace livemap::odometry
