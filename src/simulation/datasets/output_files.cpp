#include "simulation/datasets/output_files.h"

#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "common/error.h"

namespace livemap::simulation {

namespace fs = std::filesystem;

std::ofstream OpenFile(const std::string& path) {
  std::ofstream file(path);
  if (!file) throw Error("the file '" + path + "' cannot be written");
  return file;
}

void CheckWritable(const std::string& path) {
  std::error_code ignored;
  const bool was_there = fs::exists(path, ignored);
  std::ofstream file(path, std::ios::app);
  if (!file) throw Error("the file '" + path + "' cannot be written");
  file.close();
  if (!was_there) fs::remove(path, ignored);
}

void CloseFile(std::ofstream& file, const std::string& path) {
  file.close();
  if (!file) throw Error("the file '" + path + "' could not be written to its end");
}

void MakeNewFolder(const std::string& directory, const std::vector<std::string>& inside) {
  std::error_code error;
  if (fs::exists(directory, error) && !fs::is_directory(directory, error)) {
    throw Error("'" + directory + "' is a file, accepted is a new or empty folder");
  }
  if (fs::exists(directory, error) && !fs::is_empty(directory, error)) {
    throw Error("the folder '" + directory + "' is not empty, accepted is a new or empty one");
  }
  MakeFolder(directory);
  for (const std::string& name : inside) MakeFolder((fs::path(directory) / name).string());
}

void MakeFolder(const std::string& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) throw Error("the folder '" + directory + "' cannot be made: " + error.message());
}

void WriteImage(const std::string& path, const cv::Mat& image, const std::vector<int>& parameters) {
  if (!cv::imwrite(path, image, parameters)) {
    throw Error("the picture '" + path + "' cannot be written");
  }
}

void WriteCamera(const std::string& path, const SimulatedCamera& camera, double depth_scale,
                 double baseline_m) {
  const geo::CameraIntrinsics& k = camera.intrinsics;
  std::ofstream file = OpenFile(path);
  file.precision(10);
  file << "width: " << k.width << "\nheight: " << k.height << "\nfx: " << k.fx << "\nfy: " << k.fy
       << "\ncx: " << k.cx << "\ncy: " << k.cy << "\ndepth_scale: " << depth_scale << "\n";
  if (camera.k1 != 0 || camera.k2 != 0) {
    file << "k1: " << camera.k1 << "\nk2: " << camera.k2 << "\n";
  }
  if (baseline_m > 0) file << "baseline_m: " << baseline_m << "\n";
  CloseFile(file, path);
}

std::string FormatNumber(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

std::string FormatPose(const char* format, const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  std::string text;
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
    text += FormatNumber(format, value);
  }
  return text;
}

}  // namespace livemap::simulation
