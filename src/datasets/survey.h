#pragma once

#include <string>
#include <vector>

#include "datasets/labels.h"

namespace livemap::datasets {

/// One frame of a road survey.
struct SurveyFrame {
  std::string name;        ///< File name of image and label without extension.
  double chainage_m = 0;   ///< Metres along the road.
  std::string image_path;  ///< A JPEG or PNG file; not opened yet.
  std::vector<LabelledBox> boxes;
};

/// One survey section in driving order: `frames.csv` (frame,chainage_m,potholes), `images/NAME.jpg`
/// (or another spelling, or a PNG) and, for frames with potholes, `labels/NAME.txt` in YOLO form.
struct SurveyDrive {
  std::string name;  ///< Of the folder.
  std::vector<SurveyFrame> frames;
};

/// A line of frames.csv.
struct SurveyRow {
  std::string frame;
  double chainage_m = 0;
  int potholes = 0;
};

/// Parses frames.csv. Throws Error naming the line when it is malformed, a frame's name could leave
/// the folder, or the chainage runs backwards.
std::vector<SurveyRow> ParseSurveyTable(const std::string& text, const std::string& name);

/// Reads the table and all labels. Throws Error naming what is missing or malformed.
SurveyDrive ReadSurveyDrive(const std::string& directory);

/// When and where along the driven road each frame is taken.
struct FramePlace {
  double time_s = 0;      ///< Since the first frame.
  double distance_m = 0;  ///< Driven since the first frame.
};

/// Time is chainage over speed. With a positive `max_gap_s`, a stretch without frames that would
/// take longer is cut out of the road: the drive goes on `max_gap_s` later, that much road further
/// at the same speed, so that fixes stay plausible and frames that are metres apart stay so.
std::vector<FramePlace> PlaceFrames(const SurveyDrive& drive, double speed_mps, double max_gap_s);

}  // namespace livemap::datasets
