#include "odometry/edge/wide_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "odometry/se3.h"

namespace livemap::odometry {
namespace {

/// No move of which half of the picture is left is longer.
constexpr double kMostMeanDepths = 1.5;
/// Light that fades further than this, or grows, between two images is a covered lens.
constexpr double kMinBelievedGain = 0.3;
/// Weight of a point out of view, against one in view that is not explained.
constexpr double kUnseenWeight = 0.3;
/// Candidates that go on from the coarsest level, and from each finer one.
constexpr std::size_t kCoarseSurvivors = 8;
constexpr std::size_t kFineSurvivors = 3;
/// Closer than this on their level two candidates are one, px.
constexpr double kSameCandidatePx = 1.5;
/// A rival whose score is this close to the best one's makes the outcome ambiguous.
constexpr double kAmbiguousScore = 0.03;
/// Who explains less than the best by more than this does not say what noise is; that is so many
/// times the root of the mean cost.
constexpr double kNearlyAsMuch = 0.1;
constexpr double kNearlyAsMuchCoarsely = 0.2;
constexpr double kNoiseSigmas = 3;
/// Of the points of the picture, so many take part on coarser levels than the finest.
constexpr std::size_t kCoarseEvery = 3;
/// Of ProposeAround, rad, and how many turns of each.
constexpr std::array<double, 2> kRingRadii = {0.02, 0.045};
constexpr int kRingTurns = 8;
/// Of ProposeMoves, in mean depths.
constexpr std::array<double, 6> kSideMoves = {0.03, 0.06, 0.09, 0.13, 0.18, 0.24};
constexpr std::array<double, 2> kHeightMoves = {0.05, 0.1};
/// Of ProposeFan, rad.
constexpr std::array<double, 9> kFanTurns = {0.07, 0.1, 0.13, 0.17, 0.21, 0.27, 0.35, 0.43, 0.52};
/// Of ProposeOnSurfaces: the most motions, how far apart they are at least, px, and how much less
/// of the surfaces than of the best one's may agree.
constexpr std::size_t kOnSurfaces = 24;
constexpr double kOnSurfacesPx = 4;
constexpr double kOnSurfacesLess = 0.15;
/// Moves along the optical axis, in mean depths, and turns about it, rad.
constexpr std::array<double, 4> kAxisMoves = {-0.25, -0.1, 0.1, 0.25};
constexpr std::array<double, 2> kAxisTurns = {-0.1, 0.1};

Eigen::Isometry3d MotionOfTwist(double vx, double vy, double vz, double wx, double wy, double wz) {
  Vector6d twist;
  twist << vx, vy, vz, wx, wy, wz;
  return Se3Exp(twist);
}

}  // namespace

double ExplainedScore(const AlignmentResult& result) {
  const auto visible = static_cast<double>(result.visible);
  const double counted = visible + kUnseenWeight * (static_cast<double>(result.points) - visible);
  return counted > 0 && std::isfinite(result.cost) ? static_cast<double>(result.explained) / counted
                                                   : 0;
}

bool IsBelievableMove(const Eigen::Isometry3d& motion, double mean_inverse_depth) {
  return motion.translation().norm() * mean_inverse_depth < kMostMeanDepths;
}

bool IsBelievableLight(const AlignmentState& state) {
  return state.gain > kMinBelievedGain && state.gain < 1 / kMinBelievedGain;
}

double PixelsBetween(const Eigen::Isometry3d& one, const Eigen::Isometry3d& other,
                     double mean_inverse_depth, double focal_px) {
  const Vector6d twist = Se3Log(one.inverse() * other);
  return focal_px * (twist.head<3>().norm() * mean_inverse_depth + twist.tail<3>().norm());
}

void WideSearch::Reserve(std::size_t points, std::size_t thumbnail_pixels) {
  aligner_.Reserve(points);
  shifts_.Reserve(thumbnail_pixels);
  differences_.resize(MotionProposals::kMost);
}

void WideSearch::ProposeAround(const Eigen::Isometry3d& motion, MotionProposals& proposals) {
  for (const double radius : kRingRadii) {
    for (int i = 0; i < kRingTurns; ++i) {
      const double angle = 2 * M_PI * i / kRingTurns;
      proposals.Add(MotionOfTwist(0, 0, 0, radius * std::cos(angle), radius * std::sin(angle), 0) *
                    motion);
    }
  }
}

void WideSearch::ProposeFan(const Eigen::Isometry3d& motion, MotionProposals& proposals) {
  for (const double turn : kFanTurns) {
    for (const double side : {turn, -turn}) {
      proposals.Add(MotionOfTwist(0, 0, 0, 0, side, 0) * motion);
    }
  }
}

void WideSearch::ProposeOnSurfaces(const SurfaceConstraint& surfaces, const MotionProposals& starts,
                                   MotionProposals& proposals) const {
  if (surfaces.points == nullptr) return;
  struct OnSurfaces {
    Eigen::Isometry3d motion;
    double agreement;
  };
  std::array<OnSurfaces, MotionProposals::kMost> found;
  std::size_t count = 0;
  for (const Eigen::Isometry3d& start : starts) {
    const auto motion = surfaces.points->NewFromReference(surfaces.depth, start);
    const auto agreement = motion ? surfaces.Agreement(*motion, 1) : std::nullopt;
    if (agreement) found[count++] = {*motion, *agreement};
  }
  std::sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count),
            [](const OnSurfaces& a, const OnSurfaces& b) { return a.agreement > b.agreement; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count && kept < kOnSurfaces; ++i) {
    if (found[i].agreement < found[0].agreement - kOnSurfacesLess) break;
    const bool known =
        std::any_of(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept),
                    [&](const OnSurfaces& better) {
                      return PixelsBetween(better.motion, found[i].motion, mean_inverse_depth_,
                                           cameras_.camera[0].fx) < kOnSurfacesPx;
                    });
    if (known) continue;
    found[kept++] = found[i];
    proposals.Add(found[i].motion);
  }
}

