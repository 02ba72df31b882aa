#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "odometry/edge/aligner.h"
#include "odometry/edge/edge_extractor.h"
#include "odometry/edge/keyframe.h"
#include "odometry/edge/keyframe_point_selector.h"
#include "odometry/edge/rgbd_frame.h"
#include "odometry/edge/usual_evidence.h"
#include "odometry/edge/wide_search.h"

namespace livemap::odometry {

/// Whose edges choose the pixels of the keyframe that are aligned.
enum class EdgeSource {
  kKeyframe,  ///< The keyframe's own: extracted once, with their Jacobians.
  kNewImage,  ///< The new image's, as a mask on the keyframe (thesis, equation 5.2).
};

enum class VoState { kInitialising, kTracking, kLost };
const char* VoStateName(VoState state);

/// Where the camera is after one frame.
struct VoResult {
  VoState state = VoState::kInitialising;
  /// World: the optical frame of the first keyframe.
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  /// Of a right-hand perturbation, world_from_camera * Exp(delta): translation (m^2), then rotation
  /// (rad^2), in the camera's own axes. Grows while lost.
  Matrix6d covariance = Matrix6d::Zero();
  /// Velocity in the camera's axes: m/s, rad/s; none without two tracked frames in a row.
  std::optional<Vector6d> twist;
  Matrix6d twist_covariance = Matrix6d::Zero();  ///< Same axes, squared units of twist.
  bool new_keyframe = false;
  bool keyframe_due = false;  ///< The rules ask for one; it was made if the frame had depth.
  std::int64_t keyframe_stamp_ns = 0;
  std::size_t points = 0;   ///< Of the finest level that was used.
  std::size_t inliers = 0;  ///< Of them.
  double sigma = 0;         ///< Of the residuals, grey levels.
  double overlap = 0;       ///< Share of the keyframe's points in view.
  double agreement = 0;     ///< Share of those in view whose residual is explained.
  /// Share of the keyframe's surfaces that this frame measures where the motion has them; none
  /// without depth on both sides.
  std::optional<double> surfaces;
  int iterations = 0;  ///< All levels.
};

/// Edge-direct visual odometry (thesis, chapter 5) over rectified images with depth. One thread,
/// deterministic; the buffers of one frame serve the next. Not thread-safe.
class EdgeOdometry {
 public:
  struct Config {
    EdgeExtractor::Config edges;
    EdgeSource edge_source = EdgeSource::kKeyframe;
    AlignmentConfig alignment;
    /// Points per level, finest first.
    std::array<int, kMaxLevels> max_points = {6000, 4000, 2000};
    PointSelection points;  ///< Its max_points is taken from above.
    /// Each frame starts from the last motion too (thesis, equation 5.7), not the last pose alone.
    bool constant_motion = true;
    DepthPyramid::Range depth_range;

    /// A keyframe every so many frames; 1 is frame to frame, 0 only by the rules below.
    int keyframe_every = 0;
    /// A new keyframe when less than this share of the points is in view,
    double keyframe_overlap = 0.6;
    /// or the points moved further than this on average, share of the image's width; if they do
    double keyframe_motion = 0.018;
    /// by this part of it in a single step already: then further than so many steps, too, but not
    /// than this share of the width: a keyframe costs more than a frame, each adds its error to the
    /// path, and a fast camera would make every frame one,
    double keyframe_slow = 0.5;
    double keyframe_steps = 3.5;
    double keyframe_max_motion = 0.13;
    /// or the residuals grew by this factor since the keyframe's first frame.
    double keyframe_sigma_ratio = 1.6;

