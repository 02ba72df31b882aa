#include "simulation/datasets/change_dataset_writer.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "simulation/datasets/output_files.h"

namespace livemap::simulation {
namespace {

void WriteDatasetPng(const std::string& path, const cv::Mat& image) {
  WriteImage(path, image, {cv::IMWRITE_PNG_COMPRESSION, 1});
}

cv::Vec3b DatasetColourOf(protocol::ChangeClass change_class) {
  const auto rgb = protocol::ChangeClassColour(change_class);
  return {rgb[2], rgb[1], rgb[0]};
}

nlohmann::json DatasetFeatureOf(const StreetChange& change, int frames_seen, const Street& street,
                                const geo::LocalFrame& local) {
  const Eigen::Vector3d place = street.line().At(change.along_m, change.left_m, 0);
  const geo::GeoPoint position = local.ToGeo(place.head<2>());
  const ObjectClass object_class = ClassOfInstance(change.instance);
  return {{"type", "Feature"},
          {"geometry",
           {{"type", "Point"}, {"coordinates", {position.longitude_deg, position.latitude_deg}}}},
          {"properties",
           {{"instance", change.instance},
            {"class", ClassName(object_class)},
            {"change_class", protocol::ChangeClassName(ChangeClassOf(object_class))},
            {"change", change.appeared ? "appeared" : "vanished"},
            {"along_m", change.along_m},
            {"left_m", change.left_m},
            {"frames_seen", frames_seen}}}};
}

}  // namespace

ChangeDatasetWriter::ChangeDatasetWriter(const std::string& directory,
                                         const SimulatedCamera& camera)
    : directory_(directory) {
  MakeNewFolder(directory, {"raw"});
  WriteCamera(directory + "/camera.yaml", camera, 1);
  const std::string path = directory + "/classes.txt";
  std::ofstream classes = OpenFile(path);
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    classes << protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i)) << "\n";
  }
  CloseFile(classes, path);
  poses_ = OpenFile(directory + "/poses.csv");
  poses_ << "frame,pair";
  for (const std::string pass : {"first", "second"}) {
    for (const char* part : {"tx", "ty", "tz", "qx", "qy", "qz", "qw", "along_m"}) {
      poses_ << "," << pass << "_" << part;
    }
  }
  poses_ << "\n";
}

void ChangeDatasetWriter::Add(const PassPicture& first, const PassPicture& second,
                              const ChangeView& view) {
  char sequence[24];
  char number[24];
  std::snprintf(sequence, sizeof(sequence), "%03zu", pairs_ / kPairsPerSequence);
  std::snprintf(number, sizeof(number), "%02zu", pairs_ % kPairsPerSequence);
  const std::string folder = directory_ + "/raw/" + sequence;
  if (pairs_ % kPairsPerSequence == 0) {
    for (const char* inside : {"/RGB", "/GT", "/GT_colours", "/GT_direction"})
      MakeFolder(folder + inside);
  }
  WriteDatasetPng(folder + "/RGB/1_" + number + ".png", first.frame.bgr);
  WriteDatasetPng(folder + "/RGB/2_" + number + ".png", second.frame.bgr);
  WriteDatasetPng(folder + "/GT/gt" + number + ".png", view.mask);
  WriteDatasetPng(folder + "/GT_direction/gt" + number + ".png", view.direction);
  WriteDatasetPng(folder + "/GT_colours/gt" + number + ".png", ColourChanges(view.mask));
  poses_ << pairs_ << "," << sequence << "/" << number;
  for (const PassPicture* picture : {&first, &second}) {
    poses_ << FormatPose(",%.9f", picture->frame.world_from_optical)
           << FormatNumber(",%.3f", picture->along_m);
  }
  poses_ << "\n";
  for (const auto& [instance, pixels] : view.pixels) {
    if (pixels >= kMinPixels) ++frames_seen_[instance];
  }
  ++pairs_;
}

void ChangeDatasetWriter::Finish(const Street& street, const geo::GeoPoint& datum,
                                 const std::map<std::uint32_t, StreetChange>& changes) {
  CloseFile(poses_, directory_ + "/poses.csv");
  const geo::LocalFrame local(datum);
  nlohmann::json features = nlohmann::json::array();
  for (const auto& [instance, change] : changes) {
    const auto seen = frames_seen_.find(instance);
    features.push_back(
        DatasetFeatureOf(change, seen == frames_seen_.end() ? 0 : seen->second, street, local));
  }
  const std::string path = directory_ + "/changes.geojson";
  std::ofstream file = OpenFile(path);
  file << nlohmann::json({{"type", "FeatureCollection"}, {"features", features}}).dump(1) << "\n";
  CloseFile(file, path);
}

cv::Mat ColourChanges(const cv::Mat& mask) {
  cv::Mat colours(mask.size(), CV_8UC3);
  for (int row = 0; row < mask.rows; ++row) {
    for (int column = 0; column < mask.cols; ++column) {
      colours.at<cv::Vec3b>(row, column) =
          DatasetColourOf(static_cast<protocol::ChangeClass>(mask.at<std::uint8_t>(row, column)));
    }
  }
  return colours;
}

cv::Mat OverlayChanges(const cv::Mat& bgr, const cv::Mat& mask) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::Mat dim;
  cv::cvtColor(grey, dim, cv::COLOR_GRAY2BGR);
  dim *= 0.55;
  cv::Mat mixed;
  cv::addWeighted(bgr, 0.25, ColourChanges(mask), 0.75, 0, mixed);
  mixed.copyTo(dim, mask);
  return dim;
}

}  // namespace livemap::simulation
