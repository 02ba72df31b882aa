#include "evaluation/detection/labelled_folder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text_file.h"
#include "datasets/label_files.h"

namespace livemap::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxTextBytes = std::size_t{16} * 1024 * 1024;
constexpr std::size_t kMaxFrames = 1000000;

/// Where the images and the labels of a folder are.
struct FolderLayout {
  fs::path root;  // may hold frames.csv and classes.txt
  fs::path images;
  fs::path labels;

  fs::path Difficult() const {
    return (root / "difficult" / labels.lexically_relative(root / "labels")).lexically_normal();
  }
};

/// Pictures by their names: a set may hold "7.jpg" and "007.jpg".
PictureFolder ImagesIn(const fs::path& folder) {
  PictureFolder images(folder.string(), PictureNames::kNamed);
  if (images.paths().size() > kMaxFrames) {
    throw Error("folder '" + folder.string() + "' has more than " + std::to_string(kMaxFrames) +
                " images, accepted are fewer");
  }
  return images;
}

std::string NamesOfFolders(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) names.insert(entry.path().filename().string());
  }
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

/// The folder that a text file names by its only line, as git and unpackers leave a link where
/// links are not allowed; `path` itself where it is no such file.
fs::path FolderBehind(const fs::path& path) {
  constexpr std::size_t kMaxLinkBytes = 4096;
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored) || fs::file_size(path, ignored) > kMaxLinkBytes)
    return path;
  std::string text = ReadTextFile(path.string(), kMaxLinkBytes);
  text.erase(text.find_last_not_of("\r\n") + 1);
  const fs::path target = (path.parent_path() / text).lexically_normal();
  return !text.empty() && fs::is_directory(target, ignored) ? target : path;
}

/// a/images/val -> a/labels/val for the last part of the path that is "images".
std::optional<FolderLayout> LayoutOfImagesFolder(const fs::path& path) {
  fs::path below;
  for (fs::path part = path; part.has_filename() && part != part.root_path();
       part = part.parent_path()) {
    if (part.filename() == "images") {
      const fs::path root = part.parent_path();
      FolderLayout layout{root, path, root / "labels"};
      if (!below.empty()) layout.labels /= below;
      return layout;
    }
    below = below.empty() ? part.filename() : part.filename() / below;
  }
  return std::nullopt;
}

FolderLayout FindFolderLayout(const std::string& text, const std::string& split) {
  const fs::path path = fs::absolute(text).lexically_normal();
  const fs::path folder = path.has_filename() ? path : path.parent_path();
  if (!fs::is_directory(folder)) {
    throw Error("'" + text + "' is no folder, accepted is a folder with images/ and labels/");
  }
  FolderLayout layout{folder, FolderBehind(folder / "images"), folder / "labels"};
  if (!fs::is_directory(layout.images)) {
    const std::optional<FolderLayout> inside = LayoutOfImagesFolder(folder);
    if (!inside) {
      throw Error("folder '" + text +
                  "' has no images/, accepted is a folder with images/ and "
                  "labels/ or an images/ folder beside a labels/ folder");
    }
    layout = *inside;
  } else if (!split.empty()) {
    layout.images /= split;
    layout.labels /= split;
  }
  if (!fs::is_directory(layout.images)) {
    const std::string splits = NamesOfFolders(layout.images.parent_path());
    throw Error("folder '" + layout.images.string() + "' does not exist, " +
                (splits.empty() ? "'" + text + "' is not divided: accepted is no --split"
                                : "accepted for --split is one of: " + splits));
  }
  if (!fs::is_directory(layout.labels)) {
    throw Error("labels '" + layout.labels.string() + "' do not exist, accepted is a labels/ " +
                "folder divided as the images/ folder is");
  }
  return layout;
}

/// One row of frames.csv.
struct Place {
  std::string frame;
  double chainage_m = 0;
  std::optional<double> potholes;  // as the table counts them
};

struct FramesTable {
  std::vector<Place> places;  // in driving order
  bool counts_potholes = false;
};

