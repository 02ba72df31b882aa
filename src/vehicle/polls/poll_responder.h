#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "imaging/box.h"
#include "imaging/report_picture.h"
#include "placement/projected_place.h"
#include "placement/sighting.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/poll.h"
#include "vehicle/pictures/picture_order.h"
#include "vehicle/polls/change_evidence.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::vehicle {

/// Answers the zone's polls by what the camera sees at the places asked about (thesis, 3.1).
///
/// Yes: a detection of the class at the place. No: the place was well in view, near enough for the
/// detector, in several images from different spots, and none had a match. Otherwise "can't see",
/// with the reason that kept most images from counting. A yes goes out at once; a no when the place
/// has left the view, so that the nearest images count, too; the rest when the poll's time is over.
///
/// Change detection has a say, too: where it knows that a thing of the class went, one clear view
/// without a match makes a no; where it knows that one came, nothing does.
///
/// Whoever asks for a whole frame wants to look for himself: then a yes waits for a view from
/// within max_range_m, and "can't see" has a picture, too, where the place was in a clear view
/// once.
///
/// The responder holds images as the camera saw them, and never puts one into an answer: it orders
/// the picture (TakePictureOrders) once the answer stands, and takes what may leave the vehicle
/// (AddPictures).
///
/// Two clocks as in HazardReporter: `now_s` is that of the stamps, `steady_s` never pauses. How
/// long a poll lives is what the zone wrote, counted from its arrival on the steady clock: the
/// vehicle's and the zone's clocks need not agree. Not thread-safe.
class PollResponder {
 public:
  struct Config {
    std::string drive_id;
    int max_open = 16;            ///< Polls at the same time; further ones are not taken.
    double max_life_s = 3600;     ///< A poll that wants to live longer is cut to this.
    double reserve_s = 3;         ///< The answer leaves this long before the poll expires.
    double max_range_m = 20;      ///< Beyond it the detector may overlook a hazard.
    double margin_share = 0.05;   ///< Of the image's sides: what lies there is cut off.
    double gate_sigma = 3;        ///< Between a detection and the place, standard deviations.
    int no_views = 4;             ///< Clear views without a match that make a no.
    double view_spacing_m = 1.0;  ///< Way between two views that count: frames at rest are one.
    double dark_luminance = 20;   ///< 0..255: mean of the image below which nothing counts.
    double miss_share = 0.4;      ///< Share of clear views in which a detector misses a hazard.
    double min_confidence = 0;    ///< 0..1, of a match.
    double pose_wait_s = 3;       ///< A frame waits at most this long for pose and camera.
    double bracket_wait_s = 0.3;  ///< As in HazardReporter.
    double image_wait_s = 0.3;    ///< A yes waits at most this long for its image.
    /// What the maker of pictures takes at most, s: a no with a picture stands this long before its
    /// answer leaves.
    double picture_wait_s = 3;
    int jpeg_quality = 70;     ///< 1..100.
    imaging::CropConfig crop;  ///< Of a picture that shows a part; its own quality does not count.
    std::size_t max_frame_bytes = 100000;  ///< Of a whole frame, whatever the zone asks for.
    geo::GroundProjectionNoise projection;
  };

  /// What answering needs to know about the vehicle.
  struct Vehicle {
    std::optional<geo::CameraIntrinsics> intrinsics;
    /// Pose of a camera's optical frame in base_link; none: not known yet.
    std::function<std::optional<Eigen::Isometry3d>(const std::string& frame_id)> mounting;
    /// Pose of base_link at the moment of an image that has waited `waited_s`.
    std::function<VehiclePoseLookup::Lookup(std::int64_t stamp_ns, double waited_s)> pose_at;
    /// The image of that stamp; missing where it is not there, or not any more.
    std::function<CameraImage(std::int64_t stamp_ns)> image_at;
  };

  /// Since the start; polls unless it says otherwise.
  struct Counters {
    std::uint64_t polls = 0;
    std::uint64_t repeated = 0;   ///< Known already: not taken again.
    std::uint64_t not_taken = 0;  ///< Too many at the same time, or over before they came.
    std::uint64_t yes = 0;
    std::uint64_t no = 0;
    std::uint64_t cant_see = 0;
    std::uint64_t no_by_change = 0;  ///< Of `no`: the views alone would not have done.
    std::uint64_t disagreed = 0;     ///< Of `cant_see`: the views said no, change detection yes.
    std::uint64_t unanswered = 0;    ///< No position at all to answer from.
    std::uint64_t pictures = 0;
    std::uint64_t picture_bytes = 0;
  };

  PollResponder(const Config& config, const protocol::HazardCatalogue& catalogue)
      : config_(config), catalogue_(catalogue) {}

