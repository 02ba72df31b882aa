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

namespace livemap::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxTextBytes = std::size_t{16} * 1024 * 1024;
constexpr std::size_t kMaxFrames = 1000000;

/// Where the images and the labels of a folder are.
struct Layout {
  fs::path root;  // may hold frames.csv and classes.txt
  fs::path images;
  fs::path labels;

  fs::path Difficult() const {
    return root / "difficult" / labels.lexically_relative(root / "labels");
  }
};

bool IsImage(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png";
}

std::vector<fs::path> ImagesIn(const fs::path& folder) {
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && IsImage(entry.path())) images.push_back(entry.path());
    if (images.size() > kMaxFrames) {
      throw Error("folder '" + folder.string() + "' has more than " + std::to_string(kMaxFrames) +
                  " images, accepted are fewer");
    }
  }
  std::sort(images.begin(), images.end());
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

/// a/images/val -> a/labels/val for the last part of the path that is "images".
std::optional<Layout> LayoutOfImagesFolder(const fs::path& path) {
  fs::path below;
  for (fs::path part = path; part.has_filename() && part != part.root_path();
       part = part.parent_path()) {
    if (part.filename() == "images") {
      const fs::path root = part.parent_path();
      Layout layout{root, path, root / "labels"};
      if (!below.empty()) layout.labels /= below;
      return layout;
    }
    below = below.empty() ? part.filename() : part.filename() / below;
  }
  return std::nullopt;
}

Layout FindLayout(const std::string& text, const std::string& split) {
  const fs::path path = fs::absolute(text).lexically_normal();
  const fs::path folder = path.has_filename() ? path : path.parent_path();
  if (!fs::is_directory(folder)) {
    throw Error("'" + text + "' is no folder, accepted is a folder with images/ and labels/");
  }
  Layout layout{folder, folder / "images", folder / "labels"};
  if (!fs::is_directory(layout.images)) {
    const std::optional<Layout> inside = LayoutOfImagesFolder(folder);
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
};

struct FramesTable {
  std::vector<Place> places;  // in driving order
  bool counts_potholes = false;
};

double ParseNumber(const std::string& text, const std::string& origin) {
  std::istringstream stream(text);
  double value = 0;
  if (!(stream >> value) || !(stream >> std::ws).eof() || !std::isfinite(value)) {
    throw Error(origin + " has '" + text.substr(0, 80) + "', accepted is a finite number");
  }
  return value;
}

std::vector<std::string> SplitCommas(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) {
    while (!cell.empty() && (cell.back() == '\r' || cell.back() == ' ')) cell.pop_back();
    cells.push_back(cell);
  }
  return cells;
}

FramesTable ReadFramesTable(const fs::path& path) {
  std::istringstream lines(ReadFile(path.string(), kMaxTextBytes));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> header = SplitCommas(line);
  const auto frame = std::find(header.begin(), header.end(), "frame") - header.begin();
  const auto chainage = std::find(header.begin(), header.end(), "chainage_m") - header.begin();
  const auto columns = static_cast<std::ptrdiff_t>(header.size());
  if (frame == columns || chainage == columns) {
    throw Error("'" + path.string() + "' has the header '" + line.substr(0, 80) +
                "', accepted is one with the columns frame and chainage_m");
  }
  FramesTable table;
  table.counts_potholes = std::find(header.begin(), header.end(), "potholes") != header.end();
  for (std::size_t number = 2; std::getline(lines, line); ++number) {
    const std::vector<std::string> cells = SplitCommas(line);
    if (cells.empty()) continue;
    const std::string origin = "'" + path.string() + "', line " + std::to_string(number) + ",";
    if (cells.size() != header.size()) {
      throw Error(origin + " has " + std::to_string(cells.size()) + " values, accepted are " +
                  std::to_string(header.size()));
    }
    table.places.push_back({cells[static_cast<std::size_t>(frame)],
                            ParseNumber(cells[static_cast<std::size_t>(chainage)], origin)});
  }
  std::sort(table.places.begin(), table.places.end(), [](const Place& a, const Place& b) {
    return std::tie(a.chainage_m, a.frame) < std::tie(b.chainage_m, b.frame);
  });
  return table;
}

