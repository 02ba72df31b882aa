#include "tools/detection/error_sheets.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "tools/common/contact_sheet.h"
#include "tools/detection/detection_tool_support.h"

namespace livemap::tools {
namespace {

namespace fs = std::filesystem;

const cv::Size kTile(320, 240);
constexpr int kColumns = 4;
/// Of the picture's width, what a crop shows at least, so that the road around is seen.
constexpr float kMinShare = 0.3F;
constexpr float kContext = 3;  // of the box's longer side

const cv::Scalar kLabelColour(60, 220, 60);
const cv::Scalar kDifficultColour(160, 160, 160);
const cv::Scalar kDetectionColour(40, 40, 255);
const cv::Scalar kWeakColour(40, 40, 120);

/// An error at its place.
struct ShownError {
  std::size_t frame = 0;
  cv::Rect2f box;
  float score = 0;
  const char* cause = "";
};

/// A part of a picture, enlarged to a tile.
class ErrorSheetTile {
 public:
  ErrorSheetTile(const cv::Mat& picture, const cv::Rect2f& around) {
    const float width = std::max(kContext * std::max(around.width, around.height),
                                 kMinShare * static_cast<float>(picture.cols));
    const float height = width * static_cast<float>(kTile.height) / static_cast<float>(kTile.width);
    const cv::Point2f centre = (around.tl() + around.br()) * 0.5F;
    scale_ = static_cast<float>(kTile.width) / width;
    offset_ = cv::Point2f(centre.x - width / 2, centre.y - height / 2);
    const cv::Matx23f tile_from_picture(scale_, 0, -offset_.x * scale_, 0, scale_,
                                        -offset_.y * scale_);
    cv::warpAffine(picture, image_, tile_from_picture, kTile, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                   cv::Scalar::all(24));
  }

  void Draw(const cv::Rect2f& box, const cv::Scalar& colour) {
    cv::rectangle(image_, (box.tl() - offset_) * scale_, (box.br() - offset_) * scale_, colour, 1,
                  cv::LINE_AA);
  }

  void Write(const std::string& text) {
    cv::rectangle(image_, {0, 0, kTile.width, 18}, cv::Scalar::all(24), cv::FILLED);
    cv::putText(image_, text, {4, 13}, cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar::all(255), 1,
                cv::LINE_AA);
  }

  const cv::Mat& image() const { return image_; }

 private:
  cv::Mat image_;
  float scale_ = 1;
  cv::Point2f offset_;
};

cv::Mat ShowErrorOnSheet(const evaluation::ScoredFrame& frame, const std::string& picture,
                         const ShownError& error, double threshold) {
  ErrorSheetTile tile(ReadImage(picture), error.box);
  for (const cv::Rect2f& box : frame.difficult) tile.Draw(box, kDifficultColour);
  for (const evaluation::ScoredBox& detection : frame.detections) {
    // Far below the threshold a detector has boxes everywhere.
    if (detection.score < 0.5 * threshold) continue;
    tile.Draw(detection.box, detection.score >= threshold ? kDetectionColour : kWeakColour);
  }
  for (const cv::Rect2f& box : frame.labels) tile.Draw(box, kLabelColour);
  char score[16];
  std::snprintf(score, sizeof(score), " %.2f", double{error.score});
  tile.Write(fs::path(picture).stem().string() + " " + error.cause + score);
  return tile.image();
}

std::vector<ShownError> MissedEventSheets(const evaluation::ScoredDrive& drive, double threshold) {
  std::vector<ShownError> shown;
  for (const evaluation::MissedEvent& missed : evaluation::FindMissedEvents(drive, threshold)) {
    const std::vector<cv::Rect2f>& labels = drive[missed.frame].labels;
    const auto largest =
        std::max_element(labels.begin(), labels.end(),
                         [](const auto& a, const auto& b) { return a.area() < b.area(); });
    shown.push_back({missed.frame, *largest, missed.score, evaluation::CauseName(missed.cause)});
  }
  return shown;
}

std::vector<ShownError> FalseReportSheets(const evaluation::ScoredDrive& drive, double threshold) {
  std::vector<ShownError> shown;
  for (const evaluation::FalseReport& report : evaluation::FindFalseReports(drive, threshold)) {
    shown.push_back({report.frame, report.detection.box, report.detection.score,
                     evaluation::CauseName(report.cause)});
  }
  return shown;
}

std::ofstream OpenErrorList(const fs::path& path) {
  const bool is_new = !fs::exists(path);
  std::ofstream list(path, std::ios::app);
  if (is_new) list << "class,kind,cause,score,x,y,width,height,picture\n";
  if (!list) throw Error("'" + path.string() + "' cannot be written");
  return list;
}

}  // namespace

void WriteErrorSheets(const std::string& directory, const std::string& class_name,
                      const std::vector<PicturedDrive>& drives, double threshold) {
  std::error_code failed;
  fs::create_directories(directory, failed);
  if (failed) throw Error("folder '" + directory + "' cannot be made: " + failed.message());
  std::ofstream list = OpenErrorList(fs::path(directory) / "errors.csv");
  for (const bool is_miss : {true, false}) {
    const std::string kind = is_miss ? "missed" : "false";
    std::vector<cv::Mat> tiles;
    for (const auto& [drive, pictures] : drives) {
      for (const ShownError& error :
           is_miss ? MissedEventSheets(*drive, threshold) : FalseReportSheets(*drive, threshold)) {
        const std::string& picture = (*pictures)[error.frame];
        tiles.push_back(ShowErrorOnSheet((*drive)[error.frame], picture, error, threshold));
        list << class_name << "," << kind << "," << error.cause << "," << error.score << ","
             << error.box.x << "," << error.box.y << "," << error.box.width << ","
             << error.box.height << "," << picture << "\n";
      }
    }
    if (tiles.empty()) continue;
    const std::string path = directory + "/" + class_name + "_" + kind + ".jpg";
    if (!cv::imwrite(path, ContactSheet(tiles, kColumns))) {
      throw Error("'" + path + "' cannot be written");
    }
  }
}

}  // namespace livemap::tools
