#include <cv_bridge/cv_bridge.h>
#include <livemap/CandidateFrame.h>
#include <livemap/DetectionArray.h>
#include <livemap/HazardReport.h>
#include <ros/package.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <map>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

#include "imaging/decode.h"
#include "imaging/report_picture.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "placement/sighting.h"
#include "protocol/hazard_catalogue.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/offload_conversions.h"
#include "ros/parameters/candidate_intake_parameters.h"
#include "zone/offload/offload_intake.h"

namespace livemap::nodelets {
namespace {

constexpr double kWorkPeriodS = 0.05;

}  // namespace

/// The zone's door for small vehicles: OffloadIntake with topics and clocks. Frames come from the
/// bridge, which has written who sent them; their pictures go to an unchanged hazard_detection
/// nodelet under stamps of the zone's own; its answers become reports on the topic of all reports.
/// All callbacks run one at a time, in the nodelet's own queue.
class CandidateIntakePart : public NodeletPart {
 private:
  void Initialize() override {
    using Self = CandidateIntakePart;
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadCandidateIntakeConfig(parameters);
    if (config_.catalogue.empty()) {
      config_.catalogue = ros::package::getPath("livemap") + "/config/hazards.yaml";
    }
    intake_ = std::make_unique<zone::OffloadIntake>(
        config_.intake, protocol::HazardCatalogue::Load(config_.catalogue));
    ros::NodeHandle& node = getNodeHandle();
    image_publisher_ = node.advertise<sensor_msgs::Image>("candidate/image", 100);
    report_publisher_ = node.advertise<HazardReport>("hazard/report", 1000);
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "candidate_intake", "candidate_intake",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    subscribers_ = {
        node.subscribe("candidate/frame", 1000, &Self::OnFrame, this),
        node.subscribe("candidate/detections", 1000, &Self::OnDetections, this),
    };
    work_timer_ = node.createSteadyTimer(ros::WallDuration(kWorkPeriodS), &Self::OnWorkTimer, this);
  }

  static std::int64_t NowNs() { return static_cast<std::int64_t>(ros::WallTime::now().toNSec()); }

  void OnFrame(const CandidateFrame& message) {
    std::string why;
    try {
      why = intake_->Add(ros_io::FromMessage(message), NowNs());
    } catch (const Error& error) {
      ++unreadable_;
      why = error.what();
    }
    if (!why.empty()) {
      NODELET_WARN_THROTTLE(kSayAgainS, "candidate frame of '%s' not taken: %s",
                            message.vehicle_id.c_str(), why.c_str());
    }
    Work();
  }

  void OnWorkTimer(const ros::SteadyTimerEvent&) {
    for (const std::int64_t lost : intake_->Expire(SteadyS())) pictures_.erase(lost);
    Work();
  }

  void Work() {
    // Without a detector a frame would be spent.
    if (image_publisher_.getNumSubscribers() == 0) return;
    while (const zone::OffloadIntake::Job* job = intake_->Next(NowNs(), SteadyS()))
      DeliverResult(*job);
  }

  void DeliverResult(const zone::OffloadIntake::Job& job) {
    const std::int64_t internal_ns = job.internal_ns;
    cv::Mat decoded;
    try {
      decoded = imaging::DecodeImage(job.frame.image.data(), job.frame.image.size(),
                                     config_.intake.limits.report.max_image_pixels,
                                     // Its size and intrinsics are those of the stored pixels.
                                     {imaging::DecodeConfig::Pixels::kGreyOrColour, false});
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "candidate frame of '%s' dropped: %s",
                            job.frame.vehicle_id.c_str(), error.what());
    }
    if (decoded.size() != cv::Size(job.frame.intrinsics.width, job.frame.intrinsics.height)) {
      intake_->Abandon(internal_ns);
      return;
    }
    const bool grey = decoded.channels() == 1;
    std_msgs::Header header;
    header.stamp = ros_io::ToRosTime(internal_ns);
    header.frame_id = "candidate";
    const auto image =
        cv_bridge::CvImage(
            header, grey ? sensor_msgs::image_encodings::MONO8 : sensor_msgs::image_encodings::BGR8,
            decoded)
            .toImageMsg();
    pictures_[internal_ns] = image;
    image_publisher_.publish(image);
  }