    /// Tracking is lost with fewer points in view than this,
    int min_points = 150;
    /// a smaller share of them, or than the second if the surfaces in view are where they should
    /// be,
    double min_overlap = 0.25;
    double min_measured_overlap = 0.12;
    /// or residuals of this standard deviation, grey levels.
    double lost_sigma = 30;
    /// or when less than this share of the points in view is explained, or than the second if the
    /// surfaces in view are where they should be, and the last frames' agreement was small or
    /// varied: pictures blur,
    double min_agreement = 0.5;
    double min_measured_agreement = 0.3;
    /// or when less than this share of the keyframe's surfaces is where this frame's depth is.
    double min_surfaces = 0.5;
    /// An alignment is doubted, and the motion searched widely, when its agreement is smaller than
    /// usual by these drops, or its surfaces or picture are, while the points are further than half
    /// of `surprise` from where the last motion brings them, share of the image's width. A smaller
    /// agreement than a camera that finds back must have is doubted anyway; one smaller by a fourth
    /// of the drop, or no smaller, beyond all of `surprise`. A motion that was searched and is
    /// stranger than `usual.strange` is as doubtful as an ambiguous one.
    UsualEvidence::Drops usual;
    double surprise = 0.012;
    /// So many frames in a row may wait for a keyframe because their motion is ambiguous.
    int max_ambiguous_frames = 2;
    /// They do not wait when less of the keyframe than this is in view: it would be lost, while a
    /// keyframe at an uncertain place is only uncertain.
    double ambiguous_overlap = 0.7;
    /// A search asks features, too, when its outcome has less agreement than this.
    double feature_agreement = 0.65;
    /// A camera that is lost looks for so many of the kept keyframes in each frame: for the newest,
    /// and for the others in turn.
    int searches_per_frame = 3;
    /// Keyframes that are kept to find back, and how far apart: motion as above.
    int keyframes_kept = 8;
    double kept_motion = 0.1;
    /// Lost for so long, a new keyframe starts at the held pose, s.
    double give_up_s = 2.0;

    /// How fast a camera that is lost may move: growth of the held pose's uncertainty, standard
    /// deviation after one second, m and rad.
    double lost_speed_mps = 1.0;
    double lost_turn_rps = 1.0;
    /// What the alignment states of its own covariance is multiplied by this.
    double covariance_factor = 0.9;
  };

  /// Throws Error naming what is wrong with the intrinsics or the configuration.
  EdgeOdometry(const Config& config, const geo::CameraIntrinsics& intrinsics);
  ~EdgeOdometry();

  /// Works off the next frame. Throws Error, and changes nothing, when its size or type is wrong or
  /// its stamp is not later than the last one's.
  VoResult Track(const RgbdFrame& frame);

  /// Throws as Track() would for this frame.
  void Check(const RgbdFrame& frame) const;

  /// Makes the last frame, which came without depth, a keyframe with this one: CV_32FC1, m, 0
  /// unknown, and the standard deviations of the inverse depths, 1/m. `twist` (as in VoResult) is
  /// how the camera moves, where Track() could not tell yet. False, and nothing changed, when there
  /// are too few edges with depth.
  bool AddKeyframe(const cv::Mat& depth_m, const cv::Mat& inverse_depth_sigma,
                   const std::optional<Vector6d>& twist);

  /// Track() was wrong about the last frame: the camera is where this brings it, and the motion of
  /// the last `since_s` was as wrong.
  void Correct(const Eigen::Isometry3d& said_from_true, double since_s);

  /// Makes a frame that was followed before the last one a keyframe, when it gets its depth later:
  /// its picture, stamp and depth (CV_32FC1), the standard deviations as above, and what Track()
  /// said of it. Called between two frames; images() is not valid until the next one. False, and
  /// nothing else changed, when there are too few edges with depth.
  bool AddEarlierKeyframe(const RgbdFrame& frame, const cv::Mat& inverse_depth_sigma,
                          const VoResult& result);

  /// Of the last frame, the finest level smoothed; valid until it is made a keyframe.
  const ImagePyramid& images() const { return frame_images_; }

  /// Forgets everything; the next frame is the world's origin.
  void Reset();

  /// The keyframe that the last frame was aligned with; none before the first.
  const Keyframe* keyframe() const { return keyframe_; }

 private:
  /// Starts of an alignment; at most four.
  struct Guesses {
    std::array<Eigen::Isometry3d, 4> new_from_reference;
    std::size_t count = 0;
    void Add(const Eigen::Isometry3d& guess) { new_from_reference[count++] = guess; }
    const Eigen::Isometry3d* begin() const { return new_from_reference.data(); }
    const Eigen::Isometry3d* end() const { return new_from_reference.data() + count; }
  };
  /// Where the camera may be, and how it moves if it is.
  struct Course {
    Eigen::Isometry3d world_from_camera;
    Vector6d twist;
    Eigen::Isometry3d After(double time_s) const {
      return world_from_camera * Se3Exp(twist * time_s);
    }
  };
  struct Attempt {
    Keyframe* keyframe = nullptr;
    AlignmentResult fine;
    int iterations = 0;
    double noise = kNoiseGrey;  ///< See WideSearch::Outcome.
    Evidence evidence;
    bool good = false;
    bool ambiguous = false;
    bool strange = false;   ///< Ambiguous, but not for a rival that was found.
    AlignmentResult rival;  ///< If ambiguous.
  };

