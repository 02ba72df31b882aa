#include "simulation/datasets/tum_writer.h"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "simulation/datasets/output_files.h"

namespace livemap::simulation {

TumWriter::TumWriter(const std::string& directory, const SimulatedCamera& camera,
                     double depth_scale, double baseline_m)
    : directory_(directory), depth_scale_(depth_scale) {
  MakeNewFolder(directory, {"rgb", "depth"});
  WriteCamera(directory + "/camera.yaml", camera, depth_scale, baseline_m);
  rgb_ = OpenFile(directory + "/rgb.txt");
  depth_ = OpenFile(directory + "/depth.txt");
  associations_ = OpenFile(directory + "/associations.txt");
  truth_ = OpenFile(directory + "/groundtruth.txt");
  rgb_ << "# timestamp filename\n";
  depth_ << "# timestamp filename\n";
  truth_ << "# timestamp tx ty tz qx qy qz qw\n";
}

void TumWriter::Add(double time_s, const SimulatedFrame& frame, const cv::Mat& right) {
  const std::string stamp = FormatNumber("%.6f", time_s);
  const std::string rgb = "rgb/" + stamp + ".png";
  const std::string depth = "depth/" + stamp + ".png";
  cv::Mat coded;
  // What 16 bits cannot hold is unknown, not near.
  frame.depth.convertTo(coded, CV_16UC1, depth_scale_);
  coded.setTo(0, frame.depth > 65534.0 / depth_scale_);
  WriteImage(directory_ + "/" + rgb, frame.bgr, {cv::IMWRITE_PNG_COMPRESSION, 1});
  WriteImage(directory_ + "/" + depth, coded, {cv::IMWRITE_PNG_COMPRESSION, 1});
  if (!right.empty()) {
    if (!right_.is_open()) {
      std::error_code error;
      std::filesystem::create_directories(directory_ + "/rgb_right", error);
      right_ = OpenFile(directory_ + "/rgb_right.txt");
      right_ << "# timestamp filename\n";
    }
    const std::string path = "rgb_right/" + stamp + ".png";
    WriteImage(directory_ + "/" + path, right, {cv::IMWRITE_PNG_COMPRESSION, 1});
    right_ << stamp << " " << path << "\n";
  }
  rgb_ << stamp << " " << rgb << "\n";
  depth_ << stamp << " " << depth << "\n";
  associations_ << stamp << " " << rgb << " " << stamp << " " << depth << "\n";
  truth_ << stamp << FormatPose(" %.9f", frame.world_from_optical) << "\n";
}

void TumWriter::Finish() {
  if (right_.is_open()) CloseFile(right_, directory_ + "/rgb_right.txt");
  CloseFile(rgb_, directory_ + "/rgb.txt");
  CloseFile(depth_, directory_ + "/depth.txt");
  CloseFile(associations_, directory_ + "/associations.txt");
  CloseFile(truth_, directory_ + "/groundtruth.txt");
}

}  // namespace livemap::simulation