double ParseLabelNumber(const std::string& text, const std::string& origin) {
  std::istringstream stream(text);
  double value = 0;
  if (!(stream >> value) || !(stream >> std::ws).eof() || !std::isfinite(value)) {
    throw Error(origin + " has '" + text.substr(0, 80) + "', accepted is a finite number");
  }
  return value;
}

std::vector<std::string> SplitFramesTableLine(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) {
    while (!cell.empty() && (cell.back() == '\r' || cell.back() == ' ')) cell.pop_back();
    cells.push_back(cell);
  }
  return cells;
}

FramesTable ReadFramesTable(const fs::path& path) {
  std::istringstream lines(ReadTextFile(path.string(), kMaxTextBytes));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> header = SplitFramesTableLine(line);
  const auto frame = std::find(header.begin(), header.end(), "frame") - header.begin();
  const auto chainage = std::find(header.begin(), header.end(), "chainage_m") - header.begin();
  const auto columns = static_cast<std::ptrdiff_t>(header.size());
  if (frame == columns || chainage == columns) {
    throw Error("'" + path.string() + "' has the header '" + line.substr(0, 80) +
                "', accepted is one with the columns frame and chainage_m");
  }
  FramesTable table;
  const auto potholes = std::find(header.begin(), header.end(), "potholes") - header.begin();
  table.counts_potholes = potholes != columns;
  for (std::size_t number = 2; std::getline(lines, line); ++number) {
    const std::vector<std::string> cells = SplitFramesTableLine(line);
    if (cells.empty() || (cells.size() == 1 && cells[0].empty())) continue;
    const std::string origin = "'" + path.string() + "', line " + std::to_string(number) + ",";
    if (cells.size() != header.size()) {
      throw Error(origin + " has " + std::to_string(cells.size()) + " values, accepted are " +
                  std::to_string(header.size()));
    }
    table.places.push_back({cells[static_cast<std::size_t>(frame)],
                            ParseLabelNumber(cells[static_cast<std::size_t>(chainage)], origin),
                            std::nullopt});
    if (!table.counts_potholes) continue;
    const std::string& counted = cells[static_cast<std::size_t>(potholes)];
    if (!counted.empty()) table.places.back().potholes = ParseLabelNumber(counted, origin);
  }
  if (table.places.empty()) throw Error("'" + path.string() + "' lists no frame");
  std::set<std::string> seen;
  for (const Place& place : table.places) {
    if (seen.insert(place.frame).second) continue;
    throw Error("'" + path.string() + "' lists the frame '" + place.frame +
                "' twice, accepted is one line for each");
  }
  std::sort(table.places.begin(), table.places.end(), [](const Place& a, const Place& b) {
    return std::tie(a.chainage_m, a.frame) < std::tie(b.chainage_m, b.frame);
  });
  return table;
}

std::vector<std::string> ReadLabelLines(const fs::path& path) {
  std::istringstream stream(ReadTextFile(path.string(), kMaxTextBytes));
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back())) != 0) {
      line.pop_back();
    }
    lines.push_back(line);
  }
  while (!lines.empty() && lines.back().empty()) lines.pop_back();
  if (lines.empty()) {
    throw Error("'" + path.string() + "' names no class, accepted is a name per line");
  }
  // A class's number is its line's, so a blank one would shift those below it or name none.
  const auto blank = std::find(lines.begin(), lines.end(), "");
  if (blank != lines.end()) {
    throw Error("'" + path.string() + "', line " + std::to_string(blank - lines.begin() + 1) +
                ", is blank, accepted is a name in each line");
  }
  return lines;
}

/// Lower case, without everything that is no letter or digit.
std::string LettersOfFolderName(const std::string& text) {
  std::string letters;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) letters += static_cast<char>(std::tolower(byte));
  }
  return letters;
}

