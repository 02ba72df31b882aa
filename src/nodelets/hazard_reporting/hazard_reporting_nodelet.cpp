#include <cv_bridge/cv_bridge.h>
#include <image_transport/image_transport.h>
#include <image_transport/subscriber.h>
#include <livemap/BestViews.h>
#include <livemap/CellHazards.h>
#include <livemap/CellRequest.h>
#include <livemap/VehicleCells.h>
#include <livemap/VehicleZones.h>
#include <nav_msgs/Odometry.h>
#include <ros/package.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <boost/function.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <set>
#include <string>
#include <utility>

#include "nodelets/diagnostics.h"
#include "nodelets/hazard_reporting/picture_maker.h"
#include "nodelets/hazard_reporting/recent_images.h"
#include "nodelets/hazard_reporting/vehicle_view.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/picture_masks.h"
#include "nodelets/stamp_checks.h"
#include "nodelets/vehicle_tf.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/cell_conversions.h"
#include "ros/conversions/depth_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/poll_conversions.h"
#include "ros/conversions/positioning/localization_conversions.h"
#include "ros/parameters/hazard_reporting_parameters.h"
#include "ros/views/hazard_view.h"
#include "vehicle/pictures/picture_worker.h"
#include "vehicle/polls/poll_responder.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::nodelets {
namespace {

constexpr double kSendTickS = 0.05;
constexpr double kViewPeriodS = 1.0;
constexpr std::size_t kSendPerTick = 10;
constexpr double kMaxTrackS = 60;

}  // namespace

/// Reports what hazard_detection sees to the zone: HazardReporter with topics, tf and clocks. All
/// callbacks run one at a time, in the nodelet's own queue. Timers are steady, so that a paused bag
/// does not stop the delivery.
///
/// The camera's images come as shared pointers and are kept until what the detector found in them
/// is known. PictureWorker makes the pictures that leave the vehicle of them, on its own thread:
/// PictureMaker is the one way from an image to a report or an answer.
class HazardReportingPart : public NodeletPart {
 public:
  ~HazardReportingPart() override {
    diagnostics_.reset();
    image_subscriber_.shutdown();
    subscribers_.clear();
    timers_.clear();
    if (worker_) Finish();
  }

 private:
  /// An image that may be wanted.
  struct Kept {
    sensor_msgs::ImageConstPtr image;
    std::vector<placement::Sighting> sightings;  // Once the detector has answered.
    std::uint64_t number = 0;                    // Of CountFrame.
  };

  void Initialize() override {
    const std::int64_t now_ns = static_cast<std::int64_t>(ros::WallTime::now().toNSec());
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadHazardReportingConfig(parameters, now_ns);
    if (config_.catalogue.empty()) {
      config_.catalogue = ros::package::getPath("livemap") + "/config/hazards.yaml";
    }
    catalogue_ = protocol::HazardCatalogue::Load(config_.catalogue);
    MakeDirectoryOf(config_.reporter.map.path);
    reporter_ = std::make_unique<vehicle::HazardReporter>(
        config_.reporter, catalogue_, EntropySeededGenerator(), now_ns, SteadyS());
    reporter_->SetZones(ros_io::MakeZoneFinder(config_.zones));
    responder_ = std::make_unique<vehicle::PollResponder>(config_.polls, catalogue_);
    maker_ = std::make_unique<PictureMaker>(MakeMaskerConfig(config_.privacy, config_.mask),
                                            getName(), config_.draw_boxes);
    SayWhatFindsFaces(getName(), maker_->masker());
    images_ =
        std::make_unique<RecentImages<Kept>>(static_cast<std::size_t>(config_.picture_frames));
    worker_ = std::make_unique<vehicle::PictureWorker>(
        config_.pictures,
        [this](const vehicle::PictureOrder& order) { return maker_->Make(order); });
    if (!reporter_->map().set_aside().empty()) {
      NODELET_ERROR("%s",
                    ros_io::DescribeSetAside(config_.reporter.map.path, reporter_->map()).c_str());
    }
    if (reporter_->map().broken_rows().count() > 0) {
      NODELET_ERROR(
          "%s", ros_io::DescribeBrokenRows(config_.reporter.map.path, reporter_->map()).c_str());
    }
    Connect();
  }

  static void MakeDirectoryOf(const std::string& path) {
    const auto directory = std::filesystem::path(path).parent_path();
    std::error_code error;
    if (!directory.empty()) std::filesystem::create_directories(directory, error);
    if (error) {
      throw Error("parameter 'database' is '" + path +
                  "', its directory cannot be made: " + error.message());
    }
  }

