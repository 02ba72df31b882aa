#include <std_srvs/Trigger.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/positioning/localization_conversions.h"
#include "ros/parameters/positioning/geo_localization_parameters.h"
#include "ros/parameters/shared/datum_parameter.h"

namespace livemap::nodelets {
namespace {

constexpr double kTickS = 0.02;

}  // namespace

/// Where the vehicle is on the map: fixes and odometry in, fused position and pose and tf
/// map -> odom out. All callbacks run one at a time, in the nodelet's own queue; an optimisation
/// takes one of the manager's threads for some milliseconds.
class GeoLocalizationPart : public NodeletPart {
 private:
  /// Messages that came since the last look.
  struct Arrivals {
    int fixes = 0, odometry = 0;
  };
  struct Figures {
    std::uint64_t published = 0, foreign_frames = 0, begun_anew = 0;
    double total_ms = 0, longest_ms = 0;  // Of the localizer, since the last diagnostics.
    std::uint64_t used_before = 0;        // Fixes, at the last diagnostics.
  };

  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadGeoLocalizationConfig(parameters);
    localizer_ = std::make_unique<localization::GeoLocalizer>(config_.localizer);
    feed_ = std::make_unique<localization::LocalizerFeed>(
        config_.feed, *localizer_,
        [this](const localization::OdometrySample& sample) { Publish(sample); },
        [this](const geo::Fix&, localization::GeoLocalizer::FixVerdict verdict) {
          if (verdict != localization::GeoLocalizer::FixVerdict::kRefused) Explain(verdict);
        });
    ros::NodeHandle& node = getNodeHandle();
    fix_publisher_ = node.advertise<sensor_msgs::NavSatFix>("localization/fix", 10);
    odometry_publisher_ = node.advertise<nav_msgs::Odometry>("localization/odometry", 10);
    reset_service_ =
        getPrivateNodeHandle().advertiseService("reset", &GeoLocalizationPart::OnReset, this);
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "geo_localization", "geo localization",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    fix_subscriber_ = node.subscribe("fix", 1000, &GeoLocalizationPart::OnFix, this);
    odometry_subscriber_ = node.subscribe("odom", 1000, &GeoLocalizationPart::OnOdometry, this);
    // Steady: a bag that pauses must not keep back what has come.
    tick_timer_ =
        node.createSteadyTimer(ros::WallDuration(kTickS), &GeoLocalizationPart::OnTick, this);
    silence_timer_ = node.createSteadyTimer(ros::WallDuration(config_.silence_warning_s),
                                            &GeoLocalizationPart::OnSilenceTimer, this);
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    ++arrivals_.fixes;
    const Stopwatch stopwatch(figures_);
    feed_->AddFix(ros_io::ToFix(message), SteadyS(), RosNowNs());
    TellNews();
  }

