#include <cv_bridge/cv_bridge.h>
#include <image_transport/image_transport.h>
#include <livemap/DetectionArray.h>
#include <livemap/PicturePart.h>
#include <livemap/PictureRequest.h>
#include <nodelet/nodelet.h>

#include <algorithm>
#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <chrono>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "common/mutex.h"
#include "nodelets/diagnostics.h"
#include "nodelets/hazard_detection/hazard_tracking.h"
#include "nodelets/hazard_detection/recent_pictures.h"
#include "nodelets/nodelet_support.h"
#include "perception/detection/detector_pool.h"
#include "perception/detection/hazard_detector.h"
#include "perception/privacy/picture_masker.h"
#include "ros/conversions/detection_conversions.h"
#include "ros/parameters/hazard_detection_parameters.h"

namespace livemap::nodelets {

/// Detects hazards in the rectified images of the vehicle: exactly one `hazard/detections` with the
/// image's stamp for each processed frame, also when it is empty, and `hazard/annotated` when
/// somebody listens. With tracking also `hazard/events`, each object once at its best view, and the
/// picture of an image of the last moments as `hazard/picture` to who asks for it by
/// `hazard/picture_request`, or as `hazard/picture_part` where a part of it is enough.
///
/// The subscriber's callback only puts the pointer of the image into a queue, so ROS's own
/// queue, which would lose frames without a word, never fills: it has no bound. The bound is
/// queue_size, where the oldest frame goes and is counted: frames_in = frames_processed +
/// frames_dropped + frames_waiting, at any moment. The engines of a pool take from the queue, and
/// DeliverResult gets their results in the order of the frames, on a thread of its own.
class HazardDetectionNodelet : public nodelet::Nodelet {
 public:
  ~HazardDetectionNodelet() override {
    diagnostics_.reset();
    subscriber_.shutdown();
    request_subscriber_.shutdown();
    if (pool_) pool_->Close();
  }

 private:
  using Clock = std::chrono::steady_clock;
  /// What an engine makes of an image.
  struct Seen {
    cv_bridge::CvImageConstPtr bgr;
    std::vector<perception::HazardDetection> found;
    double ms = 0;  ///< conversion and detection
  };
  /// An image that may be asked for.
  struct Kept {
    cv_bridge::CvImageConstPtr bgr;
    std::vector<perception::HazardDetection> found;
    std_msgs::Header header;
  };
  using Recent = RecentPictures<Kept>;
  using Pool = perception::DetectorPool<sensor_msgs::ImageConstPtr, Seen>;

  void onInit() override {
    InitializeOrExplain(getName(), [this] { Initialize(); });
  }

  void Initialize() {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadHazardDetectionConfig(parameters);
    const perception::ModelManifest manifest = perception::ReadModelManifest(config_.model);
    const std::optional<perception::EngineKind> engine = perception::ParseEngineChoice(
        config_.engine, "parameter '" + getPrivateNodeHandle().resolveName("engine") + "'");
    thresholds_ = manifest.thresholds;
    perception::ModelManifest lowered = manifest;
    if (config_.tracking.tracking) {
      const auto share = static_cast<float>(config_.tracking.tracker.low_share);
      for (float& threshold : lowered.thresholds) threshold *= share;
    }
    for (int i = 0; i < config_.engines; ++i) {
      detectors_.push_back(
          std::make_unique<perception::HazardDetector>(lowered, config_.threads, engine));
    }
    masker_ = std::make_unique<perception::PictureMasker>(
        perception::PictureMasker::Config{config_.privacy, config_.mask});
    ros::NodeHandle& node = getNodeHandle();
    detections_publisher_ = node.advertise<DetectionArray>("hazard/detections", 100);
    image_transport::ImageTransport transport(node);
    annotated_publisher_ = transport.advertise("hazard/annotated", 10);
    picture_publisher_ = node.advertise<sensor_msgs::Image>("hazard/picture", 10);
    part_publisher_ = node.advertise<PicturePart>("hazard/picture_part", 10);
    recent_ = std::make_unique<Recent>(static_cast<std::size_t>(config_.picture_frames));
    if (config_.tracking.tracking) {
      events_publisher_ = node.advertise<DetectionArray>("hazard/events", 100);
      tracking_ = std::make_unique<HazardTracking>(config_.tracking, manifest, node);
    }
    // Beside the images' queue: masking a picture takes longer than detecting in it.
    request_subscriber_ = getMTNodeHandle().subscribe<PictureRequest>(
        "hazard/picture_request", 100,
        [this](const PictureRequest::ConstPtr& request) { AnswerPicture(*request); });
    StartPool();
    window_start_ = Clock::now();
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "hazard_detection", "hazard_detection",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay(),
                                                getPrivateNodeHandle());
    subscriber_ = transport.subscribe(
        "camera_rect/image", 0,
        boost::function<void(const sensor_msgs::ImageConstPtr&)>(
            [this](const sensor_msgs::ImageConstPtr& image) { pool_->Push(image); }),
        ros::VoidPtr(), hints);
  }