  void Connect() {
    using Self = HazardReportingPart;
    ros::NodeHandle& node = getNodeHandle();
    report_publisher_ = node.advertise<HazardReport>("hazard/report", 100);
    answer_publisher_ = node.advertise<HazardPollAnswer>("hazard/poll_answer", 100);
    cell_request_publisher_ = node.advertise<CellRequest>("hazard/cell_request", 100);
    cells_publisher_ = node.advertise<VehicleCells>("vehicle/cells", 1, /*latch=*/true);
    view_ = std::make_unique<VehicleView>(config_, *reporter_, catalogue_, node);
    const double max_ahead_s = config_.reporter.track.stamps.max_ahead_s;
    stamps_ = std::make_unique<StampChecks>(getName(), max_ahead_s, [this] { StartAnew(); });
    // Best views of objects come as old as their tracks.
    stamps_->AllowLate("events", kMaxTrackS);
    vehicle_tf_ = std::make_unique<VehicleTf>(node, getName(), config_.map_frame,
                                              config_.base_frame, max_ahead_s);
    mountings_ = std::make_unique<MountingLearner>(
        *vehicle_tf_, [this](const std::string& frame, const Eigen::Isometry3d& mounting) {
          reporter_->SetMounting(frame, mounting);
        });
    subscribers_ = {
        node.subscribe("hazard/detections", 1000, &Self::OnDetections, this),
        node.subscribe("link_state", 1, &Self::OnLink, this),
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("camera_rect/camera_info", 1, &Self::OnCameraInfo, this),
        node.subscribe("hazard/notice", 10000, &Self::OnNotice, this),
        node.subscribe("hazard/cell_notice", 10000, &Self::OnCellNotice, this),
        node.subscribe("hazard/cell_hazards", 1000, &Self::OnCellHazards, this),
        node.subscribe("vehicle/cells_heard", 100, &Self::OnCellsHeard, this),
        node.subscribe("hazard/receipt", 1000, &Self::OnReceipt, this),
        node.subscribe("hazard/poll", 100, &Self::OnPoll, this),
        node.subscribe("change/report", 100, &Self::OnChanges, this),
        node.subscribe("zones", 1, &Self::OnZones, this),
    };
    if (config_.use_events) {
      subscribers_.push_back(node.subscribe("hazard/events", 100, &Self::OnEvents, this));
      subscribers_.push_back(node.subscribe("hazard/best_views", 100, &Self::OnBestViews, this));
    }
    image_transport::ImageTransport transport(node);
    const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay(),
                                                getPrivateNodeHandle());
    image_subscriber_ = transport.subscribe(
        "camera_rect/image", static_cast<std::uint32_t>(config_.picture_frames),
        boost::function<void(const sensor_msgs::ImageConstPtr&)>(
            [this](const sensor_msgs::ImageConstPtr& image) { OnImage(image); }),
        ros::VoidPtr(), hints);
    if (IsFused()) {
      subscribers_.push_back(node.subscribe("localization/odometry", 100, &Self::OnPose, this));
    }
    if (config_.reporter.use_depth) {
      subscribers_.push_back(node.subscribe("camera/depth/image_raw", 10, &Self::OnDepth, this));
    }
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "hazard_reporting", "hazard reporting",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    timers_ = {
        node.createSteadyTimer(ros::WallDuration(kSendTickS), &Self::OnTick, this),
        node.createSteadyTimer(ros::WallDuration(kViewPeriodS), &Self::OnViewTimer, this),
    };
  }

  bool IsFused() const {
    return config_.reporter.position_source == vehicle::PositionSource::kFused;
  }

  /// What waits goes into the outbox, with the pictures that are made, and is sent after the next
  /// start.
  void Finish() {
    try {
      worker_->Deliver(SteadyS());
      worker_.reset();
      reporter_->Process(ros::Time::now().toSec(), SteadyS());
      reporter_->Finish(SteadyS());
    } catch (const std::exception& error) {
      NODELET_ERROR("what waited to be reported is lost: %s", error.what());
    }
  }

  /// Time went back: nothing of before can be compared with what comes.
  void StartAnew() {
    reporter_->StartAnew(ros::Time::now().toSec(), SteadyS());
    responder_->StartAnew();
    images_->Clear();
    view_->StartAnew();
  }

  void OnDetections(const DetectionArray& message) {
    if (!stamps_->IsUsable("detections", message.header.stamp)) return;
    mountings_->Want(message.header.frame_id);
    const placement::SightingFrame frame = ros_io::ToSightingFrame(message);
    NoteSightings(frame);
    responder_->AddFrame(frame, ros::Time::now().toSec());
    if (!config_.use_events) Report(frame);
    Work();
  }

  /// What the detector found in an image; without it nothing wants the image any more.
  void NoteSightings(const placement::SightingFrame& frame) {
    if (Kept* kept = images_->Find(frame.stamp_ns)) kept->sightings = frame.sightings;
    if (frame.sightings.empty() && responder_->open() == 0) images_->Release(frame.stamp_ns);
  }

  /// The images that the tracker may name yet.
  void OnBestViews(const BestViews& message) {
    std::set<std::int64_t> stamps_ns;
    for (const ros::Time& stamp : message.stamps) stamps_ns.insert(ros_io::FromRosTime(stamp));
    images_->Want(std::move(stamps_ns));
  }

  void Report(const placement::SightingFrame& frame) {
    reporter_->AddFrame(frame, ros::Time::now().toSec());
    // Of the others no picture is wanted.
    if (reporter_->FrameWithoutImage(frame.stamp_ns) != nullptr) GiveImage(frame);
  }

  /// The frame's image, if it has come; with the frame's boxes, and the others that the detector
  /// found in it.
  void GiveImage(const placement::SightingFrame& frame) {
    vehicle::CameraImage image = ImageAt(frame.stamp_ns);
    if (image.IsMissing()) return;
    const cv::Mat& bgr = image.picture.bgr;
    const bool fits = bgr.cols == static_cast<int>(frame.image_width) &&
                      bgr.rows == static_cast<int>(frame.image_height);
    std::vector<placement::Sighting> shown = frame.sightings;
    for (const placement::Sighting& other : image.sightings) {
      const auto is_other = [&other](const placement::Sighting& each) {
        return each.class_name == other.class_name && each.box == other.box;
      };
      if (std::none_of(shown.begin(), shown.end(), is_other)) shown.push_back(other);
    }
    image.sightings = fits ? std::move(shown) : std::vector<placement::Sighting>();
    reporter_->AddImage(frame.stamp_ns, image);
  }

  /// The image of that stamp as the camera saw it; missing where it is not kept or unusable. Shares
  /// the pixels with the camera's message where that is bgr8.
  vehicle::CameraImage ImageAt(std::int64_t stamp_ns) {
    const Kept* kept = images_->Find(stamp_ns);
    if (kept == nullptr) return {};
    try {
      const auto shared = cv_bridge::toCvShare(kept->image, sensor_msgs::image_encodings::BGR8);
      return {{shared->image, std::make_shared<const cv_bridge::CvImageConstPtr>(shared)},
              kept->sightings,
              kept->number};
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not usable: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not usable: %s", error.what());
    }
    return {};
  }

  /// Objects that the tracker is sure of, at their best view.
  void OnEvents(const DetectionArray& message) {
    if (!stamps_->IsUsable("events", message.header.stamp)) return;
    mountings_->Want(message.header.frame_id);
    Report(ros_io::ToSightingFrame(message));
    Work();
  }

  void OnImage(const sensor_msgs::ImageConstPtr& image) {
    if (!stamps_->IsUsable("an image", image->header.stamp)) return;
    const std::int64_t stamp_ns = ros_io::FromRosTime(image->header.stamp);
    images_->Add(stamp_ns, {image, {}, maker_->CountFrame()});
    if (responder_->open() > 0) NoteBrightness(image);
    // What was found in it came first: from another process.
    if (const auto frame = reporter_->FrameWithoutImage(stamp_ns)) GiveImage(*frame);
  }

  /// A place that was too dark does not count as seen.
  void NoteBrightness(const sensor_msgs::ImageConstPtr& message) {
    try {
      const auto grey = cv_bridge::toCvShare(message, sensor_msgs::image_encodings::MONO8);
      responder_->AddLuminance(ros_io::FromRosTime(message->header.stamp),
                               vehicle::PollResponder::MeanLuminance(grey->image));
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not looked at: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not looked at: %s", error.what());
    }
  }

  void OnLink(const LinkState& message) {
    try {
      reporter_->SetLink(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
    Work();
  }

  void OnZones(const VehicleZones& message) {
    view_->SetZones(message.zones);
    reporter_->SetZonesNear(message.zones);
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    if (!stamps_->IsUsable("a fix", message.header.stamp)) return;
    const auto before_ns = reporter_->track().newest_ns();
    reporter_->AddFix(ros_io::ToFix(message), RosNowNs());
    const auto newest_ns = reporter_->track().newest_ns();
    const bool by_fixes = !IsFused() || ros_io::IsFusionSilent(*reporter_);
    if (by_fixes && newest_ns && newest_ns != before_ns) {
      const vehicle::FixTrack& track = reporter_->track();
      // The first fix is believed once the next agrees: then both are shown.
      if (!before_ns) view_->ShowFix(*track.oldest_ns(), *track.Oldest());
      view_->ShowFix(*newest_ns, *track.Newest());
      FollowCells(track.Newest()->position);
    }
    Work();
  }

  /// A fused pose of base_link in the map frame.
  void OnPose(const nav_msgs::Odometry& message) {
    if (!stamps_->IsUsable("a fused pose", message.header.stamp)) return;
    view_->LearnDatum(vehicle_tf_->buffer());
    if (!view_->map() || message.header.frame_id != config_.map_frame ||
        message.child_frame_id != config_.base_frame) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "dropped a fused pose of '%s' in '%s': wanted is '%s' in '%s' and tf "
                            "from 'earth' to the latter",
                            message.child_frame_id.c_str(), message.header.frame_id.c_str(),
                            config_.base_frame.c_str(), config_.map_frame.c_str());
      return;
    }
    const std::int64_t stamp_ns = ros_io::FromRosTime(message.header.stamp);
    const geo::TrackPose pose = ros_io::ToTrackPose(message, *view_->map());
    reporter_->AddPose(stamp_ns, pose, RosNowNs());
    if (reporter_->poses().newest_ns() == stamp_ns) {
      view_->ShowPose(pose, message.header.stamp);
      FollowCells(pose.position);
    }
    Work();
  }

  void OnDepth(const sensor_msgs::ImageConstPtr& message) {
    if (!stamps_->IsUsable("a depth image", message->header.stamp)) return;
    try {
      const cv_bridge::CvImageConstPtr shared = ros_io::ToSharedDepth(message);
      const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
      reporter_->AddDepth(ros_io::FromRosTime(message->header.stamp),
                          {shared->image, config_.depth_units_per_m, owner});
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
    Work();
  }

  void OnCameraInfo(const sensor_msgs::CameraInfo& message) {
    try {
      reporter_->SetIntrinsics(ros_io::ToRectifiedIntrinsics(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
  }

  void OnNotice(const HazardNotice& message) {
    try {
      reporter_->AddNotice(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  /// To the vehicles of the cell in which its place lies.
  void OnCellNotice(const HazardNotice& message) {
    try {
      protocol::Notice notice = ros_io::FromMessage(message);
      if (!geo::IsValid(notice.position)) throw Error("a notice of a cell has no valid place");
      notice.cell = geo::MapCell::At(notice.position);
      reporter_->AddNotice(notice);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnCellHazards(const CellHazards& message) {
    try {
      reporter_->AddCellNews(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnCellsHeard(const VehicleCells& message) {
    try {
      reporter_->SetCellsHeard(message.zone, ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  /// The vehicle is here: it hears of the cells around it.
  void FollowCells(const geo::GeoPoint& position) {
    if (!geo::IsValid(position) || !reporter_->FollowCells(position)) return;
    cells_publisher_.publish(ros_io::ToMessage(reporter_->cells().wanted()));
  }

  void OnReceipt(const ReportReceipt& message) {
    try {
      const protocol::Receipt receipt = ros_io::FromMessage(message);
      if (receipt.status == protocol::Receipt::Status::kRefused) {
        NODELET_WARN_THROTTLE(kSayAgainS, "the zone refused report %s: %s",
                              receipt.report_uuid.ToString().c_str(), receipt.reason.c_str());
      }
      reporter_->AddReceipt(receipt);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnPoll(const HazardPoll& message) {
    try {
      responder_->Add(ros_io::FromMessage(message), SteadyS());
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  /// Has a say in what polls are answered.
  void OnChanges(const ChangedObjects& message) {
    if (message.outcome == ChangedObjects::REFUSED) responder_->AddUnregistered();
    for (const vehicle::ChangeEvidence& evidence : ros_io::ToEvidence(message))
      responder_->AddChange(evidence);
  }

  void OnTick(const ros::SteadyTimerEvent&) {
    stamps_->CheckClock();
    mountings_->Retry();
    Work();
  }

  void Work() {
    worker_->Deliver(SteadyS());
    reporter_->Process(ros::Time::now().toSec(), SteadyS());
    if (!reporter_->store_error().empty()) {
      NODELET_ERROR_THROTTLE(kSayAgainS, "%s", reporter_->store_error().c_str());
    }
    const std::uint64_t by_fixes = reporter_->counters().placed_by_fixes;
    if (IsFused() && by_fixes > placed_by_fixes_) {
      NODELET_WARN_THROTTLE(kSayAgainS, "no fused pose of an image: hazards placed by the fixes");
    }
    placed_by_fixes_ = by_fixes;
    AnswerPolls();
    OrderPictures(*reporter_);
    for (const protocol::CellRequest& request : reporter_->TakeCellRequests(SteadyS())) {
      cell_request_publisher_.publish(ros_io::ToMessage(request));
    }
    // Without a listener a report would be spent, not sent.
    if (report_publisher_.getNumSubscribers() == 0) return;
    for (const protocol::Report& report : reporter_->TakeDue(SteadyS(), kSendPerTick)) {
      report_publisher_.publish(ros_io::ToMessage(report));
    }
  }

  void AnswerPolls() {
    vehicle::PollResponder::Vehicle vehicle;
    vehicle.intrinsics = reporter_->intrinsics();
    vehicle.mounting = [this](const std::string& frame_id) {
      return reporter_->Mounting(frame_id);
    };
    vehicle.pose_at = [this](std::int64_t stamp_ns, double waited_s) {
      return reporter_->vehicle_poses().At(stamp_ns, waited_s, responder_->PosePatience());
    };
    vehicle.image_at = [this](std::int64_t stamp_ns) { return ImageAt(stamp_ns); };
    responder_->Process(ros::Time::now().toSec(), SteadyS(), vehicle);
    for (const protocol::PollAnswer& reply : responder_->TakeReplies()) {
      answer_publisher_.publish(ros_io::ToMessage(reply));
    }
    OrderPictures(*responder_);
  }

  /// What the reporter or the responder wants, and the way of the answer back to it.
  template <typename Orderer>
  void OrderPictures(Orderer& orderer) {
    for (vehicle::PictureOrder& order : orderer.TakePictureOrders()) {
      const std::uint64_t number = order.number;
      worker_->Order(std::move(order), SteadyS(),
                     [&orderer, number](std::vector<imaging::CroppedPicture> pictures) {
                       orderer.AddPictures(number, std::move(pictures));
                     });
    }
  }

  void OnViewTimer(const ros::SteadyTimerEvent&) { view_->Publish(); }

  void Diagnose(Diagnostics::Status& status) {
    ros_io::DescribeHazardReporter(*reporter_, SteadyS(), status);
    ros_io::DescribePollResponder(*responder_, status);
    const vehicle::PictureWorker::Counters& pictures = worker_->counters();
    const perception::PictureMasker::Counters masks = maker_->counters();
    status.add("pictures_made", pictures.made);
    status.add("pictures_withheld", masks.withheld);
    status.add("pictures_refused", pictures.refused);
    status.add("pictures_late", pictures.late);
    status.add("regions_masked", masks.masked_regions);
    status.add("masks_found_by", maker_->masker().finder());
    status.add("images_kept", images_->size());
    stamps_->Diagnose(status);
  }

  ros_io::HazardReportingConfig config_;
  protocol::HazardCatalogue catalogue_;
  std::unique_ptr<vehicle::HazardReporter> reporter_;
  std::unique_ptr<vehicle::PollResponder> responder_;
  std::unique_ptr<VehicleView> view_;
  std::unique_ptr<StampChecks> stamps_;
  std::uint64_t placed_by_fixes_ = 0;  // When it was last looked at.
  std::unique_ptr<VehicleTf> vehicle_tf_;
  std::unique_ptr<MountingLearner> mountings_;
  std::unique_ptr<PictureMaker> maker_;
  std::unique_ptr<RecentImages<Kept>> images_;
  std::unique_ptr<vehicle::PictureWorker> worker_;
  ros::Publisher report_publisher_, answer_publisher_, cell_request_publisher_, cells_publisher_;
  image_transport::Subscriber image_subscriber_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::SteadyTimer> timers_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using HazardReportingNodelet = PartNodelet<HazardReportingPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::HazardReportingNodelet, nodelet::Nodelet)
