#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/queues/token_bucket.h"
#include "protocol/offloaded_frame.h"
#include "vehicle/pictures/picture_order.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::vehicle {

/// The small vehicle's outlet: of the frames that the classifier holds worth sending it sends those
/// that show another place than the last one sent, each with the pose of its moment, within a
/// budget of bytes. `now_s` is the clock of the stamps. Not thread-safe.
class OffloadSender {
 public:
  struct Config {
    std::string drive_id;
    double rate_hz = 5.0;  ///< Frames that the classifier sees.
    /// Road between two frames that are sent: a standing car does not stream, m.
    double min_spacing_m = 3.0;
    double max_bytes_per_s = 60000;  ///< Of pictures, in the long run.
    double burst_s = 10.0;           ///< Unused budget of this long may be spent at once, s.
    /// Of one picture: what the budget leaves, but at most this, bytes. So pictures are good on a
    /// calm road and smaller, rather than fewer, where much is worth sending.
    int max_image_bytes = 40000;
    /// A frame for which the budget leaves less than this is dropped, bytes.
    int min_image_bytes = 12000;
    int max_waiting_frames = 16;  ///< Frames that wait for their pose; then the oldest goes.
    VehiclePoseLookup::Config pose;
  };

  /// Since the start. frames = rate_skipped + taken.
  struct Counters {
    std::uint64_t frames = 0;        ///< All that came.
    std::uint64_t rate_skipped = 0;  ///< Not looked at: more came than rate_hz.
    std::uint64_t taken = 0;         ///< For the classifier.
    std::uint64_t discarded = 0;     ///< Below the threshold.
    std::uint64_t candidates = 0;    ///< At or above it; what becomes of them follows.
    std::uint64_t sent = 0;
    std::uint64_t sent_bytes = 0;   ///< Of their pictures.
    std::uint64_t same_place = 0;   ///< Within min_spacing_m of the last one sent.
    std::uint64_t over_budget = 0;  ///< No bytes left.
    std::uint64_t no_pose = 0;      ///< No position or course of their moment came.
    std::uint64_t no_camera = 0;    ///< No camera_info or mounting, or another image size.
    std::uint64_t displaced = 0;    ///< Too many waited.
    std::uint64_t withheld = 0;     ///< Could not be masked or encoded.
  };

  /// Makes the file that leaves the car: masked, a JPEG of at most `max_bytes`; empty when it must
  /// not or cannot leave.
  using Encode =
      std::function<std::vector<std::uint8_t>(const CameraImage& image, std::size_t max_bytes)>;

  explicit OffloadSender(const Config& config);

  void SetIntrinsics(const geo::CameraIntrinsics& intrinsics) { intrinsics_ = intrinsics; }
  /// Pose of the camera's optical frame in base_link.
  void SetMounting(const std::string& frame_id, const Eigen::Isometry3d& base_from_optical);
  bool HasMounting(const std::string& frame_id) const { return mountings_.count(frame_id) != 0; }

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  FixTrack::Verdict AddFix(const geo::Fix& fix, std::int64_t now_ns = 0) {
    return pose_.AddFix(fix, now_ns);
  }
  bool AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns = 0) {
    return pose_.AddPose(stamp_ns, pose, now_ns);
  }
  /// The clock was set back: positions and frames of before are forgotten, the frames as no_pose.
  void StartAnew();

  /// Whether the classifier shall look at the frame of this moment: rate_hz on average, whatever
  /// the camera's rate.
  bool Takes(std::int64_t stamp_ns);
  /// The classifier's word on a frame that was taken; `is_candidate`: it is to be sent.
  void AddJudged(std::int64_t stamp_ns, const std::string& frame_id, float score, bool is_candidate,
                 const CameraImage& image, double now_s);

  /// The frames that can go now, in their order.
  std::vector<protocol::OffloadedFrame> TakeReady(double now_s, const Encode& encode);

  const Counters& counters() const { return counters_; }
  std::size_t waiting() const { return waiting_.size(); }

 private:
  struct Waiting {
    std::int64_t stamp_ns = 0;
    std::string frame_id;
    float score = 0;
    CameraImage image;
    double arrival_s = 0;
  };

  /// True when the frame is done, whatever became of it.
  bool Advance(Waiting& waiting, double now_s, const Encode& encode,
               std::vector<protocol::OffloadedFrame>& ready);
  bool FitsCamera(const Waiting& waiting) const;
  std::optional<protocol::OffloadedFrame> Encoded(const Waiting& waiting,
                                                  const VehiclePoseLookup::Lookup& lookup,
                                                  const Encode& encode);

  Config config_;
  VehiclePoseLookup pose_;
  std::optional<geo::CameraIntrinsics> intrinsics_;
  std::map<std::string, Eigen::Isometry3d> mountings_;
  std::deque<Waiting> waiting_;
  std::optional<std::int64_t> due_ns_;      ///< When the classifier's next frame is due.
  std::optional<std::int64_t> newest_ns_;   ///< Of the frames that came.
  std::optional<geo::GeoPoint> last_sent_;  ///< Where.
  TokenBucket budget_;                      ///< Bytes, by the frames' stamps.
  Counters counters_;
};

/// The intrinsics of an image that was resized to `width` x `height` pixels.
geo::CameraIntrinsics Resized(const geo::CameraIntrinsics& intrinsics, int width, int height);

}  // namespace livemap::vehicle