  void StartPool() {
    std::vector<Pool::Engine> engines;
    for (const std::unique_ptr<perception::HazardDetector>& detector : detectors_) {
      engines.emplace_back([&detector](const sensor_msgs::ImageConstPtr& image) {
        const Clock::time_point start = Clock::now();
        Seen seen;
        seen.bgr = cv_bridge::toCvShare(image, "bgr8");
        seen.found = detector->Detect(seen.bgr->image);
        seen.ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
        return seen;
      });
    }
    pool_ = std::make_unique<Pool>(std::move(engines), static_cast<std::size_t>(config_.queue_size),
                                   [this](const Pool::Outcome& outcome) {
                                     if (outcome.result) {
                                       DeliverResult(*outcome.result, outcome.item->header);
                                     } else {
                                       Drop(outcome.error);
                                     }
                                   });
  }

  void Drop(const std::string& error) {
    const MutexLock lock(figures_mutex_);
    ++figures_.bad;
    NODELET_ERROR_THROTTLE(60, "dropped an image of %s: %s", subscriber_.getTopic().c_str(),
                           error.c_str());
  }

  /// Called image after image in the order in which they came.
  void DeliverResult(const Seen& seen, const std_msgs::Header& header) {
    const cv::Mat& bgr = seen.bgr->image;
    std::vector<perception::HazardDetection> found = seen.found;
    found.erase(
        std::remove_if(found.begin(), found.end(),
                       [this](const perception::HazardDetection& each) { return IsWeak(each); }),
        found.end());
    // The picture first: who reports a detection wants it at hand.
    if ((config_.annotate_empty || !found.empty()) &&
        annotated_publisher_.getNumSubscribers() > 0) {
      if (const auto picture = Drawn(bgr, found, header, cv::Rect({}, bgr.size()))) {
        annotated_publisher_.publish(picture);
        CountPicture();
      }
    }
    masker_->CountFrame();
    // The image is kept before anything is told of it: who hears of it may ask for it at once.
    const std::vector<DetectionArray> events = Keep(seen, header);
    detections_publisher_.publish(boost::make_shared<DetectionArray>(ros_io::ToMessage(
        found, header, detectors_.front()->manifest().name, bgr.size(), seen.ms)));
    for (const DetectionArray& event : events) events_publisher_.publish(event);
    const MutexLock lock(figures_mutex_);
    figures_.detections += found.size();
    ++figures_.processed_in_window;
    figures_.ms_in_window += seen.ms;
  }

  /// Below the model's threshold: for the tracker alone.
  bool IsWeak(const perception::HazardDetection& found) const {
    return found.confidence < thresholds_[static_cast<std::size_t>(found.class_index)];
  }

  /// The tracker's events, if it runs; the image may be asked for from now on.
  std::vector<DetectionArray> Keep(const Seen& seen, const std_msgs::Header& header) {
    const MutexLock lock(pictures_mutex_);
    std::vector<DetectionArray> events;
    std::vector<std::int64_t> wanted;
    if (tracking_) {
      events = tracking_->Add(seen.found, header, seen.bgr->image.size());
      wanted = tracking_->WantedPictures();
    }
    if (!seen.found.empty()) {
      recent_->Add(static_cast<std::int64_t>(header.stamp.toNSec()), {seen.bgr, seen.found, header},
                   wanted);
    }
    return events;
  }

  void AnswerPicture(const PictureRequest& request) {
    std::optional<Kept> kept;
    std::vector<perception::HazardDetection> shown;
    {
      const MutexLock pictures_lock(pictures_mutex_);
      const auto stamp_ns = static_cast<std::int64_t>(request.stamp.toNSec());
      kept = recent_->Find(stamp_ns);
      if (kept && tracking_) shown = tracking_->ReportedIn(stamp_ns);
    }
    if (!kept) {
      const MutexLock lock(figures_mutex_);
      ++figures_.unknown_requests;
      return;
    }
    shown.erase(
        std::remove_if(shown.begin(), shown.end(),
                       [this](const perception::HazardDetection& each) { return !IsWeak(each); }),
        shown.end());
    for (const perception::HazardDetection& each : kept->found) {
      if (!IsWeak(each)) shown.push_back(each);
    }
    const cv::Rect image({}, kept->bgr->image.size());
    const cv::Rect part = PartOf(request, image);
    const auto picture = Drawn(kept->bgr->image, shown, kept->header, part);
    if (!picture) return;
    if (part == image) {
      picture_publisher_.publish(picture);
    } else {
      const auto answer = boost::make_shared<PicturePart>();
      answer->image = std::move(*picture);
      answer->part = request.part;
      part_publisher_.publish(answer);
    }
    const MutexLock lock(figures_mutex_);
    ++figures_.sent_pictures;
  }

  /// The part of the image that is wanted; all of it where none or one beyond its edges is named.
  static cv::Rect PartOf(const PictureRequest& request, const cv::Rect& image) {
    const auto& part = request.part;
    const std::uint64_t right = std::uint64_t{part.x_offset} + part.width;
    const std::uint64_t bottom = std::uint64_t{part.y_offset} + part.height;
    if (part.width == 0 || part.height == 0 || right > static_cast<std::uint64_t>(image.width) ||
        bottom > static_cast<std::uint64_t>(image.height)) {
      return image;
    }
    return {static_cast<int>(part.x_offset), static_cast<int>(part.y_offset),
            static_cast<int>(part.width), static_cast<int>(part.height)};
  }

