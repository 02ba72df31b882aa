#include <cv_bridge/cv_bridge.h>
#include <image_transport/image_transport.h>
#include <livemap/BestViews.h>
#include <livemap/DetectionArray.h>

#include <algorithm>
#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "common/mutex.h"
#include "nodelets/diagnostics.h"
#include "nodelets/hazard_detection/hazard_tracking.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/picture_masks.h"
#include "nodelets/stamp_checks.h"
#include "perception/detection/detector_pool.h"
#include "perception/detection/hazard_detector.h"
#include "perception/privacy/picture_masker.h"
#include "ros/conversions/detection_conversions.h"
#include "ros/parameters/hazard_detection_parameters.h"

namespace livemap::nodelets {

/// Detects hazards in the rectified images of the vehicle: exactly one `hazard/detections` with the
/// image's stamp for each processed frame, also when it is empty, and `hazard/annotated` when
/// somebody listens. With tracking also `hazard/events`, each object once at its best view.
///
/// The subscriber's callback only puts the pointer of the image into a queue, so ROS's own
/// queue, which would lose frames without a word, never fills: it has no bound. The bound is
/// queue_size, where the oldest frame goes and is counted: frames_in = frames_processed +
/// frames_dropped + frames_waiting, at any moment. The engines of a pool take from the queue, and
/// DeliverResult gets their results in the order of the frames, on a thread of its own.
class HazardDetectionPart : public NodeletPart {
 public:
  ~HazardDetectionPart() override {
    diagnostics_.reset();
    subscriber_.shutdown();
    if (pool_) pool_->Close();
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Frame {
    sensor_msgs::ImageConstPtr image;
    std::uint64_t round = 0;   ///< How often time had been set back when it came.
    bool in_one_view = false;  ///< The one in all views was just before it.
  };
  /// What an engine makes of an image.
  struct Seen {
    cv_bridge::CvImageConstPtr bgr;
    std::vector<perception::HazardDetection> found;
    double ms = 0;  ///< conversion and detection
    bool in_one_view = false;
  };
  using Pool = perception::DetectorPool<Frame, Seen>;

  void Initialize() override {
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
        MakeMaskerConfig(config_.privacy, config_.mask));
    SayWhatFindsFaces(getName(), *masker_);
    // The tracker begins anew at the first image of the round: images of before may be in work.
    stamps_ =
        std::make_unique<StampChecks>(getName(), config_.max_stamp_ahead_s, [this] { ++round_; });
    ros::NodeHandle& node = getNodeHandle();
    detections_publisher_ = node.advertise<DetectionArray>("hazard/detections", 100);
    image_transport::ImageTransport transport(node);
    annotated_publisher_ = transport.advertise("hazard/annotated", 10);
    if (config_.tracking.tracking) {
      events_publisher_ = node.advertise<DetectionArray>("hazard/events", 100);
      best_views_publisher_ = node.advertise<BestViews>("hazard/best_views", 100);
      tracking_ = std::make_unique<HazardTracking>(config_.tracking, manifest, node,
                                                   config_.max_stamp_ahead_s);
    }
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
            [this](const sensor_msgs::ImageConstPtr& image) { OnImage(image); }),
        ros::VoidPtr(), hints);
  }

  void OnImage(const sensor_msgs::ImageConstPtr& image) {
    if (!stamps_->IsUsable("an image", image->header.stamp)) return;
    const double stamp_s = image->header.stamp.toSec();
    const bool in_one_view = config_.all_views_hz > 0 &&
                             std::abs(stamp_s - all_views_stamp_s_) * config_.all_views_hz < 1;
    if (!in_one_view) all_views_stamp_s_ = stamp_s;
    pool_->Push({image, round_, in_one_view});
  }

  void StartPool() {
    std::vector<Pool::Engine> engines;
    for (const std::unique_ptr<perception::HazardDetector>& detector : detectors_) {
      engines.emplace_back([this, &detector](const Frame& frame, std::size_t waiting) {
        const Clock::time_point start = Clock::now();
        Seen seen;
        seen.bgr = cv_bridge::toCvShare(frame.image, "bgr8");
        seen.in_one_view = frame.in_one_view || IsBehind(waiting);
        seen.found =
            detector->Detect(seen.bgr->image, seen.in_one_view ? perception::Look::kFirstView
                                                               : perception::Look::kAllViews);
        seen.ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
        return seen;
      });
    }
    pool_ = std::make_unique<Pool>(std::move(engines), static_cast<std::size_t>(config_.queue_size),
                                   [this](const Pool::Outcome& outcome) {
                                     if (outcome.result) {
                                       DeliverResult(*outcome.result, outcome.item);
                                     } else {
                                       Drop(outcome.error);
                                     }
                                   });
  }

  /// Whether so many images wait that the model's first view must do.
  bool IsBehind(std::size_t waiting) const {
    const auto limit = static_cast<std::size_t>(config_.one_view_from_waiting);
    return limit > 0 && waiting >= limit;
  }

  void Drop(const std::string& error) {
    const MutexLock lock(figures_mutex_);
    ++figures_.bad;
    NODELET_ERROR_THROTTLE(kSayAgainS, "dropped an image of %s: %s", subscriber_.getTopic().c_str(),
                           error.c_str());
  }

  /// Called image after image in the order in which they came.
  void DeliverResult(const Seen& seen, const Frame& frame) {
    const std_msgs::Header& header = frame.image->header;
    const cv::Mat& bgr = seen.bgr->image;
    std::vector<perception::HazardDetection> found = seen.found;
    found.erase(
        std::remove_if(found.begin(), found.end(),
                       [this](const perception::HazardDetection& each) { return IsWeak(each); }),
        found.end());
    const std::uint64_t number = masker_->CountFrame();
    // First of all: who keeps the images hears which ones the events need.
    const std::vector<DetectionArray> events = Follow(seen, frame);
    detections_publisher_.publish(boost::make_shared<DetectionArray>(ros_io::ToMessage(
        found, header, detectors_.front()->manifest().name, bgr.size(), seen.ms)));
    for (const DetectionArray& event : events) events_publisher_.publish(event);
    {
      const MutexLock lock(figures_mutex_);
      figures_.detections += found.size();
      ++figures_.processed_in_window;
      figures_.ms_in_window += seen.ms;
      figures_.in_one_view += seen.in_one_view ? 1 : 0;
    }
    // Last: who reports a hazard does not wait for masks and boxes that somebody looks at.
    if ((config_.annotate_empty || !found.empty()) &&
        annotated_publisher_.getNumSubscribers() > 0) {
      if (const auto picture = Drawn(bgr, number, found, header)) {
        annotated_publisher_.publish(picture);
        CountPicture();
      }
    }
  }

  /// Below the model's threshold: for the tracker alone.
  bool IsWeak(const perception::HazardDetection& found) const {
    return found.confidence < thresholds_[static_cast<std::size_t>(found.class_index)];
  }

  /// The tracker's events, if it runs; the images of best views are told.
  std::vector<DetectionArray> Follow(const Seen& seen, const Frame& frame) {
    if (!tracking_) return {};
    const std_msgs::Header& header = frame.image->header;
    BestViews best_views;
    best_views.header = header;
    std::vector<DetectionArray> events;
    {
      const MutexLock lock(tracking_mutex_);
      if (frame.round != tracked_round_) tracking_->StartAnew();
      tracked_round_ = frame.round;
      events = tracking_->Add(seen.found, header, seen.bgr->image.size());
      best_views.stamps = tracking_->BestViewStamps(events);
    }
    best_views_publisher_.publish(best_views);
    return events;
  }

  /// Masked first, so that the drawn boxes stay whole; a picture that cannot be masked stays here:
  /// none.
  sensor_msgs::ImagePtr Drawn(const cv::Mat& bgr, std::uint64_t number,
                              const std::vector<perception::HazardDetection>& found,
                              const std_msgs::Header& header) {
    std::vector<cv::Rect> subjects;
    subjects.reserve(found.size());
    for (const perception::HazardDetection& each : found) subjects.emplace_back(each.box);
    const perception::PictureMasker::Masked masked =
        masker_->Mask(bgr, number, cv::Rect({}, bgr.size()), subjects);
    if (masked.bgr.empty()) {
      NODELET_ERROR_THROTTLE(kSayAgainS, "a picture is withheld: %s", masked.why_withheld.c_str());
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
    Pool::Counters counters = pool_->counters();
    // An image whose stamp cannot be came, too, and is unusable.
    const std::uint64_t refused = stamps_->refused();
    counters.in += refused;
    counters.dropped += refused;
    figures.bad += refused;
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
    status.add("frames_in_one_view", figures.in_one_view);
    status.add("frames_annotated", figures.annotated);
    const perception::PictureMasker::Counters pictures = masker_->counters();
    status.add("pictures_withheld", pictures.withheld);
    status.add("regions_masked", pictures.masked_regions);
    status.add("masks_found_by", masker_->finder());
    status.add("detections", figures.detections);
    stamps_->Diagnose(status);
    if (tracking_) DiagnoseTracking(status);
    status.add("rate_hz", window_s > 0 ? in_window / window_s : 0.0);
    status.add("detection_ms", in_window > 0 ? figures.ms_in_window / in_window : 0.0);
    status.add("model", detectors_.front()->manifest().name);
    status.add("engine", perception::NameOf(detectors_.front()->Engine()));
    status.add("precision", perception::NameOf(detectors_.front()->ComputesIn()));
    status.add("engines", detectors_.size());
  }

  void DiagnoseTracking(Diagnostics::Status& status) {
    const MutexLock lock(tracking_mutex_);
    const perception::ObjectTracker::Counters& counters = tracking_->counters();
    status.add("events", counters.events);
    status.add("tracks", counters.tracks);
    status.add("tracks_forgotten", counters.forgotten);
    status.add("tracker_resets", counters.resets);
    status.add("images_late", counters.late);
    status.add("boxes_refused", counters.refused);
    status.add("frames_with_motion", tracking_->frames_with_motion());
  }

  /// What the queue does not count.
  struct Figures {
    std::uint64_t bad = 0;
    std::uint64_t annotated = 0;
    std::uint64_t detections = 0;
    std::uint64_t in_one_view = 0;
    std::uint64_t processed_in_window = 0;
    double ms_in_window = 0;
  };

  ros_io::HazardDetectionConfig config_;
  std::vector<std::unique_ptr<perception::HazardDetector>>
      detectors_;                  ///< Each its engine's thread's own.
  std::vector<float> thresholds_;  ///< The model's, by class index.
  // DeliverResult's and the diagnostics':
  Mutex tracking_mutex_;
  /// None: tracking is off.
  std::unique_ptr<HazardTracking> tracking_ PT_GUARDED_BY(tracking_mutex_);
  std::uint64_t tracked_round_ GUARDED_BY(tracking_mutex_) = 0;  ///< Of the newest image in it.
  // The subscriber's own:
  std::uint64_t round_ = 0;
  double all_views_stamp_s_ = -std::numeric_limits<double>::infinity();
  std::unique_ptr<perception::PictureMasker> masker_;
  std::unique_ptr<StampChecks> stamps_;
  image_transport::Subscriber subscriber_;
  ros::Publisher detections_publisher_;
  ros::Publisher events_publisher_;
  ros::Publisher best_views_publisher_;
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

using HazardDetectionNodelet = PartNodelet<HazardDetectionPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::HazardDetectionNodelet, nodelet::Nodelet)