std::vector<std::string> ReadLines(const fs::path& path) {
  std::istringstream stream(ReadFile(path.string(), kMaxTextBytes));
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back())) != 0) {
      line.pop_back();
    }
    if (!line.empty()) lines.push_back(line);
  }
  return lines;
}

/// Lower case, without everything that is no letter or digit.
std::string Letters(const std::string& text) {
  std::string letters;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) letters += static_cast<char>(std::tolower(byte));
  }
  return letters;
}

std::vector<std::string> FindClasses(const std::string& text, const Layout& layout,
                                     const LabelledFolderConfig& options, bool counts_potholes,
                                     std::optional<std::string>* deduced) {
  if (!options.label_classes.empty()) return options.label_classes;
  for (const fs::path& folder : {layout.root, layout.labels}) {
    if (fs::is_regular_file(folder / "classes.txt")) return ReadLines(folder / "classes.txt");
  }
  std::vector<std::string> found;
  if (counts_potholes) found = {"pothole"};
  // Only the folder's own name counts: further up, names say little ("/home/deer/...").
  const std::string own_name = Letters(layout.root.filename().string());
  for (const std::string& name : options.model_classes) {
    if (!counts_potholes && own_name.find(Letters(name)) != std::string::npos) {
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

std::vector<LabelledFrame::Label> ReadLabels(const fs::path& path,
                                             const std::vector<std::string>& classes) {
  if (!fs::exists(path)) return {};
  return ParseYoloLabels(ReadFile(path.string(), kMaxTextBytes), classes, path.string());
}

LabelledFrame ReadFrame(const fs::path& image, const Layout& layout,
                        const std::vector<std::string>& classes) {
  LabelledFrame frame;
  frame.image_path = image.string();
  const fs::path name = image.stem().concat(".txt");
  frame.labels = ReadLabels(layout.labels / name, classes);
  frame.difficult = ReadLabels(layout.Difficult() / name, classes);
  return frame;
}

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
    for (std::size_t i = 0; i < 5; ++i) v[i] = ParseNumber(values[i], place);
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
  const Layout layout = FindLayout(path, options.split);
  const std::vector<fs::path> images = ImagesIn(layout.images);
  if (images.empty()) {
    const std::string splits = NamesOfFolders(layout.images);
    throw Error("folder '" + layout.images.string() + "' has no image, accepted are .jpg, .jpeg " +
                "and .png files" + (splits.empty() ? "" : ", or --split with one of: " + splits));
  }
  LabelledFolder folder;
  folder.path = path;
  // A drive's table is about the whole drive, which a split would tear apart.
  folder.is_drive =
      fs::is_regular_file(layout.root / "frames.csv") && layout.images == layout.root / "images";
  const FramesTable table =
      folder.is_drive ? ReadFramesTable(layout.root / "frames.csv") : FramesTable{};
  folder.classes = FindClasses(path, layout, options, table.counts_potholes, deduced);
  if (!folder.is_drive) {
    for (const fs::path& image : images) {
      folder.frames.push_back(ReadFrame(image, layout, folder.classes));
    }
    return folder;
  }
  std::map<std::string, fs::path> by_name;
  for (const fs::path& image : images) by_name[image.stem().string()] = image;
  for (const Place& place : table.places) {
    const auto image = by_name.find(place.frame);
    if (image == by_name.end()) {
      throw Error("frame '" + place.frame + "' of '" + (layout.root / "frames.csv").string() +
                  "' is not in images/, accepted are the names of its images");
    }
    folder.frames.push_back(ReadFrame(image->second, layout, folder.classes));
    folder.frames.back().chainage_m = place.chainage_m;
  }
  return folder;
}

}  // namespace livemap::evaluation