  bool MakeKeyframe(const RgbdFrame& frame, const cv::Mat& inverse_depth_sigma,
                    const VoResult& result);
  Attempt TrackFrom(Keyframe& keyframe, const Guesses& guesses);
  AlignmentState BestStart(const EdgePoints& points, int level, const Guesses& guesses);
  const EdgePoints& PointsOf(Keyframe& keyframe, int level);
  Eigen::Isometry3d RotationGuess(Keyframe& keyframe, const Eigen::Isometry3d& from);
  Attempt Follow(std::int64_t stamp_ns);
  Eigen::Isometry3d Expected(std::int64_t stamp_ns) const;
  std::optional<Eigen::Isometry3d> Predicted(std::int64_t stamp_ns) const;
  void ComparePicture(const Keyframe& keyframe, const Eigen::Isometry3d& new_from_reference,
                      PicturePoints::Differences& differences) const;
  double PictureNoise(const Keyframe& keyframe) const;
  bool IsRecognised(const Attempt& attempt) const;
  bool IsDoubtful(const Attempt& attempt, std::int64_t stamp_ns) const;
  Attempt SearchAmong(Keyframe& keyframe, const MotionProposals& proposals);
  Attempt SearchFrom(Keyframe& keyframe, const Guesses& guesses);
  Attempt BetterOf(const Attempt& first, const Attempt& second);
  Attempt SearchPeriods(Keyframe& keyframe, Attempt found);
  void ProposeByFeatures(Keyframe& keyframe, MotionProposals& proposals);
  void TellApart(std::int64_t stamp_ns, Attempt& attempt) const;
  void CastDoubt(std::int64_t stamp_ns, Attempt& attempt) const;
  Attempt FindBack();
  MeasuredDepth Depth() const;
  SurfaceConstraint SurfacesOf(const Keyframe& keyframe) const;
  void Judge(Attempt& attempt) const;
  bool IsBetter(const Attempt& found, const Attempt& followed);
  Attempt Better(const Attempt& found, const Attempt& followed);
  double PixelsFrom(const Eigen::Isometry3d& new_from_reference, const Attempt& attempt) const;
  bool IsGood(const Attempt& attempt) const;
  bool WantsKeyframe(const AlignmentResult& result, const Eigen::Isometry3d& world_from_camera);
  double Motion(const Keyframe& keyframe, const Eigen::Isometry3d& world_from_one,
                const Eigen::Isometry3d& world_from_other) const;
  void ForgetNearOnes();
  void ReserveBuffers();
  void ForgetCourses();
  VoResult Accept(const Attempt& attempt, std::int64_t stamp_ns);
  Eigen::Isometry3d Continued(const Attempt& attempt, std::int64_t stamp_ns) const;
  Matrix6d WithinReach(const Matrix6d& covariance, double time_s) const;
  VoResult Hold(std::int64_t stamp_ns);

  Config config_;
  LevelCameras cameras_;
  KeyframePointSelector selector_;
  Aligner aligner_, rotation_aligner_;
  WideSearch wide_search_;
  PictureFeatures frame_features_;
  RgbdFrame frame_;  // The last one, as it was given.
  ImagePyramid frame_images_;

  std::vector<std::unique_ptr<Keyframe>> keyframes_;  // In use, oldest first.
  std::vector<std::unique_ptr<Keyframe>> spare_;
  Keyframe* keyframe_ = nullptr;
  double keyframe_first_sigma_ = 0;
  int frames_since_keyframe_ = 0;
  std::size_t searched_keyframes_ = 0;  // By a camera that is lost.
  int ambiguous_frames_ = 0;            // In a row.
  // Whether the last motion was told apart from all others, or could not be in several frames.
  bool settled_ = false;
  UsualEvidence usual_;
  AlignmentState light_;  // Gain and bias of the last frame.

  /// After the last frame, where it is known; the second one if that was ambiguous.
  std::optional<Course> course_, rival_course_;
  VoResult last_;
  std::optional<std::int64_t> last_stamp_ns_;
  std::int64_t tracked_stamp_ns_ = 0;
};

/// How the uncertainty of a held pose grows between two times since tracking was lost, s.
void GrowWhileLost(const EdgeOdometry::Config& config, double from_s, double to_s,
                   Matrix6d& covariance);

}  // namespace livemap::odometry
