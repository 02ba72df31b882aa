#pragma once

#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "placement/road_ground_contact.h"
#include "test/support/temporary_directory.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::vehicle {

// A vehicle that drives straight on, its camera and what that sees: for tests.

constexpr geo::GeoPoint kStart{40.4433, -79.9436};
constexpr std::int64_t kEpochNs = 1'600'000'000'000'000'000;
constexpr double kSpeedMps = 16.0;
constexpr double kBearingRad = 0.9;
constexpr char kOptical[] = "camera_optical_frame";
inline const Eigen::Vector3d kCameraInBase(1.5, 0.1, 1.6);

inline std::int64_t StampNs(double seconds) { return kEpochNs + std::llround(seconds * 1e9); }

inline geo::GeoPoint VehicleAt(double seconds) {
  return geo::GeodesicDestination(kStart, kBearingRad, kSpeedMps * seconds);
}

inline geo::Fix FixAt(double seconds) {
  return {StampNs(seconds), true, VehicleAt(seconds), Eigen::Matrix2d::Identity() * 0.01};
}

inline geo::CameraIntrinsics Intrinsics() { return {500, 500, 319.5, 199.5, 640, 400}; }

/// A camera that looks straight ahead, 1.6 m above the road.
inline Eigen::Isometry3d Mounting() {
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  base_from_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  base_from_optical.translation() = kCameraInBase;
  return base_from_optical;
}

/// The box of an object that stands on the road at this place in base_link.
inline imaging::Box BoxAt(double forward_m, double left_m) {
  const Eigen::Vector3d in_camera = Mounting().inverse() * Eigen::Vector3d(forward_m, left_m, 0.0);
  const geo::CameraIntrinsics camera = Intrinsics();
  const double u = camera.fx * in_camera.x() / in_camera.z() + camera.cx + 0.5;
  const double v = camera.fy * in_camera.y() / in_camera.z() + camera.cy + 0.5;
  return {static_cast<float>(u - 10), static_cast<float>(v - 12), static_cast<float>(u + 10),
          static_cast<float>(v)};
}

inline placement::SightingFrame FrameAt(double seconds,
                                        std::vector<placement::Sighting> sightings) {
  return {StampNs(seconds), kOptical, 640, 400, std::move(sightings)};
}

inline CameraImage GreyImage() {
  return {{cv::Mat(400, 640, CV_8UC3, cv::Scalar(90, 90, 90)), nullptr}, {}};
}

/// A thing that lies so far ahead and left of where the vehicle is at 3 s.
inline PassSights::Seen SeenAt(double time_s, double forward_m, double left_m,
                               const char* class_name = "traffic_cone") {
  PassSights::Seen seen{class_name, {}};
  placement::HazardSight& sight = seen.sight;
  sight.stamp_ns = StampNs(time_s);
  sight.base.position = VehicleAt(time_s);
  sight.base.covariance_m2 = Eigen::Matrix2d::Identity();
  sight.base.course_rad = kBearingRad;
  sight.base.course_variance_rad2 = 1e-4;
  sight.base.speed_mps = kSpeedMps;
  sight.intrinsics = Intrinsics();
  sight.base_from_optical = Mounting();
  sight.noise.max_range_m = 1e4;
  sight.pixel = placement::ContactPixel(BoxAt(forward_m - kSpeedMps * (time_s - 3), left_m));
  sight.foot =
      *geo::ProjectToGround(sight.pixel, sight.intrinsics, sight.base_from_optical, sight.noise);
  return seen;
}

/// A reporter on a vehicle that drives straight on.
class HazardReporterTest : public ::testing::Test {
 protected:
  HazardReporterTest() {
    config_.drive_id = "drive-1";
    config_.map.path = directory_.path() + "/local.sqlite3";
    config_.max_ground_sigma_m = 100;  // Only where a test is about it.
    config_.settle_wait_s = 0;         // Likewise.
    Restart();
  }

  /// After `utc_s` on the vehicle's clock since the first start.
  void Restart(double utc_s = 0) {
    reporter_.reset();
    reporter_ = std::make_unique<HazardReporter>(config_, catalogue_, std::mt19937_64(seed_++),
                                                 StampNs(utc_s), steady_s_);
    reporter_->SetIntrinsics(Intrinsics());
    reporter_->SetMounting(kOptical, Mounting());
  }

  /// Fixes at 5 Hz from `from_s` up to `to_s`.
  void DriveFixes(double from_s, double to_s) {
    for (double time_s = from_s; time_s <= to_s + 1e-9; time_s += 0.2) {
      reporter_->AddFix(FixAt(time_s));
    }
  }

  /// A frame with its image, seen and worked off at once.
  void See(double seconds, std::vector<placement::Sighting> sightings) {
    reporter_->AddFrame(FrameAt(seconds, std::move(sightings)), seconds);
    reporter_->AddImage(StampNs(seconds), GreyImage());
    ProcessWithPictures(seconds);
  }

  /// What can be worked off at `now_s`, as the nodelet does it.
  void ProcessWithPictures(double now_s) {
    reporter_->Process(now_s, steady_s_);
    MakePictures();
    reporter_->Process(now_s, steady_s_);
  }

  /// Answers the reporter's orders; the image has nobody to mask.
  void MakePictures() {
    for (const PictureOrder& order : reporter_->TakePictureOrders()) {
      reporter_->AddPictures(order.number, CutPictures(order, order.image.picture.bgr, false));
    }
  }

  std::vector<protocol::Report> TakeDue() { return reporter_->TakeDue(steady_s_, 100); }
  const HazardReporter::Counters& counters() const { return reporter_->counters(); }

  test::TemporaryDirectory directory_;
  HazardReporter::Config config_;
  protocol::HazardCatalogue catalogue_;
  std::uint64_t seed_ = 1;
  double steady_s_ = 500;
  std::unique_ptr<HazardReporter> reporter_;
};

}  // namespace livemap::vehicle