std::vector<std::string> FindClassesOfFolder(const std::string& text, const FolderLayout& layout,
                                             const LabelledFolderConfig& options,
                                             bool counts_potholes,
                                             std::optional<std::string>* deduced) {
  if (!options.label_classes.empty()) return options.label_classes;
  for (const fs::path& folder : {layout.root, layout.labels}) {
    if (fs::is_regular_file(folder / "classes.txt")) return ReadLabelLines(folder / "classes.txt");
  }
  std::vector<std::string> found;
  if (counts_potholes) found = {"pothole"};
  // Only the folder's own name counts: further up, names say little ("/home/deer/...").
  const std::string own_name = LettersOfFolderName(layout.root.filename().string());
  for (const std::string& name : options.model_classes) {
    if (!counts_potholes && own_name.find(LettersOfFolderName(name)) != std::string::npos) {
      found.push_back(name);
    }
  }
  if (found.size() != 1) {
    throw Error("folder '" + text +
                "' does not say what its label class 0 is, accepted is "
                "--label-classes NAME,... or a classes.txt in the folder");
  }
  if (deduced != nullptr) {
    *deduced = "taking label class 0 of '" + text + "' as " + found[0] +
               "; --label-classes says otherwise";
  }
  return found;
}

/// Reads the labels of single pictures of a folder.
class FrameReader {
 public:
  FrameReader(const FolderLayout& layout, const PictureFolder& images,
              std::vector<std::string> classes)
      : labels_(datasets::LabelFilesIn(layout.labels, images)),
        difficult_(datasets::LabelFilesIn(layout.Difficult(), images)),
        classes_(std::move(classes)) {}

  bool HasLabelFile(const std::string& image) const { return labels_.count(StemOf(image)) > 0; }

  LabelledFrame Read(const std::string& image) const {
    LabelledFrame frame;
    frame.image_path = image;
    frame.labels = LabelsOf(StemOf(image), labels_);
    frame.difficult = LabelsOf(StemOf(image), difficult_);
    return frame;
  }

 private:
  std::vector<LabelledFrame::Label> LabelsOf(const std::string& stem,
                                             const std::map<std::string, fs::path>& files) const {
    const auto file = files.find(stem);
    if (file == files.end()) return {};
    const std::string path = file->second.string();
    return ParseYoloLabels(ReadTextFile(path, kMaxTextBytes), classes_, path);
  }

  std::map<std::string, fs::path> labels_;
  std::map<std::string, fs::path> difficult_;
  std::vector<std::string> classes_;
};

/// Compares a drive's table, which counts the potholes of each frame, with its label files.
class PotholeCounts {
 public:
  explicit PotholeCounts(fs::path table) : table_(std::move(table)) {}

  /// Throws Error for potholes that no label file says the places of.
  void Check(const Place& place, const LabelledFrame& frame, bool has_label_file) {
    if (!place.potholes) return;
    if (*place.potholes > 0 && !has_label_file) {
      throw Error("'" + table_.string() + "' counts potholes in the frame '" + place.frame +
                  "', which has no label file, accepted is one for each frame with potholes");
    }
    const auto labelled = static_cast<double>(std::count_if(
        frame.labels.begin(), frame.labels.end(),
        [](const LabelledFrame::Label& label) { return label.class_name == "pothole"; }));
    if (labelled == *place.potholes) return;
    if (differing_++ == 0) first_ = place.frame;
  }

  void Note(std::vector<std::string>& notes) const {
    if (differing_ == 0) return;
    notes.push_back("'" + table_.string() + "' counts other potholes than the label files in " +
                    std::to_string(differing_) + (differing_ == 1 ? " frame" : " frames") +
                    ", the first is '" + first_ + "': the label files count");
  }

 private:
  fs::path table_;
  std::size_t differing_ = 0;
  std::string first_;
};

}  // namespace

