#include "datasets/survey.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text_file.h"
#include "datasets/label_files.h"
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
    throw Error("line 1 of '" + name + "' is '" + (lines.empty() ? "" : lines[0].substr(0, 80)) +
                "', it must be 'frame,chainage_m,potholes'");
  }
  std::vector<SurveyRow> rows;
  std::set<std::string> frames;
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
    if (!frames.insert(parts[0]).second) {
      throw Error(where + " repeats the frame '" + parts[0] + "', accepted is one line for each");
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
  if (!fs::exists(root)) throw Error("the survey folder '" + directory + "' does not exist");
  if (!fs::is_directory(root)) throw Error("'" + directory + "' is no folder");
  SurveyDrive drive;
  drive.name = fs::weakly_canonical(root).filename().string();
  const std::string table_path = (root / "frames.csv").string();
  if (!fs::is_directory(root / "images")) {
    throw Error("the survey folder '" + directory + "' has no folder images");
  }
  const PictureFolder pictures((root / "images").string(), PictureNames::kNamed);
  const std::vector<SurveyRow> rows =
      ParseSurveyTable(ReadTextFile(table_path, kMaxTableBytes), table_path);
  std::set<std::string> listed;
  for (const SurveyRow& row : rows) {
    SurveyFrame frame;
    frame.name = row.frame;
    frame.chainage_m = row.chainage_m;
    const std::optional<std::string> picture = pictures.Find(row.frame);
    if (!picture) {
      const std::string extension = HasPictureExtension(row.frame) ? "" : ".jpg";
      throw Error("the image '" + (root / "images" / (row.frame + extension)).string() +
                  "' of the survey is missing: accepted in frames.csv are the names of the images "
                  "without their extensions");
    }
    if (!listed.insert(*picture).second) {
      throw Error("'" + table_path + "' lists the picture '" + *picture +
                  "' twice, the second time as '" + row.frame + "', accepted is one line for each");
    }
    frame.image_path = *picture;
    drive.frames.push_back(std::move(frame));
  }
  const std::map<std::string, fs::path> labels = LabelFilesIn(root / "labels", pictures);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    SurveyFrame& frame = drive.frames[i];
    const std::string name = StemOf(frame.image_path);
    if (const auto label = labels.find(name); label != labels.end()) {
      const std::string path = label->second.string();
      frame.boxes = ParseYoloLabels(ReadTextFile(path, kMaxLabelBytes), path);
    } else if (rows[i].potholes > 0) {
      throw Error("the label file '" + (root / "labels" / (name + ".txt")).string() +
                  "' is missing though frames.csv counts " + std::to_string(rows[i].potholes) +
                  " potholes");
    }
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