  /// `part` of the picture is clear. Masked first, so that the drawn boxes stay whole; a picture
  /// that cannot be masked stays here: none.
  sensor_msgs::ImagePtr Drawn(const cv::Mat& bgr,
                              const std::vector<perception::HazardDetection>& found,
                              const std_msgs::Header& header, const cv::Rect& part) {
    const perception::PictureMasker::Masked masked = masker_->Mask(bgr, part);
    if (masked.bgr.empty()) {
      NODELET_ERROR_THROTTLE(60, "a picture is withheld: %s", masked.why_withheld.c_str());
      return nullptr;
    }
    return ros_io::ToAnnotatedMessage(masked.bgr, found, header);
  }

  void CountPicture() {
    const MutexLock lock(figures_mutex_);
    ++figures_.annotated;
  }

  void Diagnose(Diagnostics::Status& status) {
    Figures figures;
    {
      const MutexLock lock(figures_mutex_);
      figures = figures_;
      figures_.processed_in_window = 0;
      figures_.ms_in_window = 0;
    }
    const Pool::Counters counters = pool_->counters();
    const Clock::time_point now = Clock::now();
    const double window_s = std::chrono::duration<double>(now - window_start_).count();
    window_start_ = now;
    const auto in_window = static_cast<double>(figures.processed_in_window);
    const bool more_dropped = dropped_watch_.HasRisen(counters.dropped);
    const bool more_bad = bad_watch_.HasRisen(figures.bad);
    if (more_dropped) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                     more_bad ? "dropping unusable images" : "behind: dropping frames");
    } else if (figures.processed_in_window == 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no frames");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    status.add("frames_in", counters.in);
    status.add("frames_processed", counters.processed);
    status.add("frames_dropped", counters.dropped);  // unusable ones among them
    status.add("frames_waiting", counters.waiting);
    status.add("frames_unusable", figures.bad);
    status.add("frames_annotated", figures.annotated);
    const perception::PictureMasker::Counters pictures = masker_->counters();
    status.add("pictures_withheld", pictures.withheld);
    status.add("regions_masked", pictures.masked_regions);
    status.add("detections", figures.detections);
    status.add("pictures_sent", figures.sent_pictures);
    status.add("pictures_unknown", figures.unknown_requests);
    if (tracking_) DiagnoseTracking(status);
    status.add("rate_hz", window_s > 0 ? in_window / window_s : 0.0);
    status.add("detection_ms", in_window > 0 ? figures.ms_in_window / in_window : 0.0);
    status.add("model", detectors_.front()->manifest().name);
    status.add("engine", perception::NameOf(detectors_.front()->Engine()));
    status.add("engines", detectors_.size());
  }

  void DiagnoseTracking(Diagnostics::Status& status) {
    const MutexLock lock(pictures_mutex_);
    const perception::ObjectTracker::Counters& counters = tracking_->counters();
    status.add("events", counters.events);
    status.add("tracks", counters.tracks);
    status.add("tracks_forgotten", counters.forgotten);
    status.add("tracker_resets", counters.resets);
    status.add("boxes_refused", counters.refused);
    status.add("frames_with_motion", tracking_->frames_with_motion());
  }

  /// What the queue does not count.
  struct Figures {
    std::uint64_t bad = 0;
    std::uint64_t annotated = 0;
    std::uint64_t detections = 0;
    std::uint64_t sent_pictures = 0;     ///< On request.
    std::uint64_t unknown_requests = 0;  ///< For images that are not kept any more.
    std::uint64_t processed_in_window = 0;
    double ms_in_window = 0;
  };

  ros_io::HazardDetectionConfig config_;
  std::vector<std::unique_ptr<perception::HazardDetector>>
      detectors_;                  ///< Each its engine's thread's own.
  std::vector<float> thresholds_;  ///< The model's, by class index.
  // DeliverResult's and AnswerPicture's, which run at once:
  Mutex pictures_mutex_;
  /// None: tracking is off.
  std::unique_ptr<HazardTracking> tracking_ PT_GUARDED_BY(pictures_mutex_);
  std::unique_ptr<Recent> recent_ PT_GUARDED_BY(pictures_mutex_);
  std::unique_ptr<perception::PictureMasker> masker_;
  image_transport::Subscriber subscriber_;
  ros::Subscriber request_subscriber_;
  ros::Publisher detections_publisher_;
  ros::Publisher events_publisher_;
  ros::Publisher picture_publisher_;
  ros::Publisher part_publisher_;
  image_transport::Publisher annotated_publisher_;
  // The diagnostics' own:
  Clock::time_point window_start_;
  CounterWatch dropped_watch_, bad_watch_;

  Mutex figures_mutex_;
  Figures figures_ GUARDED_BY(figures_mutex_);
  // Last: their threads use the rest.
  std::unique_ptr<Pool> pool_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::HazardDetectionNodelet, nodelet::Nodelet)
