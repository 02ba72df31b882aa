#include "change/objects/change_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "change/registration/depth_image.h"
#include "change/registration/edge_registration.h"
#include "common/error.h"

namespace livemap::change {
namespace {

/// Of a map frame's datum: beyond it north is no longer the map's north to a milliradian.
constexpr double kMapRadiusM = 5000;

constexpr int kMixedPixels = 2;

/// Counterclockwise from east.
double DetectorYawOf(double heading_rad) { return M_PI / 2 - heading_rad; }

double DetectorHeading(double heading_rad) {
  const double wrapped = std::fmod(heading_rad, 2 * M_PI);
  const double positive = wrapped < 0 ? wrapped + 2 * M_PI : wrapped;
  return positive < 2 * M_PI ? positive : 0;
}

void CheckDetectorPicture(const ChangeDetectorFrame& picture) {
  const geo::CameraIntrinsics& camera = picture.camera;
  if (picture.bgr.empty() || picture.bgr.type() != CV_8UC3 ||
      picture.bgr.size() != cv::Size(camera.width, camera.height)) {
    throw Error("a picture to compare is " + std::to_string(picture.bgr.cols) + "x" +
                std::to_string(picture.bgr.rows) + ", accepted is an 8-bit colour picture of its " +
                "camera's " + std::to_string(camera.width) + "x" + std::to_string(camera.height));
  }
  if (!picture.depth.empty()) CheckDepthImage(picture.depth, picture.bgr.size());
  if (!geo::IsValid(picture.position) || !picture.covariance_m2.allFinite() ||
      !std::isfinite(picture.heading_rad)) {
    throw Error(
        "a picture to compare has a pose that is not finite, accepted is WGS84 degrees and "
        "radians");
  }
}

}  // namespace

ChangeDetector::ChangeDetector(const Config& config, std::unique_ptr<ChangeMethod> method,
                               std::int64_t now_ns)
    : config_(config),
      method_(std::move(method)),
      memory_(config.memory, now_ns),
      tracker_(config.tracker) {
  if (config.drive_id.empty() || config.drive_id.size() > 64) {
    throw Error("a drive's id has " + std::to_string(config.drive_id.size()) +
                " bytes, accepted are 1 to 64");
  }
}

PlaceFrame ChangeDetector::FrameOf(const ChangeDetectorFrame& picture) const {
  PlaceFrame frame;
  frame.drive_id = config_.drive_id;
  frame.stamp_ns = picture.stamp_ns;
  const Eigen::Rotation2Dd turn(DetectorYawOf(picture.heading_rad));
  const Eigen::Vector2d camera_m = turn * picture.base_from_optical.translation().head<2>();
  frame.position = geo::LocalFrame(picture.position).ToGeo(camera_m);
  frame.position_sigma_m = std::sqrt(std::max(0.0, picture.covariance_m2.trace() / 2));
  const Eigen::Vector3d view = picture.base_from_optical.linear().col(2);
  frame.heading_rad = DetectorHeading(picture.heading_rad - std::atan2(view.y(), view.x()));
  frame.camera = picture.camera;
  return frame;
}

ChangeDetector::Answer ChangeDetector::Look(const ChangeDetectorFrame& picture) {
  CheckDetectorPicture(picture);
  Answer answer;
  if (picture.stamp_ns < last_stamp_ns_) Restart();
  last_stamp_ns_ = picture.stamp_ns;
  const PlaceFrame frame = FrameOf(picture);
  if (frame.position_sigma_m > config_.max_position_sigma_m) {
    answer.outcome = Outcome::kUncertain;
    return answer;
  }
  const Eigen::Isometry3d map_from_base = MapFromBase(picture);
  covariance_m2_ = picture.covariance_m2;
  const FeaturedView view{picture.bgr.size(), ExtractFeatures(picture.bgr, config_.features)};
  const std::optional<Partner> partner = FindPartner(frame, picture, view, answer);
  if (partner) Compare(picture, *partner, map_from_base, answer);
  Place(tracker_.LeaveBehind(map_from_base), passed_);
  answer.passed.swap(passed_);
  Remember(picture, frame, view.features, answer);
  return answer;
}

std::optional<ChangeDetector::Partner> ChangeDetector::FindPartner(
    const PlaceFrame& frame, const ChangeDetectorFrame& picture, const FeaturedView& view,
    Answer& answer) {
  const auto near = memory_.Nearest({frame.position, frame.heading_rad, config_.drive_id});
  answer.outcome = near.empty() ? Outcome::kNothingEarlier : Outcome::kRefused;
  const auto ranked = memory_.Rank(view.features, near);
  for (std::size_t i = 0; i < std::min(config_.partners, ranked.size()); ++i) {
    const auto record = memory_.Load(ranked[i].candidate.id);
    if (!record) continue;
    std::string why;
    if (auto partner = Register(*record, picture, view, why)) return partner;
    if (answer.why.empty()) answer.why = why;
  }
  return std::nullopt;
}

std::optional<ChangeDetector::Partner> ChangeDetector::Register(const PlaceRecord& record,
                                                                const ChangeDetectorFrame& picture,
                                                                const FeaturedView& view,
                                                                std::string& why) const {
  const RegistrationConfig& options = config_.registration;
  const FeaturedView before{cv::Size(record.frame.camera.width, record.frame.camera.height),
                            record.features};
  const cv::Mat earlier = cv::imdecode(record.picture, cv::IMREAD_COLOR);
  if (earlier.size() != before.size) {
    why = "the earlier picture is damaged";  // Its header was right, the rest is not.
    return std::nullopt;
  }
  if (!picture.depth.empty()) {
    Registration by_depth = RegisterByDepth(before, record.frame.camera, view, picture.camera,
                                            picture.depth, options, config_.seed);
    if (by_depth.accepted()) {
      const WarpedPicture warped = WarpByDepth(earlier, record.frame.camera, picture.depth,
                                               picture.camera, by_depth.before_from_after);
      CheckOverlap(warped, options, by_depth);
      if (by_depth.accepted()) return Partner{record.frame, warped, RegisteredBy::kDepth};
    }
    why = by_depth.why + "; ";
  }
  const Registration by_edges = RegisterByEdges(earlier, picture.bgr, options);
  if (by_edges.accepted()) {
    return Partner{record.frame, WarpByHomography(earlier, by_edges.after_from_before),
                   RegisteredBy::kEdges};
  }
  const Registration by_features = RegisterByHomography(before, view, options, config_.seed);
  if (by_features.accepted()) {
    return Partner{record.frame, WarpByHomography(earlier, by_features.after_from_before),
                   RegisteredBy::kFeatures};
  }
  why += by_edges.why + "; " + by_features.why;
  return std::nullopt;
}

void ChangeDetector::Compare(const ChangeDetectorFrame& picture, const Partner& partner,
                             const Eigen::Isometry3d& map_from_base, Answer& answer) {
  answer.outcome = Outcome::kCompared;
  answer.earlier = partner.frame;
  answer.registered_by = partner.registered_by;
  // The outermost pixels of the warped picture are mixed with what lies beyond it.
  cv::Mat valid;
  cv::erode(partner.warped.valid, valid, cv::Mat(), cv::Point(-1, -1), kMixedPixels,
            cv::BORDER_CONSTANT, cv::Scalar(255));
  answer.pair = {FillUnknown(partner.warped.picture, picture.bgr, valid), picture.bgr, valid};
  const ChangeProbabilities probabilities = method_->Run(answer.pair);
  answer.classes = ChangedClasses(probabilities, config_.regions.min_confidence);
  answer.classes.setTo(kLeftOutPixel, answer.pair.valid == 0);
  answer.regions =
      FindChangeRegions(probabilities, answer.pair.before, answer.pair.after, config_.regions);

  ChangeFrame frame;
  frame.stamp_ns = picture.stamp_ns;
  frame.earlier_ns = partner.frame.stamp_ns;
  frame.map_from_base = map_from_base;
  frame.base_from_optical = picture.base_from_optical;
  frame.camera = picture.camera;
  frame.valid = answer.pair.valid;
  answer.newly_confirmed = tracker_.Add(frame, answer.regions).size();
  Place(tracker_.Confirmed(), answer.objects);
}

void ChangeDetector::Place(const std::vector<ChangedObject>& events,
                           std::vector<PlacedChange>& placed) const {
  for (const ChangedObject& event : events) {
    placed.push_back({event, map_->ToGeo(event.position_m), event.covariance_m2 + covariance_m2_});
  }
}

void ChangeDetector::Restart() {
  const std::vector<ChangedObject> untold = tracker_.Restart();
  if (map_) Place(untold, passed_);
}

std::vector<PlacedChange> ChangeDetector::EndDrive() {
  Restart();
  return std::exchange(passed_, {});
}

void ChangeDetector::Remember(const ChangeDetectorFrame& picture, const PlaceFrame& frame,
                              const ImageFeatures& features, Answer& answer) {
  if (last_remembered_ &&
      geo::GeodesicDistanceM(*last_remembered_, frame.position) < config_.remember_spacing_m) {
    return;
  }
  PlaceRecord record{frame, {}, features};
  cv::imencode(".jpg", picture.bgr, record.picture,
               {cv::IMWRITE_JPEG_QUALITY, config_.jpeg_quality});
  try {
    memory_.Add(record);
    answer.remembered = true;
    last_remembered_ = frame.position;
  } catch (const StoreError& error) {
    answer.store_error = error.what();
  }
}

Eigen::Isometry3d ChangeDetector::MapFromBase(const ChangeDetectorFrame& picture) {
  if (!map_ || geo::GeodesicDistanceM(map_->datum(), picture.position) > kMapRadiusM) {
    Restart();
    map_.emplace(picture.position);
  }
  Eigen::Isometry3d map_from_base = Eigen::Isometry3d::Identity();
  map_from_base.translation().head<2>() = map_->ToEnu(picture.position);
  map_from_base.linear() =
      Eigen::AngleAxisd(DetectorYawOf(picture.heading_rad), Eigen::Vector3d::UnitZ())
          .toRotationMatrix();
  return map_from_base;
}

}  // namespace livemap::change