  void OnDetections(const DetectionArray& message) {
    const placement::SightingFrame answer = ros_io::ToSightingFrame(message);
    std::vector<protocol::Report> reports = intake_->Finish(answer.stamp_ns, answer);
    const auto picture = pictures_.find(answer.stamp_ns);
    if (!reports.empty() && picture != pictures_.end()) {
      AddPicture(*picture->second, answer, reports);
    }
    if (picture != pictures_.end()) pictures_.erase(picture);
    for (const protocol::Report& report : reports) {
      report_publisher_.publish(boost::make_shared<HazardReport>(ros_io::ToMessage(report)));
    }
    Work();
  }

  /// The picture that a big vehicle would have sent, with the same marks.
  void AddPicture(const sensor_msgs::Image& image, const placement::SightingFrame& found,
                  std::vector<protocol::Report>& reports) {
    const cv::Mat bgr = cv_bridge::toCvCopy(image, sensor_msgs::image_encodings::BGR8)->image;
    const imaging::Picture picture{bgr, nullptr};
    imaging::PictureMarks marks;
    for (const placement::Sighting& each : found.sightings) marks.others.push_back(each.box);
    imaging::CropConfig crop;
    crop.max_bytes = static_cast<std::size_t>(config_.max_image_bytes);
    crop.quality = config_.jpeg_quality;
    for (protocol::Report& report : reports) {
      marks.subject = report.box;
      marks.label = imaging::MarkLabel(report.class_name, report.confidence);
      imaging::CroppedPicture cropped = imaging::CropPicture(picture, report.box, crop, &marks);
      if (cropped.jpeg.empty()) continue;
      report.image_format = "jpeg";
      report.image = std::move(cropped.jpeg);
      report.shown = cropped.shown;
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const zone::OffloadIntake::Counters& counters = intake_->counters();
    const bool more_lost = lost_.HasRisen(counters.displaced + counters.lost_by_detector);
    if (image_publisher_.getNumSubscribers() == 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no detector listens");
    } else if (more_lost) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "behind: dropping frames");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    status.add("frames_in", counters.frames + unreadable_);
    status.add("frames_bytes", counters.bytes);
    status.add("frames_refused", counters.refused + unreadable_);
    status.add("frames_over_allowance", counters.over_allowance);
    status.add("frames_repeated", counters.repeated);
    status.add("frames_displaced", counters.displaced);
    status.add("frames_undecodable", counters.undecodable);
    status.add("frames_lost_by_detector", counters.lost_by_detector);
    status.add("frames_detected", counters.detected);
    status.add("frames_empty", counters.empty);
    status.add("frames_waiting", intake_->waiting());
    status.add("frames_in_flight", intake_->in_flight());
    status.add("sightings", counters.sightings);
    status.add("sightings_invalid", counters.invalid_sightings);
    status.add("sightings_below_confidence", counters.below_confidence);
    status.add("sightings_cut_by_side", counters.cut_by_side);
    status.add("sightings_not_on_ground", counters.not_on_ground);
    status.add("sightings_too_far", counters.too_far);
    status.add("reports", counters.reports);
  }

  ros_io::CandidateIntakeConfig config_;
  std::unique_ptr<zone::OffloadIntake> intake_;
  std::map<std::int64_t, sensor_msgs::ImageConstPtr> pictures_;  // At the detector, by stamp.
  std::uint64_t unreadable_ = 0;  // Frames whose message the conversion refused.
  CounterWatch lost_;             // Of the diagnostics.
  ros::Publisher image_publisher_, report_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  ros::SteadyTimer work_timer_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using CandidateIntakeNodelet = PartNodelet<CandidateIntakePart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::CandidateIntakeNodelet, nodelet::Nodelet)