void WideSearch::ProposeMoves(const Eigen::Isometry3d& motion, double depth_m,
                              MotionProposals& proposals) {
  for (const double move : kSideMoves) {
    for (const double side : {move * depth_m, -move * depth_m}) {
      proposals.Add(MotionOfTwist(side, 0, 0, 0, 0, 0) * motion);
    }
  }
  for (const double move : kHeightMoves) {
    for (const double side : {move * depth_m, -move * depth_m}) {
      proposals.Add(MotionOfTwist(0, side, 0, 0, 0, 0) * motion);
    }
  }
}

bool WideSearch::ProposePeriods(MotionProposals& proposals) const {
  std::array<Eigen::Isometry3d, kFineSurvivors> motions;
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(count_, kFineSurvivors); ++i) {
    const Eigen::Isometry3d& motion = candidates_[i].result.state.new_from_reference;
    const auto is_near = [&](const Eigen::Isometry3d& other) {
      return PixelsBetween(motion, other, mean_inverse_depth_, cameras_.camera[0].fx) < kRivalPx;
    };
    if (candidates_[i].score > candidates_[0].score - kNearlyAsMuch &&
        std::none_of(motions.begin(), motions.begin() + count, is_near)) {
      motions[count++] = motion;
    }
  }
  for (std::size_t from = 0; from < count; ++from) {
    for (std::size_t to = 0; to < count; ++to) {
      if (to == from) continue;
      const Eigen::Isometry3d period = motions[to] * motions[from].inverse();
      for (std::size_t i = 0; i < count; ++i) {
        if (i != from) proposals.Add(period * motions[i]);
      }
    }
  }
  return count > 1;
}

