#include "datasets/survey.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxLabelBytes = 1U << 20U;

bool IsPlainName(const std::string& name) {
  return !name.empty() && name.size() <= 128 && name.front() != '.' &&
         name.find('/') == std::string::npos && name.find('\0') == std::string::npos;
}

}  // namespace

std::vector<SurveyRow> ParseSurveyTable(const std::string& text, const std::string& name) {
  const std::vector<std::string> lines = Lines(text);
  if (lines.empty() || lines[0] != "frame,chainage_m,potholes") {
    throw Error("line 1 of '" + name + "' must be 'frame,chainage_m,potholes'");
  }
  std::vector<SurveyRow> rows;
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::string where = "line " + std::to_string(i + 1) + " of '" + name + "'";
    const std::vector<std::string> parts = Split(lines[i], ',');
    const std::optional<double> chainage = parts.size() == 3 ? ParseFinite(parts[1]) : std::nullopt;
    const std::optional<double> potholes = parts.size() == 3 ? ParseFinite(parts[2]) : std::nullopt;
    if (!chainage || !potholes || *potholes < 0 || *potholes > 10000 || !IsPlainName(parts[0]) ||
        std::abs(*chainage) > 1e8) {
      throw Error(where + " is '" + lines[i].substr(0, 80) +
                  "', accepted is 'frame,chainage_m,potholes' with a plain file name");
    }
    if (!rows.empty() && *chainage < rows.back().chainage_m) {
      throw Error(where + " goes back from chainage " + std::to_string(rows.back().chainage_m) +
                  " to " + std::to_string(*chainage) + ", frames must stand in driving order");
    }
    rows.push_back({parts[0], *chainage, static_cast<int>(*potholes)});
  }
  if (rows.empty()) throw Error("'" + name + "' lists no frame");
  return rows;
}

SurveyDrive ReadSurveyDrive(const std::string& directory) {
  const fs::path root(directory);
  if (!fs::is_directory(root)) throw Error("the survey folder '" + directory + "' does not exist");
  SurveyDrive drive;
  drive.name = fs::weakly_canonical(root).filename().string();
  const std::string table_path = (root / "frames.csv").string();
  for (const SurveyRow& row : ParseSurveyTable(ReadFile(table_path, kMaxTableBytes), table_path)) {
    SurveyFrame frame;
    frame.name = row.frame;
    frame.chainage_m = row.chainage_m;
    frame.image_path = (root / "images" / (row.frame + ".jpg")).string();
    if (!fs::is_regular_file(frame.image_path)) {
      throw Error("the image '" + frame.image_path + "' of the survey is missing");
    }
    const std::string label_path = (root / "labels" / (row.frame + ".txt")).string();
    if (fs::exists(label_path)) {
      frame.boxes = ParseYoloLabels(ReadFile(label_path, kMaxLabelBytes), label_path);
    } else if (row.potholes > 0) {
      throw Error("the label file '" + label_path + "' is missing though frames.csv counts " +
                  std::to_string(row.potholes) + " potholes");
    }
    drive.frames.push_back(std::move(frame));
  }
  return drive;
}

std::vector<FramePlace> PlaceFrames(const SurveyDrive& drive, double speed_mps, double max_gap_s) {
  std::vector<FramePlace> places;
  places.reserve(drive.frames.size());
  double distance_m = 0;
  for (std::size_t i = 0; i < drive.frames.size(); ++i) {
    if (i > 0) {
      const double gap_m = drive.frames[i].chainage_m - drive.frames[i - 1].chainage_m;
      distance_m += max_gap_s > 0 ? std::min(gap_m, max_gap_s * speed_mps) : gap_m;
    }
    places.push_back({distance_m / speed_mps, distance_m});
  }
  return places;
}

}  // namespace livemap::datasets
