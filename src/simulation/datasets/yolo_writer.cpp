#include "simulation/datasets/yolo_writer.h"

#include <cstdio>
#include <opencv2/imgcodecs.hpp>

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

}  // namespace livemap::simulation