bool WideSearch::ProposeShifts(const Keyframe& keyframe, const ImagePyramid& images,
                               MotionProposals& proposals) {
  const ShiftSearch::Shifts shifts = shifts_.Find(keyframe.images.thumbnail(), images.thumbnail());
  if (shifts.count == 0) return false;
  const geo::CameraIntrinsics& camera = cameras_.camera[static_cast<std::size_t>(cameras_.levels)];
  const double depth_m = 1 / std::max(1e-3, keyframe.finest_points().mean_inverse_depth);
  for (const ShiftSearch::Shift& shift : shifts) {
    const double right = shift.x / camera.fx, down = shift.y / camera.fy;
    proposals.Add(MotionOfTwist(0, 0, 0, -down, right, 0));
    proposals.Add(MotionOfTwist(right * depth_m, down * depth_m, 0, 0, 0, 0));
  }
  for (const double move : kAxisMoves) proposals.Add(MotionOfTwist(0, 0, move * depth_m, 0, 0, 0));
  for (const double turn : kAxisTurns) proposals.Add(MotionOfTwist(0, 0, 0, 0, 0, turn));
  return true;
}

/// Aligns the candidates on a level and keeps the best that differ.
void WideSearch::Refine(const EdgePoints& points, const ImagePyramid& images, int level,
                        const Reference& reference) {
  const cv::Mat& grey = images[level];
  const SurfaceConstraint& surfaces = reference.surfaces;
  const std::size_t keep = level == cameras_.levels - 1 ? kCoarseSurvivors : kFineSurvivors;
  const geo::CameraIntrinsics& camera = cameras_.camera[static_cast<std::size_t>(level)];
  const bool is_finest = level == reference.finest_level;
  double least_sigma = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    Candidate& candidate = candidates_[i];
    candidate.result = aligner_.Align(points, grey, camera, candidate.result.state, surfaces,
                                      SurfacesEvery(is_finest));
    const bool is_believable =
        IsBelievableMove(candidate.result.state.new_from_reference, points.mean_inverse_depth) &&
        IsBelievableLight(candidate.result.state);
    candidate.score = is_believable ? ExplainedScore(candidate.result) : 0;
    // On coarser levels the motions are not exact enough for a narrow bound.
    if (is_believable && is_finest) {
      least_sigma = std::min(least_sigma, candidate.result.surface_sigma);
    }
  }
  if (is_finest) AskNoise(points, grey, camera);
  AskSurfaces(surfaces, SurfaceBound(least_sigma));
  if (reference.picture != nullptr) AskPicture(reference, images, is_finest);
  std::sort(candidates_.begin(), candidates_.begin() + static_cast<std::ptrdiff_t>(count_),
            [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count_ && kept < keep; ++i) {
    const Eigen::Isometry3d& motion = candidates_[i].result.state.new_from_reference;
    const bool known =
        std::any_of(candidates_.begin(), candidates_.begin() + static_cast<std::ptrdiff_t>(kept),
                    [&](const Candidate& better) {
                      return PixelsBetween(better.result.state.new_from_reference, motion,
                                           points.mean_inverse_depth, camera.fx) < kSameCandidatePx;
                    });
    if (!known) candidates_[kept++] = candidates_[i];
  }
  count_ = kept;
}

/// Where a motion that explains nearly as much as the best leaves less than the noise of any
/// camera, this camera's noise is less: what others leave beyond it is not explained.
void WideSearch::AskNoise(const EdgePoints& points, const cv::Mat& grey,
                          const geo::CameraIntrinsics& camera) {
  double best = 0, noise = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) best = std::max(best, candidates_[i].score);
  for (std::size_t i = 0; i < count_; ++i) {
    if (candidates_[i].score < best - kNearlyAsMuch) continue;
    const AlignmentResult& result = candidates_[i].result;
    // As it would be in full light, see Aligner::ExplainedAt.
    noise =
        std::min(noise, kNoiseSigmas * std::sqrt(result.cost) / std::min(1.0, result.state.gain));
  }
  if (!(noise < kNoiseGrey)) return;
  noise_ = noise;
  for (std::size_t i = 0; i < count_; ++i) {
    Candidate& candidate = candidates_[i];
    if (candidate.score == 0) continue;
    AlignmentResult by_noise = candidate.result;
    by_noise.explained = aligner_.ExplainedAt(points, grey, camera, by_noise.state, noise);
    candidate.score = ExplainedScore(by_noise);
  }
}