std::vector<LabelledFrame::Label> ParseYoloLabels(const std::string& text,
                                                  const std::vector<std::string>& classes,
                                                  const std::string& origin) {
  std::vector<LabelledFrame::Label> labels;
  std::istringstream lines(text);
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    std::vector<std::string> values;
    for (std::string word; words >> word;) values.push_back(word);
    if (values.empty()) continue;
    const std::string place = "label file '" + origin + "', line " + std::to_string(number) + ",";
    if (values.size() != 5) {
      throw Error(place + " has " + std::to_string(values.size()) +
                  " values, accepted are 5: class x_centre y_centre width height");
    }
    std::array<double, 5> v{};
    for (std::size_t i = 0; i < 5; ++i) v[i] = ParseLabelNumber(values[i], place);
    const auto count = static_cast<double>(classes.size());
    if (!(v[0] >= 0 && v[0] < count && v[0] == std::floor(v[0]))) {
      throw Error(place + " has class " + values[0].substr(0, 80) + ", accepted is 0 to " +
                  std::to_string(classes.size() - 1));
    }
    // Annotation tools leave boxes that reach a little beyond the image.
    const bool plausible = std::all_of(v.begin() + 1, v.end(), [](double fraction) {
      return fraction >= -0.5 && fraction <= 1.5;
    });
    const cv::Rect2d cut =
        cv::Rect2d(v[1] - v[3] / 2, v[2] - v[4] / 2, v[3], v[4]) & cv::Rect2d(0, 0, 1, 1);
    if (!plausible || v[3] <= 0 || v[4] <= 0 || cut.width <= 0 || cut.height <= 0) {
      throw Error(place + " has the box '" + line.substr(0, 80) +
                  "', accepted are fractions of the image, 0 to 1, with an area");
    }
    labels.push_back({classes[static_cast<std::size_t>(v[0])], cut});
  }
  return labels;
}

LabelledFolder ReadLabelledFolder(const std::string& path, const LabelledFolderConfig& options,
                                  std::optional<std::string>* deduced) {
  const FolderLayout layout = FindFolderLayout(path, options.split);
  const PictureFolder images = ImagesIn(layout.images);
  if (images.paths().empty()) {
    const std::string splits = NamesOfFolders(layout.images);
    throw Error("folder '" + layout.images.string() + "' has no image, accepted are .jpg, .jpeg " +
                "and .png files" + (splits.empty() ? "" : ", or --split with one of: " + splits));
  }
  LabelledFolder folder;
  folder.path = path;
  // A drive's table is about the whole drive, which a split would tear apart.
  folder.is_drive = fs::is_regular_file(layout.root / "frames.csv") &&
                    layout.images == FolderBehind(layout.root / "images");
  const FramesTable table =
      folder.is_drive ? ReadFramesTable(layout.root / "frames.csv") : FramesTable{};
  folder.classes = FindClassesOfFolder(path, layout, options, table.counts_potholes, deduced);
  const FrameReader reader(layout, images, folder.classes);
  if (!folder.is_drive) {
    for (const std::string& image : images.paths()) folder.frames.push_back(reader.Read(image));
    return folder;
  }
  PotholeCounts counts(layout.root / "frames.csv");
  std::map<std::string, std::string> listed;  // Frames by their pictures.
  for (const Place& place : table.places) {
    const std::optional<std::string> image = images.Find(place.frame);
    if (!image) {
      throw Error("frame '" + place.frame + "' of '" + (layout.root / "frames.csv").string() +
                  "' is not in images/, accepted are the names of its images without their "
                  "extensions");
    }
    const auto [twin, is_new] = listed.emplace(*image, place.frame);
    if (!is_new) {
      throw Error("'" + (layout.root / "frames.csv").string() + "' lists the picture '" + *image +
                  "' twice, as '" + twin->second + "' and '" + place.frame +
                  "', accepted is one line for each");
    }
    folder.frames.push_back(reader.Read(*image));
    folder.frames.back().chainage_m = place.chainage_m;
    counts.Check(place, folder.frames.back(), reader.HasLabelFile(*image));
  }
  const std::vector<std::string>& classes = folder.classes;
  if (std::count(classes.begin(), classes.end(), "pothole") > 0) counts.Note(folder.notes);
  return folder;
}

}  // namespace livemap::evaluation
