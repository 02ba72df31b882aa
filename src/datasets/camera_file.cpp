#include "datasets/camera_file.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <locale>
#include <set>
#include <sstream>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"
#include "geo/wgs84.h"

namespace livemap::datasets {
namespace {

constexpr std::size_t kMaxCameraFileBytes = 1U << 16U;

double ReadNumber(const YAML::Node& map, const std::string& key, double min, double max,
                  const std::string& name) {
  const YAML::Node node = map[key];
  const std::string text = node && node.IsScalar() ? node.Scalar() : "missing";
  const std::optional<double> value = ParseFinite(text);
  if (!value || *value < min || *value > max) {
    throw Error("'" + key + "' of the camera file '" + name + "' is " + text +
                ", accepted is a number from " + std::to_string(min) + " to " +
                std::to_string(max));
  }
  return *value;
}

void RejectUnknown(const YAML::Node& map, const std::set<std::string>& known,
                   const std::string& name) {
  for (const auto& entry : map) {
    const std::string key = entry.first.as<std::string>("");
    if (known.count(key) == 0)
      throw Error("the camera file '" + name + "' has no key '" + key + "'");
  }
}

CameraFile Parse(const YAML::Node& root, const std::string& name) {
  if (!root.IsMap() || !root["mounting"] || !root["mounting"].IsMap()) {
    throw Error("the camera file '" + name + "' must be a map with 'mounting' as a map in it");
  }
  RejectUnknown(root, {"name", "width", "height", "fx", "fy", "cx", "cy", "mounting"}, name);
  const YAML::Node mounting = root["mounting"];
  RejectUnknown(mounting, {"forward_m", "left_m", "height_m", "roll_deg", "pitch_deg", "yaw_deg"},
                name);
  CameraFile camera;
  camera.name = root["name"].as<std::string>("camera");
  camera.intrinsics.width = static_cast<int>(ReadNumber(root, "width", 16, 16384, name));
  camera.intrinsics.height = static_cast<int>(ReadNumber(root, "height", 16, 16384, name));
  camera.intrinsics.fx = ReadNumber(root, "fx", 1, 1e6, name);
  camera.intrinsics.fy = ReadNumber(root, "fy", 1, 1e6, name);
  camera.intrinsics.cx = ReadNumber(root, "cx", -1e5, 1e5, name);
  camera.intrinsics.cy = ReadNumber(root, "cy", -1e5, 1e5, name);
  camera.mounting.forward_m = ReadNumber(mounting, "forward_m", -20, 20, name);
  camera.mounting.left_m = ReadNumber(mounting, "left_m", -5, 5, name);
  camera.mounting.height_m = ReadNumber(mounting, "height_m", 0.1, 10, name);
  camera.mounting.roll_deg = ReadNumber(mounting, "roll_deg", -45, 45, name);
  camera.mounting.pitch_deg = ReadNumber(mounting, "pitch_deg", -30, 89, name);
  camera.mounting.yaw_deg = ReadNumber(mounting, "yaw_deg", -180, 180, name);
  return camera;
}

}  // namespace

Eigen::Isometry3d CameraFromOptical() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << 0, 0, 1,  //
      -1, 0, 0,              //
      0, -1, 0;
  return pose;
}

Eigen::Isometry3d CameraMounting::BaseFromCamera() const {
  const Eigen::AngleAxisd yaw(yaw_deg * geo::kRadiansPerDegree, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd pitch(pitch_deg * geo::kRadiansPerDegree, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd roll(roll_deg * geo::kRadiansPerDegree, Eigen::Vector3d::UnitX());
  return Eigen::Translation3d(forward_m, left_m, height_m) * yaw * pitch * roll;
}

Eigen::Isometry3d CameraMounting::BaseFromOptical() const {
  return BaseFromCamera() * CameraFromOptical();
}

CameraFile ParseCameraFile(const std::string& yaml, const std::string& name) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& exception) {
    throw Error("the camera file '" + name + "' is no YAML: " + exception.what());
  }
  return Parse(root, name);
}

std::string FormatCameraFile(const CameraFile& camera) {
  const geo::CameraIntrinsics& k = camera.intrinsics;
  const CameraMounting& m = camera.mounting;
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(10);
  text << "name: " << camera.name << "\nwidth: " << k.width << "\nheight: " << k.height
       << "\nfx: " << k.fx << "\nfy: " << k.fy << "\ncx: " << k.cx << "\ncy: " << k.cy
       << "\nmounting:\n  forward_m: " << m.forward_m << "\n  left_m: " << m.left_m
       << "\n  height_m: " << m.height_m << "\n  roll_deg: " << m.roll_deg
       << "\n  pitch_deg: " << m.pitch_deg << "\n  yaw_deg: " << m.yaw_deg << "\n";
  return text.str();
}

CameraFile ReadCameraFile(const std::string& path) {
  return ParseCameraFile(ReadTextFile(path, kMaxCameraFileBytes), path);
}

}  // namespace livemap::datasets