/// Multiplies the scores by the share of the surfaces that agree. Who looks where nothing is
/// measured has no more of it than the others.
void WideSearch::AskSurfaces(const SurfaceConstraint& surfaces, double bound) {
  std::array<std::optional<double>, MotionProposals::kMost> shares;
  double least = 1;
  for (std::size_t i = 0; i < count_; ++i) {
    if (candidates_[i].score == 0) continue;
    shares[i] = surfaces.Agreement(candidates_[i].result.state.new_from_reference, bound);
    least = std::min(least, shares[i].value_or(1));
  }
  for (std::size_t i = 0; i < count_; ++i) candidates_[i].score *= shares[i].value_or(least);
}

/// Multiplies the scores of those that explain nearly as much as the best by the share of the
/// picture that agrees; the others stay behind them. What edges and surfaces tell apart is told:
/// grey values change for more reasons.
void WideSearch::AskPicture(const Reference& reference, const ImagePyramid& images,
                            bool is_finest) {
  const int level = PicturePoints::LevelOf(cameras_.levels);
  const geo::CameraIntrinsics& camera = cameras_.camera[static_cast<std::size_t>(level)];
  double best = 0;
  for (std::size_t i = 0; i < count_; ++i) best = std::max(best, candidates_[i].score);
  const double enough = std::max(0.0, best - (is_finest ? kNearlyAsMuch : kNearlyAsMuchCoarsely));
  differences_.resize(MotionProposals::kMost);  // No memory where Reserve was called.
  double least_sigma = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    PicturePoints::Differences& differences = differences_[i];
    differences.count = 0;
    if (candidates_[i].score <= enough) continue;
    reference.picture->Compare(images[level], camera,
                               candidates_[i].result.state.new_from_reference,
                               is_finest ? 1 : kCoarseEvery, differences);
    least_sigma = std::min(least_sigma, differences.Sigma());
  }
  const double bound = PictureBound(std::max(least_sigma, reference.picture_noise));
  std::array<std::optional<double>, MotionProposals::kMost> shares;
  double least = 1;
  for (std::size_t i = 0; i < count_; ++i) {
    if (differences_[i].count == 0) continue;
    shares[i] = differences_[i].ShareWithin(bound);
    least = std::min(least, *shares[i]);
  }
  for (std::size_t i = 0; i < count_; ++i) candidates_[i].score *= shares[i].value_or(least);
}

WideSearch::Outcome WideSearch::Search(const MotionProposals& proposals, const ImagePyramid& images,
                                       const Reference& reference) {
  Outcome outcome;
  count_ = 0;
  noise_ = kNoiseGrey;
  for (const Eigen::Isometry3d& motion : proposals) {
    candidates_[count_] = {};
    candidates_[count_++].result.state.new_from_reference = motion;
  }
  if (count_ == 0) return outcome;
  for (int level = cameras_.levels - 1; level >= reference.finest_level; --level) {
    const EdgePoints& points = reference.points_of(level);
    Refine(points, images, level, reference);
    for (std::size_t i = 0; i < count_; ++i) outcome.iterations += candidates_[i].result.iterations;
    mean_inverse_depth_ = points.mean_inverse_depth;
  }
  outcome.best = candidates_[0].result;
  outcome.noise = noise_;
  for (std::size_t i = 1; i < count_ && !outcome.ambiguous; ++i) {
    outcome.rival = candidates_[i].result;
    outcome.ambiguous =
        candidates_[i].score > candidates_[0].score - kAmbiguousScore &&
        PixelsBetween(outcome.best.state.new_from_reference, outcome.rival.state.new_from_reference,
                      mean_inverse_depth_, cameras_.camera[0].fx) > kRivalPx;
  }
  return outcome;
}

}  // namespace livemap::odometry
