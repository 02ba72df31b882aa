#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace livemap::evaluation {

/// One labelled image, not yet decoded.
struct LabelledFrame {
  /// One object; its box as fractions of the image's width and height.
  struct Label {
    std::string class_name;
    cv::Rect2d box;
  };

  std::string image_path;
  std::vector<Label> labels;
  std::vector<Label> difficult;  ///< Objects that need not be found, as nobody could name them.
  double chainage_m = 0;         ///< Of drives.
};

/// A folder of labelled images: a YOLO folder or a drive.
struct LabelledFolder {
  std::string path;
  bool is_drive = false;              ///< frames.csv gives the frames' places along the road.
  std::vector<std::string> classes;   ///< What is labelled in it, by the label files' class ids.
  std::vector<LabelledFrame> frames;  ///< A drive's in driving order, others by name.
  std::vector<std::string> notes;     ///< Doubts for whoever reads the figures, a sentence each.
};

/// How to read a folder.
struct LabelledFolderConfig {
  /// Class names by the label files' ids; empty: the folder's classes.txt, else deduced.
  std::vector<std::string> label_classes;
  /// Names that may be deduced: those of the model.
  std::vector<std::string> model_classes;
  /// "train", "val", ...: part of a folder whose images/ and labels/ have such sub-folders; empty:
  /// none.
  std::string split;
};

/// Reads the labels of `path`, which is
///  - a folder with images/ and labels/ (with frames.csv, "frame,chainage_m,...", a drive),
///  - one whose images/ and labels/ are divided into splits, with `options.split`, or
///  - an images/ folder or one of its splits, its labels beside it (a/images/val, a/labels/val).
/// A file images that holds the path of a folder, which is what copying makes of a link where links
/// are not allowed, stands for that folder.
/// A folder difficult/ beside labels/, divided as that is, may hold more files of the same form.
/// Pictures are JPEG and PNG files, their extensions spelled in any way (PictureFolder); two with
/// one name, and a label file that belongs to no picture, are refused. A label file has lines
/// "class x_centre y_centre width height", fractions of the image; a missing one means an empty
/// image, and is refused where the column "potholes" of frames.csv counts some in it. Where that
/// column and the label files count differently, `notes` says so. Without class names from options
/// or classes.txt, class 0 is taken as pothole in a drive whose frames.csv has the column
/// "potholes", and otherwise as the model's class whose letters stand in the folder's name
/// ("traffic_cones" is traffic_cone); `deduced` then receives a sentence that says so. Throws Error
/// naming the file, its value and what is accepted.
LabelledFolder ReadLabelledFolder(const std::string& path, const LabelledFolderConfig& options,
                                  std::optional<std::string>* deduced);

/// Labels of one file's text; `origin` names it in errors. Boxes are cut to the image.
std::vector<LabelledFrame::Label> ParseYoloLabels(const std::string& text,
                                                  const std::vector<std::string>& classes,
                                                  const std::string& origin);

}  // namespace livemap::evaluation