  void Add(const protocol::Poll& poll, double steady_s);
  /// One processed image with what the detector saw, also when that is nothing.
  void AddFrame(const placement::SightingFrame& frame, double now_s);
  /// The clock was set back: frames of before are forgotten, polls stay open.
  void StartAnew();
  /// How bright the image of that stamp is: its mean, 0..255. Best before its frame.
  void AddLuminance(std::int64_t stamp_ns, double luminance);
  /// What change detection knows of a place; told again it counts once, with its newest figures.
  /// An answer whose picture is being made stands.
  void AddChange(const ChangeEvidence& evidence);
  /// Change detection knew earlier pictures of where the vehicle is, and recognised none of them.
  void AddUnregistered();
  /// The pictures that are wanted now, each order once. Each has to be answered by AddPictures: its
  /// poll waits for it.
  std::vector<PictureOrder> TakePictureOrders();
  /// The answer to an order: its one picture, or nothing where none may leave the vehicle.
  void AddPictures(std::uint64_t order, std::vector<imaging::CroppedPicture> pictures);

  /// Works off waiting frames and expired polls. Answers are ready for TakeReplies.
  void Process(double now_s, double steady_s, const Vehicle& vehicle);
  std::vector<protocol::PollAnswer> TakeReplies();

  /// Mean brightness, 0 to 255, of a coarse grid of the pixels of an 8-bit grey or colour image.
  static double MeanLuminance(const cv::Mat& image);

  std::size_t open() const { return open_.size(); }
  const Counters& counters() const { return counters_; }
  const Config& config() const { return config_; }
  /// How long a frame waits for its pose. The fixes count at once where the fused pose is late: an
  /// answer is wanted soon, and the place asked about is known already.
  VehiclePoseLookup::Patience PosePatience() const {
    return {0, config_.bracket_wait_s, config_.pose_wait_s};
  }

 private:
  /// Why an image did not count.
  enum class Trouble { kNoFix, kNoCamera, kTooFar, kOutside, kDark, kTooFew };
  struct OpenPoll {
    protocol::Poll poll;
    double answer_by_s;  // Steady: the answer leaves, with its picture or without.
    double no_stands_s;  // Steady: from then on nothing waits for a nearer view.
    std::map<Trouble, int> troubles;
    int clear_views = 0;
    std::optional<geo::GeoPoint> last_view;
    std::int64_t view_ns = 0;  // The image that speaks for the answer, and what it showed.
    CameraImage view_image;    // Where the poll wants a picture.
    double view_distance_m = 0;
    imaging::Box view_box;  // The match's, or where the place is in that image.
    geo::TrackPose view_base;
    float match_confidence = 0;
    float vanished = 0;  // Confidence that a thing of the class went, by change detection; or came.
    float appeared = 0;
    int unregistered = 0;             // Images that change detection could not compare.
    bool is_seen = false;             // There was a match: it is a yes.
    std::optional<double> matched_s;  // Steady; it only waits for the picture.
    std::uint64_t order = 0;          // Of its picture; 0: none yet.
    std::optional<std::vector<imaging::CroppedPicture>> pictures;  // Once that was answered.
  };
  struct WaitingFrame {
    placement::SightingFrame frame;
    double arrival_s;
  };

  bool Work(WaitingFrame& waiting, double now_s, double steady_s, const Vehicle& vehicle);
  void Look(OpenPoll& open, const placement::SightingFrame& frame,
            const placement::PlacedCamera& camera, double steady_s, const Vehicle& vehicle);
  std::optional<Trouble> WhyNotClear(const placement::ProjectedPlace& view,
                                     const placement::SightingFrame& frame) const;
  const placement::Sighting* Match(const OpenPoll& open, const placement::SightingFrame& frame,
                                   const placement::ProjectedPlace& view,
                                   const placement::PlacedCamera& camera) const;
  void CountView(OpenPoll& open, const placement::SightingFrame& frame,
                 const placement::ProjectedPlace& view, const geo::TrackPose& base,
                 const Vehicle& vehicle);
  static void SetView(OpenPoll& open, const placement::SightingFrame& frame,
                      const geo::TrackPose& base, const imaging::Box& box, const Vehicle& vehicle);
  bool MayStand(const OpenPoll& open) const;
  bool IsReady(OpenPoll& open, double steady_s, const Vehicle& vehicle);
  static std::string MarkOf(const OpenPoll& open);
  void OrderPicture(OpenPoll& open);
  void ForgetFrames();
  /// Whether views and changes make a no.
  bool IsGone(const OpenPoll& open) const;
  void Answer(OpenPoll& open);
  void AttachPicture(OpenPoll& open, protocol::PollAnswer& reply);
  static std::string ReasonOf(const OpenPoll& open);

  Config config_;
  protocol::HazardCatalogue catalogue_;
  std::deque<OpenPoll> open_;
  std::deque<Uuid> answered_;  // The newest, to know repetitions.
  std::deque<WaitingFrame> waiting_;
  std::map<std::int64_t, double> luminances_;
  std::vector<PictureOrder> picture_orders_;
  std::uint64_t last_order_ = 0;
  std::vector<protocol::PollAnswer> replies_;
  std::optional<geo::TrackPose> newest_base_;
  std::int64_t newest_ns_ = 0;
  Counters counters_;
};

}  // namespace livemap::vehicle
