#include "tools/bags/drive_bag.h"

#include <sensor_msgs/CompressedImage.h>

#include <boost/date_time/posix_time/posix_time.hpp>
#include <cmath>
#include <sstream>

#include "common/error.h"
#include "datasets/text_parsing.h"
#include "geo/wgs84.h"
#include "tools/bags/bag_messages.h"
#include "tools/bags/bag_writer.h"

namespace livemap::tools {
namespace {

geo::GeoPoint ParseDrivePosition(const std::string& text) {
  const std::vector<std::string> parts = datasets::Split(text, ',');
  const std::optional<double> latitude =
      parts.size() == 2 ? datasets::ParseFinite(parts[0]) : std::nullopt;
  const std::optional<double> longitude =
      parts.size() == 2 ? datasets::ParseFinite(parts[1]) : std::nullopt;
  if (!latitude || !longitude || !geo::IsValid({*latitude, *longitude})) {
    throw Error("--start is '" + text + "', accepted is LAT,LON in degrees, e.g. -23.55,-46.63");
  }
  return {*latitude, *longitude};
}

datasets::Route ReadDriveRoute(const CommandLine& line) {
  if (line.Has("route")) {
    if (line.Has("start") || line.Has("bearing")) {
      throw Error("give either --route or --start and --bearing, not both");
    }
    return datasets::ReadRoute(line.Text("route", ""));
  }
  // A quiet straight road in Pittsburgh, for a drive that may lie anywhere.
  const geo::GeoPoint start = ParseDrivePosition(line.Text("start", "40.4433,-79.9436"));
  return datasets::Route::Straight(start,
                                   line.Number("bearing", 90, -360, 360) * geo::kRadiansPerDegree);
}

}  // namespace

std::vector<Flag> DriveFlags() {
  return {
      {"speed-mps", "SPEED", "constant speed in m/s"},
      {"start", "LAT,LON", "position at the first frame, WGS84 degrees (40.4433,-79.9436)"},
      {"bearing", "DEG", "direction of driving, clockwise from north (90)"},
      {"route", "FILE.geojson", "a LineString to drive along, instead of --start and --bearing"},
      {"camera", "FILE.yaml", "calibration and mounting, as config/cameras/*.yaml"},
      {"camera-height-m", "M", "camera above the road, instead of the file's"},
      {"camera-pitch-deg", "DEG", "how far the camera looks down, instead of the file's"},
      {"fix-rate-hz", "HZ", "receiver fixes per second (10)"},
      {"fix-noise-m", "M", "receiver's white noise, sigma per axis (0.5)"},
      {"fix-bias-m", "M", "receiver's slow error, sigma per axis (0)"},
      {"fix-bias-time-s", "S", "correlation time of the slow error (60)"},
      {"fix-dropouts-per-min", "N", "losses of the fix per minute (0)"},
      {"fix-dropout-s", "S", "mean length of a loss (3)"},
      {"start-time", "ISO8601", "stamp of the first frame, UTC (2026-01-01T12:00:00Z)"},
      {"seed", "N", "of everything random (1)"},
  };
}

ros::Time ReadStartTime(const CommandLine& line) {
  std::string text = line.Text("start-time", "2026-01-01T12:00:00Z");
  const std::string given = text;
  if (!text.empty() && text.back() == 'Z') text.pop_back();
  try {
    const boost::posix_time::ptime time = boost::posix_time::from_iso_extended_string(text);
    const ros::Time stamp = ros::Time::fromBoost(time);
    if (time.is_not_a_date_time() || stamp.toSec() < 10) throw Error("too early");
    return stamp;
  } catch (const std::exception&) {
    throw Error("--start-time is '" + given + "', accepted is UTC like 2026-01-01T12:00:00Z");
  }
}

DriveSetup ReadDriveSetup(const CommandLine& line, const std::string& camera_path,
                          double default_speed_mps) {
  DriveSetup setup{ReadDriveRoute(line), 0, {}, {}, 0, 0, {}};
  setup.speed_mps = line.Number("speed-mps", default_speed_mps, 0.1, 100);
  setup.camera = datasets::ReadCameraFile(line.Text("camera", camera_path));
  datasets::CameraMounting& mounting = setup.camera.mounting;
  mounting.height_m = line.Number("camera-height-m", mounting.height_m, 0.1, 10);
  mounting.pitch_deg = line.Number("camera-pitch-deg", mounting.pitch_deg, -30, 89);
  setup.noise.white_sigma_m = line.Number("fix-noise-m", 0.5, 0, 1000);
  setup.noise.bias_sigma_m = line.Number("fix-bias-m", 0, 0, 1000);
  setup.noise.bias_time_constant_s = line.Number("fix-bias-time-s", 60, 0.01, 1e6);
  setup.noise.dropouts_per_minute = line.Number("fix-dropouts-per-min", 0, 0, 600);
  setup.noise.dropout_mean_s = line.Number("fix-dropout-s", 3, 0.01, 3600);
  setup.fix_rate_hz = line.Number("fix-rate-hz", 10, 0.1, 200);
  setup.seed = line.Seed("seed", 1);
  setup.start = ReadStartTime(line);
  return setup;
}

void CheckRouteLength(const datasets::Route& route, double needed_m) {
  if (route.length_m() >= needed_m) return;
  std::ostringstream sentence;
  sentence.precision(1);
  sentence << std::fixed << "the route is " << route.length_m() << " m long, the drive needs "
           << needed_m << " m";
  throw Error(sentence.str());
}

DriveBag::DriveBag(const std::string& path, const DriveSetup& setup)
    : setup_(setup),
      bag_(path, setup.compression),
      receiver_(setup.noise, setup.seed),
      camera_info_(PinholeCameraInfo(setup.camera.intrinsics)) {
  next_fix_ = -static_cast<std::int64_t>(std::floor(kLeadS * setup.fix_rate_hz));
  WriteStaticTransforms();
}

void DriveBag::WriteStaticTransforms() {
  const ros::Time stamp = Stamp(-kLeadS);
  bag_.WriteLatched("/tf_static", stamp, MountingTransforms(setup_.camera.mounting, stamp));
}

void DriveBag::AdvanceTo(double time_s) {
  for (;; ++next_fix_) {
    const double fix_s = static_cast<double>(next_fix_) / setup_.fix_rate_hz;
    if (fix_s > time_s) return;
    const geo::GeoPoint truth =
        setup_.place ? setup_.place(fix_s) : setup_.route.At(fix_s * setup_.speed_mps).position;
    const ros::Time stamp = Stamp(fix_s);
    bag_.Write("/ground_truth/fix", stamp, DriveFix(truth, 0, stamp));
    std::optional<Eigen::Vector2d> error_m = receiver_.ErrorAt(fix_s);
    const Eigen::Vector2d multipath_m =
        setup_.multipath_m ? setup_.multipath_m(fix_s) : Eigen::Vector2d::Zero();
    if (!error_m) {
      bag_.Write("/fix", stamp, DriveWithoutFix(stamp));
      continue;
    }
    *error_m += multipath_m;
    const geo::GeoPoint seen =
        geo::GeodesicDestination(truth, std::atan2(error_m->x(), error_m->y()), error_m->norm());
    bag_.Write("/fix", stamp, DriveFix(seen, receiver_.sigma_m(), stamp));
  }
}

std_msgs::Header DriveBag::AddFrame(double time_s, const std::vector<std::uint8_t>& image,
                                    const std::vector<livemap::Detection>& boxes) {
  AdvanceTo(time_s);
  std_msgs::Header header;
  header.seq = frame_number_++;
  header.stamp = Stamp(time_s);
  header.frame_id = kOpticalFrame;

  camera_info_.header = header;
  bag_.Write("/camera/camera_info", header.stamp, camera_info_);
  sensor_msgs::CompressedImage compressed;
  compressed.header = header;
  compressed.format = "bgr8; jpeg compressed bgr8";
  compressed.data = image;
  bag_.Write("/camera/image_raw/compressed", header.stamp, compressed);
  livemap::DetectionArray truth;
  truth.header = header;
  truth.model = "ground_truth";
  truth.image_width = camera_info_.width;
  truth.image_height = camera_info_.height;
  truth.detections = boxes;
  bag_.Write("/ground_truth/boxes", header.stamp, truth);
  return header;
}

void DriveBag::Finish(double end_s) {
  AdvanceTo(end_s + kLeadS);
  bag_.Finish();
}

}  // namespace livemap::tools