  void OnOdometry(const nav_msgs::OdometryConstPtr& message) {
    ++arrivals_.odometry;
    if (message->header.frame_id != config_.odom_frame ||
        message->child_frame_id != config_.base_frame) {
      ++figures_.foreign_frames;
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped odometry of '%s' in '%s', wanted is '%s' in '%s'",
                            message->child_frame_id.c_str(), message->header.frame_id.c_str(),
                            config_.base_frame.c_str(), config_.odom_frame.c_str());
      return;
    }
    const localization::OdometrySample sample = ros_io::ToOdometrySample(
        *message,
        config_.odometry_covariance == "message" ? feed_->newest_odometry_ns() : std::nullopt);
    // Kept until the localizer has it: its twist goes on.
    waiting_.push_back(message);
    if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
    const Stopwatch stopwatch(figures_);
    if (feed_->AddOdometry(sample, SteadyS(), RosNowNs())) {
      ++figures_.begun_anew;
      NODELET_WARN("the odometry's stamps went back: localisation starts anew");
    }
    TellNews();
  }

  void OnTick(const ros::SteadyTimerEvent&) {
    const Stopwatch stopwatch(figures_);
    feed_->Advance(SteadyS());
    TellNews();
  }

  /// An odometry that the localizer has taken.
  void Publish(const localization::OdometrySample& sample) {
    const nav_msgs::OdometryConstPtr odometry = TakeWaiting(sample.stamp_ns);
    const auto map_from_odom = localizer_->MapFromOdom();
    const auto fused = localizer_->Fused(sample.stamp_ns);
    if (!odometry || !map_from_odom || !fused) return;
    fix_publisher_.publish(ros_io::ToFusedFix(*fused, config_.base_frame, sample.stamp_ns));
    odometry_publisher_.publish(
        ros_io::ToFusedOdometry(*fused, *map_from_odom, sample, *odometry, config_.map_frame));
    ++figures_.published;
    if (!config_.publish_tf) return;
    geometry_msgs::TransformStamped transform = tf2::eigenToTransform(*map_from_odom);
    transform.header.stamp = odometry->header.stamp;
    transform.header.frame_id = config_.map_frame;
    transform.child_frame_id = config_.odom_frame;
    tf_broadcaster_.sendTransform(transform);
  }

  /// The message of a sample; those before it are done with.
  nav_msgs::OdometryConstPtr TakeWaiting(std::int64_t stamp_ns) {
    const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const auto& message) {
      return ros_io::FromRosTime(message->header.stamp) == stamp_ns;
    });
    if (found == waiting_.end()) return nullptr;
    nav_msgs::OdometryConstPtr message = *found;
    waiting_.erase(waiting_.begin(), std::next(found));
    return message;
  }

  void Explain(localization::GeoLocalizer::FixVerdict verdict) {
    const char* reason = ros_io::RefusalReason(verdict);
    if (reason == nullptr) return;
    last_refusal_ = reason;
    // The warning of silence says that better; at a start it is as it should be.
    if (verdict == localization::GeoLocalizer::FixVerdict::kWithoutOdometry) return;
    NODELET_WARN_THROTTLE(kSayAgainS, "refused a fix: %s", reason);
  }

  /// Outliers, which show when the odometry has reached them, stamps that cannot be, and
  /// earth -> map once the datum is known, or known to be another.
  void TellNews() {
    const std::uint64_t refused = localizer_->counters().fixes_refused;
    if (refused > refused_before_) Explain(localization::GeoLocalizer::FixVerdict::kRefused);
    refused_before_ = refused;
    SayBadStamps();
    const std::optional<geo::GeoPoint> datum = localizer_->datum();
    if (!config_.publish_tf || !datum) return;
    if (told_datum_ && told_datum_->latitude_deg == datum->latitude_deg &&
        told_datum_->longitude_deg == datum->longitude_deg) {
      return;
    }
    if (told_datum_) NODELET_WARN("all fixes are far from the datum: the map begins anew at them");
    told_datum_ = datum;
    static_broadcaster_.sendTransform(
        ros_io::EarthFromMap(*localizer_->datum(), config_.map_frame, ros::Time::now()));
  }

  std::uint64_t BadStamps() const {
    return feed_->fix_stamps().refused() + feed_->odometry_stamps().refused();
  }

  void SayBadStamps() {
    const std::uint64_t bad = BadStamps();
    if (bad > bad_stamps_before_) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "dropped a fix or odometry whose stamp is more than %.1f s ahead of "
                            "the clock (max_stamp_ahead_s), or fits neither the clock nor those "
                            "before it",
                            config_.feed.stamps.max_ahead_s);
    }
    bad_stamps_before_ = bad;
  }

  bool OnReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    localizer_->Forget();
    ++figures_.begun_anew;
    response.success = true;
    response.message = "everything but the datum is forgotten";
    return true;
  }

  void OnSilenceTimer(const ros::SteadyTimerEvent&) {
    const Arrivals came = arrivals_;
    arrivals_ = {};
    missing_.clear();
    if (came.fixes == 0) missing_ = "no fixes on " + fix_subscriber_.getTopic();
    if (came.odometry == 0) {
      missing_ += (missing_.empty() ? "" : ", ") + std::string("no odometry on ") +
                  odometry_subscriber_.getTopic();
      // Visual odometry may be wanted and have failed to load.
      if (odometry_subscriber_.getNumPublishers() == 0) {
        missing_ += ", which nobody publishes (edge_vo does, with vo:=true)";
      }
    }
    if (missing_.empty()) return;
    NODELET_WARN_THROTTLE(kSayAgainS, "for %.1f s %s", config_.silence_warning_s, missing_.c_str());
  }

  void Diagnose(Diagnostics::Status& status) {
    using Level = diagnostic_msgs::DiagnosticStatus;
    const localization::LocalizerState state = localizer_->state();
    const std::string name = ros_io::LocalizerStateName(state);
    status.summary(
        state == localization::LocalizerState::kOk && missing_.empty() ? Level::OK : Level::WARN,
        missing_.empty() ? name : name + ": " + missing_);
    status.add("state", name);
    ros_io::DescribeLocalizer(*localizer_, status);
    const std::uint64_t used = localizer_->counters().fixes_used;
    const std::uint64_t fresh = used > figures_.used_before ? used - figures_.used_before : 0;
    status.add("last_refusal", last_refusal_);
    status.add("milliseconds_per_fix",
               fresh > 0 ? figures_.total_ms / static_cast<double>(fresh) : 0.0);
    status.add("milliseconds_longest", figures_.longest_ms);
    status.add("poses_published", figures_.published);
    status.add("odometry_of_other_frames", figures_.foreign_frames);
    status.add("begun_anew", figures_.begun_anew);
    status.add("stamps_refused", BadStamps());
    figures_.total_ms = figures_.longest_ms = 0;
    figures_.used_before = used;
  }

  /// Adds the time that it lives to the figures.
  class Stopwatch {
   public:
    explicit Stopwatch(Figures& figures) : figures_(figures) {}
    ~Stopwatch() {
      const double ms = 1e3 * (SteadyS() - begin_s_);
      figures_.total_ms += ms;
      figures_.longest_ms = std::max(figures_.longest_ms, ms);
    }
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;

   private:
    Figures& figures_;
    const double begin_s_ = SteadyS();
  };

  static constexpr std::size_t kMaxWaiting = 2000;

  ros_io::GeoLocalizationConfig config_;
  std::unique_ptr<localization::GeoLocalizer> localizer_;
  std::unique_ptr<localization::LocalizerFeed> feed_;
  std::deque<nav_msgs::OdometryConstPtr> waiting_;  // Not yet taken by the localizer.
  Arrivals arrivals_;
  Figures figures_;
  std::string missing_;
  std::string last_refusal_;
  std::uint64_t refused_before_ = 0;
  std::uint64_t bad_stamps_before_ = 0;
  std::optional<geo::GeoPoint> told_datum_;

  tf2_ros::TransformBroadcaster tf_broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  ros::Publisher fix_publisher_, odometry_publisher_;
  ros::Subscriber fix_subscriber_, odometry_subscriber_;
  ros::ServiceServer reset_service_;
  ros::SteadyTimer tick_timer_, silence_timer_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using GeoLocalizationNodelet = PartNodelet<GeoLocalizationPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::GeoLocalizationNodelet, nodelet::Nodelet)
