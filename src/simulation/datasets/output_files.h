#pragma once

#include <Eigen/Geometry>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "simulation/render/simulated_camera.h"

namespace livemap::simulation {

// Files of simulated drives. Every Error names the path.

/// Throws Error when the file cannot be written.
std::ofstream OpenFile(const std::string& path);
/// Throws Error when the file cannot be written; changes nothing. For what is written at the end of
/// a long run.
void CheckWritable(const std::string& path);
/// Throws Error when the disk was full.
void CloseFile(std::ofstream& file, const std::string& path);
/// Makes the folder and those `inside` it; throws Error when it exists and is not empty.
void MakeNewFolder(const std::string& directory, const std::vector<std::string>& inside);
/// Makes the folder and those above it, if need be.
void MakeFolder(const std::string& directory);
/// `parameters` as cv::imwrite takes them.
void WriteImage(const std::string& path, const cv::Mat& image, const std::vector<int>& parameters);
/// Intrinsics and distortion as the reader of drives wants them; `depth_scale` is units per metre
/// of the depth pictures, `baseline_m` from the left camera to the right one, 0: there is one
/// camera.
void WriteCamera(const std::string& path, const SimulatedCamera& camera, double depth_scale,
                 double baseline_m = 0);

/// `format` is printf's for one double.
std::string FormatNumber(const char* format, double value);
/// tx, ty, tz (metres), qx, qy, qz, qw, each as `format` says.
std::string FormatPose(const char* format, const Eigen::Isometry3d& pose);

}  // namespace livemap::simulation
