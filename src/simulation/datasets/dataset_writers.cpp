#include "simulation/datasets/dataset_writers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "simulation/datasets/output_files.h"

namespace livemap::simulation {
namespace {

constexpr int kJpegQuality = 90;

std::string YoloLine(const HazardInView& hazard, const cv::Size& size) {
  const int class_id =
      static_cast<int>(hazard.object_class) - static_cast<int>(ObjectClass::kPothole);
  const cv::Rect& box = hazard.box;
  return std::to_string(class_id) + FormatNumber(" %.6f", (box.x + 0.5 * box.width) / size.width) +
         FormatNumber(" %.6f", (box.y + 0.5 * box.height) / size.height) +
         FormatNumber(" %.6f", static_cast<double>(box.width) / size.width) +
         FormatNumber(" %.6f", static_cast<double>(box.height) / size.height) + "\n";
}

}  // namespace

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

YoloWriter::YoloWriter(const std::string& directory) : directory_(directory) {
  MakeNewFolder(directory, {"images", "labels", "difficult"});
  std::ofstream classes = OpenFile(directory + "/classes.txt");
  for (const ObjectClass object_class : HazardClasses()) classes << ClassName(object_class) << "\n";
  CloseFile(classes, directory + "/classes.txt");
  frames_ = OpenFile(directory + "/frames.csv");
  frames_ << "frame,chainage_m\n";
}

void YoloWriter::Add(double chainage_m, const SimulatedFrame& frame,
                     const std::vector<HazardInView>& hazards) {
  char name[16];
  std::snprintf(name, sizeof(name), "%06zu", count_++);
  WriteImage(directory_ + "/images/" + name + ".jpg", frame.bgr,
             {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  for (const bool difficult : {false, true}) {
    const std::string path = directory_ + (difficult ? "/difficult/" : "/labels/") + name + ".txt";
    std::ofstream labels = OpenFile(path);
    for (const HazardInView& hazard : hazards) {
      if (hazard.difficult == difficult) labels << YoloLine(hazard, frame.bgr.size());
    }
    CloseFile(labels, path);
  }
  frames_ << name << FormatNumber(",%.3f", chainage_m) << "\n";
}

void YoloWriter::Finish() { CloseFile(frames_, directory_ + "/frames.csv"); }

std::string HazardsAsGeoJson(const Street& street, const geo::GeoPoint& datum,
                             const std::map<std::uint32_t, int>& frames_seen, double end_along_m) {
  const geo::LocalFrame frame(datum);
  nlohmann::json features = nlohmann::json::array();
  const auto last = static_cast<int>(street.line().length_m() / kBlockM) + 1;
  for (int index = 0; index <= last; ++index) {
    for (const StreetHazard& hazard : street.Hazards(index)) {
      const auto seen = frames_seen.find(hazard.instance);
      if (seen == frames_seen.end()) continue;
      const Eigen::Vector3d place = street.line().At(hazard.along_m, hazard.left_m, 0);
      const geo::GeoPoint position = frame.ToGeo(place.head<2>());
      features.push_back(
          {{"type", "Feature"},
           {"geometry",
            {{"type", "Point"}, {"coordinates", {position.longitude_deg, position.latitude_deg}}}},
           {"properties",
            {{"id", hazard.instance},
             {"class", ClassName(hazard.object_class)},
             {"along_m", hazard.along_m},
             {"left_m", hazard.left_m},
             {"radius_m", hazard.radius_m},
             {"frames_seen", seen->second},
             {"passed", hazard.along_m < end_along_m}}}});
    }
  }
  return nlohmann::json({{"type", "FeatureCollection"}, {"features", features}}).dump(1) + "\n";
}

cv::Mat ColourClasses(const cv::Mat& classes) {
  cv::Mat hue(classes.size(), CV_8UC3);
  for (int row = 0; row < classes.rows; ++row) {
    for (int column = 0; column < classes.cols; ++column) {
      const int value = classes.at<std::uint8_t>(row, column);
      const bool hazard = IsHazard(static_cast<ObjectClass>(value));
      hue.at<cv::Vec3b>(row, column) =
          cv::Vec3b(static_cast<std::uint8_t>(value * 41 % 180), hazard ? 255 : 90,
                    value == 0 ? 0 : (hazard ? 255 : 150));
    }
  }
  cv::Mat bgr;
  cv::cvtColor(hue, bgr, cv::COLOR_HSV2BGR);
  return bgr;
}

cv::Mat ColourDepth(const cv::Mat& depth) {
  cv::Mat coded(depth.size(), CV_8UC1);
  for (int row = 0; row < depth.rows; ++row) {
    for (int column = 0; column < depth.cols; ++column) {
      const float metres = depth.at<float>(row, column);
      const float share = metres > 0 ? 255.0F * Saturate(3.0F / (metres + 1.0F)) : 0.0F;
      coded.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(share);
    }
  }
  cv::Mat bgr;
  cv::applyColorMap(coded, bgr, cv::COLORMAP_TURBO);
  bgr.setTo(cv::Scalar(0, 0, 0), depth <= 0);
  return bgr;
}

void DrawHazards(const std::vector<HazardInView>& hazards, cv::Mat& bgr) {
  for (const HazardInView& hazard : hazards) {
    cv::rectangle(bgr, hazard.box, cv::Scalar(0, 255, 255), 1);
    cv::putText(bgr, ClassName(hazard.object_class), {hazard.box.x, std::max(10, hazard.box.y - 3)},
                cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar(0, 255, 255), 1, cv::LINE_AA);
  }
}

}  // namespace livemap::simulation
