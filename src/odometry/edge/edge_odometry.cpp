#include "odometry/edge/edge_odometry.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"
#include "common/time.h"
#include "odometry/edge/seen_movements.h"

namespace livemap::odometry {
namespace {

/// A motion is carried on only over a short pause, s.
constexpr double kMaxPredictionS = 0.5;
/// Below this reciprocal condition number the information matrix says nothing about some direction.
constexpr double kMinCondition = 1e-12;
/// So many more searches follow one whose outcome looks unlike the keyframe.
constexpr int kPeriodSearches = 2;
/// What a search finds must explain this much more to be preferred to what was there.
constexpr double kBetterScore = 0.03;
/// Where edges and surfaces explain this much more or less, the picture is not asked.
constexpr double kTold = 0.1;
/// Movements that nothing shows go on for so long, s: the camera may have stopped.
constexpr double kUnseenMotionS = 2;
/// A share of the surfaces with which a motion is no chance, though little of the keyframe is left.
constexpr double kSureSurfaces = 0.95;

/// The covariance of what a matrix makes of a vector with this one. Its variances are sums of
/// squares: no rounding makes them negative.
Matrix6d Transformed(const Matrix6d& by, const Matrix6d& covariance) {
  const Eigen::LDLT<Matrix6d> factors(covariance);
  const Matrix6d root = factors.transpositionsP().transpose() * Matrix6d(factors.matrixL()) *
                        factors.vectorD().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Matrix6d moved = by * root;
  return moved * moved.transpose();
}

AlignmentConfig OdometryOfRotationOnly(AlignmentConfig config) {
  config.rotation_only = true;
  return config;
}

}  // namespace

const char* VoStateName(VoState state) {
  switch (state) {
    case VoState::kInitialising:
      return "initialising";
    case VoState::kTracking:
      return "tracking";
    case VoState::kLost:
      return "lost";
  }
  return "";
}

EdgeOdometry::EdgeOdometry(const Config& config, const geo::CameraIntrinsics& intrinsics)
    : config_(config),
      cameras_(LevelCamerasOf(CheckedCamera(intrinsics))),
      selector_({config.edges, config.points, config.max_points}, cameras_),
      aligner_(config.alignment),
      rotation_aligner_(OdometryOfRotationOnly(config.alignment)),
      wide_search_(config.alignment, cameras_),
      usual_(config.usual) {}

EdgeOdometry::~EdgeOdometry() = default;

void EdgeOdometry::Reset() {
  for (auto& keyframe : keyframes_) spare_.push_back(std::move(keyframe));
  keyframes_.clear();
  keyframe_ = nullptr;
  last_ = {};
  last_stamp_ns_.reset();
  light_ = {};
  settled_ = false;
  ForgetCourses();
  ambiguous_frames_ = 0;
  searched_keyframes_ = 0;
  usual_.Forget();
}

void EdgeOdometry::ForgetCourses() {
  course_.reset();
  rival_course_.reset();
}

void EdgeOdometry::Check(const RgbdFrame& frame) const {
  CheckPictures(frame, cameras_.camera[0]);
  if (last_stamp_ns_ && frame.stamp_ns <= *last_stamp_ns_) {
    throw Error("a frame's stamp of " + std::to_string(frame.stamp_ns) +
                " ns is not later than the last one's, " + std::to_string(*last_stamp_ns_) + " ns");
  }
}

VoResult EdgeOdometry::Track(const RgbdFrame& frame) {
  Check(frame);
  frame_ = frame;
  frame_images_.Build(frame.grey);
  frame_features_.Clear();
  VoResult result;
  if (keyframe_ == nullptr) {
    result = last_;
    result.state = VoState::kInitialising;
    if (MakeKeyframe(frame, {}, result)) result.state = VoState::kTracking;
  } else {
    Attempt attempt = last_.state == VoState::kLost ? FindBack() : Follow(frame.stamp_ns);
    if (!attempt.good && last_.state != VoState::kLost) attempt = FindBack();
    result = attempt.good ? Accept(attempt, frame.stamp_ns) : Hold(frame.stamp_ns);
    const bool gives_up = result.state == VoState::kLost &&
                          Seconds(frame.stamp_ns - tracked_stamp_ns_) >= config_.give_up_s;
    const bool waits =
        !settled_ && !attempt.strange && attempt.fine.Overlap() >= config_.ambiguous_overlap;
    result.keyframe_due = gives_up || (attempt.good && !waits &&
                                       WantsKeyframe(attempt.fine, result.world_from_camera));
    if (result.keyframe_due) {
      result.new_keyframe = MakeKeyframe(frame, {}, result);
      if (gives_up && result.new_keyframe) {
        result.state = VoState::kTracking;
        usual_.Forget();  // It may be another place.
      }
    }
  }
  if (result.state == VoState::kTracking) tracked_stamp_ns_ = frame.stamp_ns;
  last_stamp_ns_ = frame.stamp_ns;
  last_ = result;
  return result;
}

bool EdgeOdometry::AddKeyframe(const cv::Mat& depth_m, const cv::Mat& inverse_depth_sigma,
                               const std::optional<Vector6d>& twist) {
  if (!last_stamp_ns_ || frame_images_.levels() == 0) return false;
  const RgbdFrame frame = {*last_stamp_ns_, frame_images_[0], depth_m, 1};
  if (!MakeKeyframe(frame, inverse_depth_sigma, last_)) return false;
  last_.state = VoState::kTracking;
  last_.twist = twist;
  settled_ = twist.has_value();
  ForgetCourses();
  if (twist) course_ = Course{last_.world_from_camera, *twist};
  tracked_stamp_ns_ = *last_stamp_ns_;
  return true;
}

void EdgeOdometry::Correct(const Eigen::Isometry3d& said_from_true, double since_s) {
  last_.world_from_camera = last_.world_from_camera * said_from_true;
  const Vector6d change = Se3Log(said_from_true) / since_s;
  if (last_.twist) *last_.twist += change;
  for (std::optional<Course>* course : {&course_, &rival_course_}) {
    if (!*course) continue;
    (*course)->world_from_camera = (*course)->world_from_camera * said_from_true;
    (*course)->twist += change;
  }
}

bool EdgeOdometry::AddEarlierKeyframe(const RgbdFrame& frame, const cv::Mat& inverse_depth_sigma,
                                      const VoResult& result) {
  frame_images_.Build(frame.grey);
  return MakeKeyframe(frame, inverse_depth_sigma, result);
}

/// Makes the current frame the one that later frames are aligned with; false, and nothing changed,
/// when it has no depth or too few edges.
bool EdgeOdometry::MakeKeyframe(const RgbdFrame& frame, const cv::Mat& inverse_depth_sigma,
                                const VoResult& result) {
  if (frame.depth.empty()) return false;
  if (keyframes_.empty() && spare_.empty()) ReserveBuffers();
  std::unique_ptr<Keyframe> fresh = std::move(spare_.back());
  spare_.pop_back();
  fresh->stamp_ns = frame.stamp_ns;
  fresh->world_from_camera = result.world_from_camera;
  fresh->covariance = result.covariance;
  fresh->depths.Build(frame.depth, frame.depth_units_per_m, config_.depth_range, cameras_.levels);
  fresh->inverse_depth_sigmas.Clear();
  fresh->picture.Clear();
  fresh->features.Clear();
  fresh->surfaces.Clear();
  if (!inverse_depth_sigma.empty()) {
    constexpr DepthPyramid::Range kAny = {std::numeric_limits<float>::min(),
                                          std::numeric_limits<float>::max()};
    fresh->inverse_depth_sigmas.Build(inverse_depth_sigma, 1, kAny, cameras_.levels);
  } else {
    // Depths that are estimates err by more than the noise of the gradients hides.
    frame_images_.MeasureNoise(frame.grey);
    const int coarsest = cameras_.levels - 1;
    fresh->surfaces.Take(fresh->depths[coarsest],
                         cameras_.camera[static_cast<std::size_t>(coarsest)]);
  }
  std::swap(fresh->images, frame_images_);
  if (inverse_depth_sigma.empty()) {
    const int level = PicturePoints::LevelOf(cameras_.levels);
    fresh->picture.Take(fresh->images[level], fresh->depths[level],
                        cameras_.camera[static_cast<std::size_t>(level)]);
  }
  selector_.Select(*fresh);
  if (fresh->finest_points().size() < static_cast<std::size_t>(config_.min_points)) {
    std::swap(fresh->images, frame_images_);
    spare_.push_back(std::move(fresh));
    return false;
  }
  ForgetNearOnes();
  keyframes_.push_back(std::move(fresh));
  keyframe_ = keyframes_.back().get();
  keyframe_first_sigma_ = 0;
  frames_since_keyframe_ = 0;
  light_ = {};
  return true;
}

/// All memory of the frames to come, at the first one: later frames allocate nothing.
void EdgeOdometry::ReserveBuffers() {
  const auto kept = static_cast<std::size_t>(std::max(2, config_.keyframes_kept));
  keyframes_.reserve(kept);
  spare_.reserve(kept + 1);
  const cv::Size size = frame_images_[0].size();
  const cv::Mat empty_depth = cv::Mat::zeros(size, CV_32FC1);
  const std::size_t thumbnail = frame_images_.thumbnail().total();
  while (spare_.size() < kept + 1) {
    spare_.push_back(std::make_unique<Keyframe>());
    Keyframe& keyframe = *spare_.back();
    keyframe.images.Build(frame_images_[0]);
    keyframe.depths.Build(empty_depth, 1, config_.depth_range, cameras_.levels);
    for (std::size_t level = 0; level < kMaxLevels; ++level) {
      keyframe.points[level].Reserve(static_cast<std::size_t>(config_.max_points[level]));
    }
    keyframe.thumbnail_points.Reserve(thumbnail);
    keyframe.surfaces.Reserve();
    keyframe.picture.Reserve();
  }
  const std::size_t most =
      std::max(thumbnail, static_cast<std::size_t>(*std::max_element(config_.max_points.begin(),
                                                                     config_.max_points.end())));
  selector_.Reserve(size);
  aligner_.Reserve(most);
  rotation_aligner_.Reserve(most);
  wide_search_.Reserve(most, thumbnail);
}

/// Makes room for a new keyframe: the newest goes when it is close to the one before it, else the
/// oldest once there are too many.
void EdgeOdometry::ForgetNearOnes() {
  const std::size_t count = keyframes_.size();
  auto leaving = keyframes_.end();
  if (count >= 2 && Motion(*keyframes_[count - 2], keyframes_[count - 2]->world_from_camera,
                           keyframes_[count - 1]->world_from_camera) < config_.kept_motion) {
    leaving = std::prev(keyframes_.end());
  } else if (count >= static_cast<std::size_t>(std::max(2, config_.keyframes_kept))) {
    leaving = keyframes_.begin();
  }
  if (leaving == keyframes_.end()) return;
  spare_.push_back(std::move(*leaving));
  keyframes_.erase(leaving);
}

const EdgePoints& EdgeOdometry::PointsOf(Keyframe& keyframe, int level) {
  return config_.edge_source == EdgeSource::kKeyframe
             ? keyframe.points[static_cast<std::size_t>(level)]
             : selector_.SelectUnder(frame_images_[level], keyframe, level);
}

AlignmentState EdgeOdometry::BestStart(const EdgePoints& points, int level,
                                       const Guesses& guesses) {
  AlignmentState best = light_;
  best.new_from_reference = *guesses.begin();
  if (guesses.count == 1) return best;
  double least_cost = std::numeric_limits<double>::infinity();
  for (const Eigen::Isometry3d& guess : guesses) {
    AlignmentState state = light_;
    state.new_from_reference = guess;
    const double cost = aligner_.CostAt(points, frame_images_[level],
                                        cameras_.camera[static_cast<std::size_t>(level)], state,
                                        config_.lost_sigma / 2);
    if (cost >= least_cost) continue;
    least_cost = cost;
    best = state;
  }
  return best;
}

/// Coarse to fine from the best of the guesses.
EdgeOdometry::Attempt EdgeOdometry::TrackFrom(Keyframe& keyframe, const Guesses& guesses) {
  Attempt attempt;
  attempt.keyframe = &keyframe;
  AlignmentState state;
  for (int level = cameras_.levels - 1; level >= keyframe.finest_level; --level) {
    const EdgePoints& points = PointsOf(keyframe, level);
    if (level == cameras_.levels - 1) state = BestStart(points, level, guesses);
    attempt.fine = aligner_.Align(
        points, frame_images_[level], cameras_.camera[static_cast<std::size_t>(level)], state,
        SurfacesOf(keyframe), SurfacesEvery(level == keyframe.finest_level));
    state = attempt.fine.state;
    attempt.iterations += attempt.fine.iterations;
  }
  Judge(attempt);
  return attempt;
}

MeasuredDepth EdgeOdometry::Depth() const {
  return {&frame_, &cameras_.camera[0], config_.depth_range};
}

SurfaceConstraint EdgeOdometry::SurfacesOf(const Keyframe& keyframe) const {
  if (keyframe.surfaces.size() == 0 || frame_.depth.empty()) return {};
  return {&keyframe.surfaces, Depth()};
}

void EdgeOdometry::Judge(Attempt& attempt) const {
  attempt.evidence = {};
  attempt.evidence.agreement = attempt.fine.Agreement();
  attempt.evidence.surfaces =
      SurfacesOf(*attempt.keyframe).Agreement(attempt.fine.state.new_from_reference, 1);
  PicturePoints::Differences differences;
  ComparePicture(*attempt.keyframe, attempt.fine.state.new_from_reference, differences);
  if (differences.count > 0) {
    attempt.evidence.picture =
        differences.ShareWithin(PictureBound(PictureNoise(*attempt.keyframe)));
    attempt.evidence.picture_sigma = differences.Sigma();
  }
  attempt.good = IsGood(attempt);
}

void EdgeOdometry::ComparePicture(const Keyframe& keyframe,
                                  const Eigen::Isometry3d& new_from_reference,
                                  PicturePoints::Differences& differences) const {
  const int level = PicturePoints::LevelOf(cameras_.levels);
  keyframe.picture.Compare(frame_images_[level], cameras_.camera[static_cast<std::size_t>(level)],
                           new_from_reference, 1, differences);
}

/// How pixels differ that show the same: as in the last frames; at first as far as the camera's
/// noise is known.
double EdgeOdometry::PictureNoise(const Keyframe& keyframe) const {
  const int level = PicturePoints::LevelOf(cameras_.levels);
  return usual_.picture_noise().value_or(2 * std::sqrt(keyframe.images.GradientNoise(level)));
}

/// Whether what a search found explains clearly more than what was followed, of the edges and of
/// the surfaces, and of the picture where those hardly differ; both of one keyframe.
bool EdgeOdometry::IsBetter(const Attempt& found, const Attempt& followed) {
  Keyframe& keyframe = *followed.keyframe;
  const SurfaceConstraint surfaces = SurfacesOf(keyframe);
  const double bound =
      SurfaceBound(std::min(found.fine.surface_sigma, followed.fine.surface_sigma));
  const auto here = surfaces.Agreement(found.fine.state.new_from_reference, bound);
  const auto there = surfaces.Agreement(followed.fine.state.new_from_reference, bound);
  const bool both = here && there;
  const int level = keyframe.finest_level;
  const EdgePoints& points = PointsOf(keyframe, level);
  const auto score = [&](AlignmentResult result) {
    result.explained = aligner_.ExplainedAt(points, frame_images_[level],
                                            cameras_.camera[static_cast<std::size_t>(level)],
                                            result.state, std::min(found.noise, followed.noise));
    return ExplainedScore(result);
  };
  const double of_found = score(found.fine) * (both ? *here : 1);
  const double of_followed = score(followed.fine) * (both ? *there : 1);
  if (std::abs(of_found - of_followed) > kTold) return of_found > of_followed;
  PicturePoints::Differences seen_here, seen_there;
  ComparePicture(keyframe, found.fine.state.new_from_reference, seen_here);
  ComparePicture(keyframe, followed.fine.state.new_from_reference, seen_there);
  if (seen_here.count == 0 || seen_there.count == 0) return of_found > of_followed + kBetterScore;
  const double noise = PictureBound(
      std::max(PictureNoise(keyframe), std::min(seen_here.Sigma(), seen_there.Sigma())));
  return of_found * seen_here.ShareWithin(noise) >
         of_followed * seen_there.ShareWithin(noise) + kBetterScore;
}

/// How far the keyframe's points move over the image between a motion and an attempt's, px.
double EdgeOdometry::PixelsFrom(const Eigen::Isometry3d& new_from_reference,
                                const Attempt& attempt) const {
  return PixelsBetween(attempt.fine.state.new_from_reference, new_from_reference,
                       attempt.keyframe->finest_points().mean_inverse_depth, cameras_.camera[0].fx);
}

/// Who is believed. One of two motions that a search cannot tell apart is not told apart from what
/// was followed either.
EdgeOdometry::Attempt EdgeOdometry::Better(const Attempt& found, const Attempt& followed) {
  if (!found.good) return followed;
  if (!followed.good || IsBetter(found, followed)) return found;
  if (!found.ambiguous) return followed;
  Attempt either = found;
  if (PixelsFrom(followed.fine.state.new_from_reference, found) > kRivalPx) {
    either.rival = followed.fine;
  }
  return either;
}

/// Where the camera is most likely now: its motion goes on as it was, or it stands.
Eigen::Isometry3d EdgeOdometry::Expected(std::int64_t stamp_ns) const {
  const double step_s = Seconds(stamp_ns - *last_stamp_ns_);
  const bool moves = course_ && step_s <= kMaxPredictionS;
  return moves ? course_->After(step_s) : last_.world_from_camera;
}

/// The same; none where the last motion was not told apart from all others.
std::optional<Eigen::Isometry3d> EdgeOdometry::Predicted(std::int64_t stamp_ns) const {
  const bool is_known =
      settled_ && course_ && Seconds(stamp_ns - *last_stamp_ns_) <= kMaxPredictionS;
  return is_known ? std::optional(Expected(stamp_ns)) : std::nullopt;
}

EdgeOdometry::Attempt EdgeOdometry::Follow(std::int64_t stamp_ns) {
  // The thesis's equation 5.7: the motion goes on as it was; or the camera stands.
  Guesses guesses;
  const double step_s = Seconds(stamp_ns - *last_stamp_ns_);
  if (config_.constant_motion && step_s <= kMaxPredictionS) {
    for (const std::optional<Course>& course : {course_, rival_course_}) {
      if (course) guesses.Add(course->After(step_s).inverse() * keyframe_->world_from_camera);
    }
  }
  guesses.Add(last_.world_from_camera.inverse() * keyframe_->world_from_camera);
  const Attempt followed = TrackFrom(*keyframe_, guesses);
  if (!IsDoubtful(followed, stamp_ns)) return followed;
  if (followed.good) guesses.Add(followed.fine.state.new_from_reference);
  Attempt attempt = Better(SearchFrom(*keyframe_, guesses), followed);
  TellApart(stamp_ns, attempt);
  CastDoubt(stamp_ns, attempt);
  return attempt;
}

/// Of two motions that explain as much, the one that is as expected is believed when the other is
/// twice as far from that. They are told apart then, if the last motion was.
void EdgeOdometry::TellApart(std::int64_t stamp_ns, Attempt& attempt) const {
  if (!attempt.ambiguous) return;
  const Eigen::Isometry3d expected =
      Expected(stamp_ns).inverse() * attempt.keyframe->world_from_camera;
  Attempt other = attempt;
  std::swap(other.fine, other.rival);
  Judge(other);
  const double of_winner = PixelsFrom(expected, attempt), of_rival = PixelsFrom(expected, other);
  if (other.good && of_winner > 2 * of_rival) {
    attempt = other;
  } else if (of_rival <= 2 * of_winner) {
    return;
  }
  attempt.ambiguous = !Predicted(stamp_ns);
}

/// A motion found by a search may be strange all the same, and far from what was expected: a false
/// minimum of a picture whose true one was not among the proposals. It gives no velocity, and the
/// next frame is searched, too.
void EdgeOdometry::CastDoubt(std::int64_t stamp_ns, Attempt& attempt) const {
  if (!attempt.good || attempt.ambiguous) return;
  const bool explains_little =
      attempt.evidence.agreement < usual_.agreement() - usual_.StrangeDrop();
  if (!usual_.IsDisplaced(attempt.evidence) && !usual_.LooksUnlike(attempt.evidence) &&
      !explains_little) {
    return;
  }
  Eigen::Isometry3d& rival = attempt.rival.state.new_from_reference;
  rival = Expected(stamp_ns).inverse() * attempt.keyframe->world_from_camera;
  attempt.ambiguous = attempt.strange = PixelsFrom(rival, attempt) > kRivalPx;
}

/// Whether a place that was looked for without any prior looks as places did before.
bool EdgeOdometry::IsRecognised(const Attempt& attempt) const {
  return attempt.good && attempt.fine.Overlap() >= config_.min_overlap &&
         usual_.IsRecognised(attempt.evidence);
}

/// Whether an alignment that began at a guess may have ended in a false minimum. The further a
/// keyframe is, the less of it is explained, so that a smaller agreement alone says little where
/// the motion goes on as it was. Where depths are estimates, it says that the depths err.
bool EdgeOdometry::IsDoubtful(const Attempt& attempt, std::int64_t stamp_ns) const {
  if (!attempt.good || !settled_) return true;
  const double drop = usual_.agreement() - attempt.evidence.agreement;
  const bool exact = attempt.keyframe->finest_points().inverse_depth_sigma.empty();
  if (drop > (exact ? usual_.FoundDrop() : usual_.AgreementDrop())) return true;
  if (drop < usual_.AgreementDrop() / 4 && !usual_.IsDisplaced(attempt.evidence) &&
      !usual_.LooksUnlike(attempt.evidence)) {
    return false;
  }
  const auto predicted = Predicted(stamp_ns);
  if (!predicted) return true;
  const Eigen::Isometry3d reference_from_new = attempt.fine.state.new_from_reference.inverse();
  const double surprise = Motion(*attempt.keyframe, *predicted,
                                 attempt.keyframe->world_from_camera * reference_from_new);
  return surprise > (drop > usual_.AgreementDrop() ? config_.surprise / 2 : config_.surprise);
}

/// One search among the proposals.
EdgeOdometry::Attempt EdgeOdometry::SearchAmong(Keyframe& keyframe,
                                                const MotionProposals& proposals) {
  WideSearch::Reference reference;
  reference.finest_level = keyframe.finest_level;
  reference.points_of = [this, &keyframe](int level) -> const EdgePoints& {
    return PointsOf(keyframe, level);
  };
  reference.surfaces = SurfacesOf(keyframe);
  if (keyframe.picture.size() > 0) {
    reference.picture = &keyframe.picture;
    reference.picture_noise = PictureNoise(keyframe);
  }
  const WideSearch::Outcome outcome = wide_search_.Search(proposals, frame_images_, reference);
  Attempt attempt;
  attempt.keyframe = &keyframe;
  attempt.fine = outcome.best;
  attempt.ambiguous = outcome.ambiguous;
  attempt.rival = outcome.rival;
  attempt.noise = outcome.noise;
  attempt.iterations = outcome.iterations;
  Judge(attempt);
  return attempt;
}

void EdgeOdometry::ProposeByFeatures(Keyframe& keyframe, MotionProposals& proposals) {
  if (!frame_features_.found) FindFeatures(frame_images_[0], frame_features_);
  if (!keyframe.features.found) FindFeatures(keyframe.images[0], keyframe.features);
  const auto motion = NewFromReferenceByFeatures(keyframe.features, keyframe.depths[0],
                                                 frame_features_, cameras_.camera[0]);
  if (!motion) return;
  proposals.Add(*motion);
  WideSearch::ProposeAround(*motion, proposals);
}

/// Searches among the guesses and what thumbnails say; where that is not enough, around what was
/// found, among turns to either side and where the surfaces lie on each other, and among what
/// features say if it is not convincing.
EdgeOdometry::Attempt EdgeOdometry::SearchFrom(Keyframe& keyframe, const Guesses& guesses) {
  MotionProposals proposals, starts;
  for (const Eigen::Isometry3d& guess : guesses) proposals.Add(guess);
  proposals.Add(Eigen::Isometry3d::Identity());
  const auto by_surfaces = keyframe.surfaces.NewFromReference(Depth(), *guesses.begin());
  if (by_surfaces) proposals.Add(*by_surfaces);
  WideSearch::ProposeAround(*guesses.begin(), proposals);
  if (!wide_search_.ProposeShifts(keyframe, frame_images_, starts)) return {};
  proposals.Add(starts);
  const Attempt first = SearchAmong(keyframe, proposals);
  const double enough =
      std::max(config_.feature_agreement, usual_.agreement() - usual_.AgreementDrop());
  proposals = {};
  proposals.Add(first.fine.state.new_from_reference);
  const bool repeats = keyframe.picture.size() > 0 && wide_search_.ProposePeriods(proposals);
  const bool is_convincing = first.good && !first.ambiguous && first.evidence.agreement >= enough &&
                             !usual_.IsDisplaced(first.evidence) &&
                             !(repeats && usual_.LooksUnlike(first.evidence));
  // Where nothing says how the camera moved before, the true motion may not be among these.
  if (is_convincing && settled_ && course_) return first;
  if (first.ambiguous) proposals.Add(first.rival.state.new_from_reference);
  WideSearch::ProposeAround(first.fine.state.new_from_reference, proposals);
  if (!is_convincing) ProposeByFeatures(keyframe, proposals);
  WideSearch::ProposeMoves(first.fine.state.new_from_reference,
                           1 / keyframe.finest_points().mean_inverse_depth, proposals);
  WideSearch::ProposeFan(*guesses.begin(), proposals);
  WideSearch::ProposeFan(*guesses.begin(), starts);
  wide_search_.ProposeOnSurfaces(SurfacesOf(keyframe), starts, proposals);
  const Attempt further = SearchPeriods(keyframe, SearchAmong(keyframe, proposals));
  Attempt best = BetterOf(first, further);
  best.iterations = first.iterations + further.iterations;
  return best;
}

/// The winner of two searches. The coarse levels, which choose whom the finer ones see, may have
/// left the first one's out of the second: another motion that explains as much makes that
/// ambiguous.
EdgeOdometry::Attempt EdgeOdometry::BetterOf(const Attempt& first, const Attempt& second) {
  if (!first.good) return second;
  if (!second.good || IsBetter(first, second)) return first;
  Attempt either = second;
  if (!second.ambiguous && !IsBetter(second, first) &&
      PixelsFrom(first.fine.state.new_from_reference, second) > kRivalPx) {
    either.ambiguous = true;
    either.rival = first.fine;
  }
  return either;
}

/// As long as what was found looks unlike the keyframe, searches a period of its pattern further.
EdgeOdometry::Attempt EdgeOdometry::SearchPeriods(Keyframe& keyframe, Attempt found) {
  for (int i = 0; i < kPeriodSearches && !usual_.LooksConvincing(found.evidence); ++i) {
    MotionProposals proposals;
    proposals.Add(found.fine.state.new_from_reference);
    if (!wide_search_.ProposePeriods(proposals)) break;
    WideSearch::ProposeAround(found.fine.state.new_from_reference, proposals);
    const int iterations = found.iterations;
    found = SearchAmong(keyframe, proposals);
    found.iterations += iterations;
  }
  return found;
}

/// The rotation that brings the keyframe's thumbnail nearest to the current one's, with the
/// translation of `from`.
Eigen::Isometry3d EdgeOdometry::RotationGuess(Keyframe& keyframe, const Eigen::Isometry3d& from) {
  AlignmentState state;
  state.new_from_reference.linear() = from.linear();
  const AlignmentResult turned =
      rotation_aligner_.Align(keyframe.thumbnail_points, frame_images_.thumbnail(),
                              cameras_.camera[static_cast<std::size_t>(cameras_.levels)], state);
  Eigen::Isometry3d guess = turned.state.new_from_reference;
  guess.translation() = from.translation();
  return guess;
}

/// Searches the motion anew: from the thumbnails' rotation, with the newest keyframe first and some
/// of the others, so that a frame's time is bounded and each keyframe has its turn.
EdgeOdometry::Attempt EdgeOdometry::FindBack() {
  Attempt attempt;
  const std::size_t count = keyframes_.size();
  const std::size_t searches =
      std::min(count, static_cast<std::size_t>(std::max(1, config_.searches_per_frame)));
  for (std::size_t i = 0; i < searches && !attempt.good; ++i) {
    const std::size_t older = i == 0 || count < 2 ? 0 : 1 + searched_keyframes_++ % (count - 1);
    Keyframe& keyframe = *keyframes_[count - 1 - older];
    const Eigen::Isometry3d held = last_.world_from_camera.inverse() * keyframe.world_from_camera;
    const Eigen::Isometry3d standing = Eigen::Isometry3d::Identity();
    light_ = {};
    Guesses guesses;
    for (const auto& guess :
         {RotationGuess(keyframe, held), held, standing, RotationGuess(keyframe, standing)}) {
      guesses.Add(guess);
    }
    attempt = SearchFrom(keyframe, guesses);
    attempt.good = IsRecognised(attempt);
  }
  return attempt;
}

bool EdgeOdometry::IsGood(const Attempt& attempt) const {
  const AlignmentResult& result = attempt.fine;
  // Points on one straight edge, or all at one depth beyond measure, do not fix the pose.
  const Eigen::LLT<Matrix6d> determined(result.information);
  const bool is_measured = attempt.evidence.surfaces.value_or(0) >= kSureSurfaces;
  const bool is_in_place = attempt.evidence.surfaces && !usual_.IsDisplaced(attempt.evidence);
  const double least_agreement =
      is_in_place ? usual_.LeastAgreement(config_.min_measured_agreement, config_.min_agreement)
                  : config_.min_agreement;
  return std::isfinite(result.cost) &&
         IsBelievableMove(result.state.new_from_reference,
                          attempt.keyframe->finest_points().mean_inverse_depth) &&
         result.state.new_from_reference.matrix().allFinite() &&
         determined.info() == Eigen::Success && determined.rcond() > kMinCondition &&
         result.visible >= static_cast<std::size_t>(config_.min_points) &&
         result.Overlap() >= (is_measured ? config_.min_measured_overlap : config_.min_overlap) &&
         result.sigma <= config_.lost_sigma && result.Agreement() >= least_agreement &&
         attempt.evidence.surfaces.value_or(1) >= config_.min_surfaces &&
         IsBelievableLight(result.state);
}

bool EdgeOdometry::WantsKeyframe(const AlignmentResult& result,
                                 const Eigen::Isometry3d& world_from_camera) {
  ++frames_since_keyframe_;
  if (keyframe_first_sigma_ == 0) keyframe_first_sigma_ = result.sigma;
  if (config_.keyframe_every > 0 && frames_since_keyframe_ >= config_.keyframe_every) return true;
  const double step = Motion(*keyframe_, last_.world_from_camera, world_from_camera);
  const double enough =
      step < config_.keyframe_slow * config_.keyframe_motion
          ? config_.keyframe_motion
          : std::min(std::max(config_.keyframe_steps * step, config_.keyframe_motion),
                     config_.keyframe_max_motion);
  return Motion(*keyframe_, keyframe_->world_from_camera, world_from_camera) > enough ||
         result.Overlap() < config_.keyframe_overlap ||
         result.sigma > config_.keyframe_sigma_ratio * keyframe_first_sigma_;
}

/// How far the keyframe's points move over the image on average between two poses of the camera, if
/// they all are in the middle of it: share of its width.
double EdgeOdometry::Motion(const Keyframe& keyframe, const Eigen::Isometry3d& world_from_one,
                            const Eigen::Isometry3d& world_from_other) const {
  const Vector6d twist = Se3Log(world_from_other.inverse() * world_from_one);
  return cameras_.camera[0].fx / cameras_.camera[0].width *
         (twist.head<3>().norm() * keyframe.finest_points().mean_inverse_depth +
          twist.tail<3>().norm());
}

VoResult EdgeOdometry::Accept(const Attempt& attempt, std::int64_t stamp_ns) {
  keyframe_ = attempt.keyframe;
  const AlignmentResult& fine = attempt.fine;
  light_.gain = fine.state.gain;
  light_.bias = fine.state.bias;
  VoResult result;
  result.state = VoState::kTracking;
  result.world_from_camera = Renormalised(Continued(attempt, stamp_ns));
  // new_from_reference Exp(d) turned around is Exp(-d) reference_from_new: carried to the
  // right-hand side of the new pose by the adjoint.
  Matrix6d relative = config_.covariance_factor * fine.covariance;
  if (keyframe_->finest_points().gradient_noise > 0) {
    relative = WithinReach(relative, Seconds(stamp_ns - keyframe_->stamp_ns));
  }
  if (attempt.ambiguous) {
    const Vector6d to_rival =
        Se3Log(fine.state.new_from_reference.inverse() * attempt.rival.state.new_from_reference);
    relative += to_rival * to_rival.transpose();
  }
  const Matrix6d to_new = Se3Adjoint(fine.state.new_from_reference);
  result.covariance = Transformed(to_new, keyframe_->covariance + relative);
  result.covariance = (0.5 * (result.covariance + result.covariance.transpose())).eval();
  const double step_s = Seconds(stamp_ns - *last_stamp_ns_);
  ambiguous_frames_ = attempt.ambiguous ? ambiguous_frames_ + 1 : 0;
  settled_ = ambiguous_frames_ == 0 || ambiguous_frames_ > config_.max_ambiguous_frames;
  if (settled_) usual_.Add(attempt.evidence);  // What is doubted is not usual.
  ForgetCourses();
  if (last_.state == VoState::kTracking) {
    const auto course_to = [&](const Eigen::Isometry3d& world_from_camera) {
      const Eigen::Isometry3d step = last_.world_from_camera.inverse() * world_from_camera;
      return Course{world_from_camera, Se3Log(step) / step_s};
    };
    course_ = course_to(result.world_from_camera);
    if (attempt.ambiguous) {
      rival_course_ = course_to(keyframe_->world_from_camera *
                                attempt.rival.state.new_from_reference.inverse());
    }
  }
  if (course_ && settled_) {
    result.twist = course_->twist;
    // Both ends err by the alignment with the keyframe.
    result.twist_covariance = 2 / (step_s * step_s) * Transformed(to_new, relative);
  }
  result.keyframe_stamp_ns = keyframe_->stamp_ns;
  result.points = fine.points;
  result.inliers = fine.inliers;
  result.sigma = fine.sigma;
  result.overlap = fine.Overlap();
  result.agreement = fine.Agreement();
  result.surfaces = attempt.evidence.surfaces;
  result.iterations = attempt.iterations;
  return result;
}

/// The pose of an attempt. What nothing shows of it goes on as it was for a while, instead of
/// wherever noise brought it.
Eigen::Isometry3d EdgeOdometry::Continued(const Attempt& attempt, std::int64_t stamp_ns) const {
  const AlignmentResult& fine = attempt.fine;
  const Eigen::Isometry3d said =
      attempt.keyframe->world_from_camera * fine.state.new_from_reference.inverse();
  // The errors of depths that are estimates are larger than all that noise does.
  if (!(attempt.keyframe->finest_points().gradient_noise > 0)) return said;
  const double step_s = Seconds(stamp_ns - *last_stamp_ns_);
  const Eigen::Isometry3d expected =
      course_ ? course_->After(step_s * std::exp(-step_s / kUnseenMotionS))
              : last_.world_from_camera;
  const Matrix6d covariance =
      Transformed(Se3Adjoint(fine.state.new_from_reference), fine.covariance);
  return said * Se3Exp(UnseenPart(Se3Log(said.inverse() * expected), covariance));
}

/// What no edge shows is not further away than a camera may move in that time.
Matrix6d EdgeOdometry::WithinReach(const Matrix6d& covariance, double time_s) const {
  Matrix6d reach = Matrix6d::Zero();
  GrowWhileLost(config_, 0, time_s, reach);
  const Eigen::LDLT<Matrix6d> sum(covariance + reach);
  if (sum.info() != Eigen::Success) return covariance;
  // Joseph's form: no rounding makes a variance negative, however small the reach.
  const Matrix6d gain = sum.solve(covariance).transpose();
  return Transformed(Matrix6d::Identity() - gain, covariance) + Transformed(gain, reach);
}

VoResult EdgeOdometry::Hold(std::int64_t stamp_ns) {
  VoResult result = last_;
  result.state = VoState::kLost;
  ForgetCourses();
  settled_ = false;
  ambiguous_frames_ = 0;
  result.twist.reset();
  result.twist_covariance.setZero();
  result.new_keyframe = false;
  const double lost_s = Seconds(stamp_ns - tracked_stamp_ns_);
  GrowWhileLost(config_, lost_s - Seconds(stamp_ns - *last_stamp_ns_), lost_s, result.covariance);
  return result;
}

void GrowWhileLost(const EdgeOdometry::Config& config, double from_s, double to_s,
                   Matrix6d& covariance) {
  // The error grows with the time lost: the variance by the difference of the squares.
  const double growth = to_s * to_s - from_s * from_s;
  covariance.diagonal().head<3>().array() += growth * config.lost_speed_mps * config.lost_speed_mps;
  covariance.diagonal().tail<3>().array() += growth * config.lost_turn_rps * config.lost_turn_rps;
}

}  // namespace livemap::odometry
