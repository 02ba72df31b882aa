#include "datasets/label_files.h"

#include <set>

#include "common/error.h"

namespace livemap::datasets {

namespace fs = std::filesystem;

namespace {

/// A label file that belongs to no picture would be passed over, and its picture count as empty.
void RefuseStrayLabels(const fs::path& folder, const std::map<std::string, fs::path>& files,
                       const std::set<std::string>& pictures) {
  const fs::path* first = nullptr;
  std::size_t strays = 0;
  for (const auto& [name, path] : files) {
    if (pictures.count(name) > 0) continue;
    if (strays++ == 0) first = &path;
  }
  if (first == nullptr) return;
  throw Error("label file '" + first->string() + "' belongs to no picture (" +
              std::to_string(strays) + " of the " + std::to_string(files.size()) +
              " label files of '" + folder.string() +
              "' do not), accepted is the name of a picture, without its extension, with .txt");
}

/// Labels that are divided into splits beside pictures that are not.
void RefuseLabelsOfNoSplit(const fs::path& folder, const PictureFolder& pictures) {
  if (pictures.paths().empty()) return;
  const fs::path beside = fs::path(pictures.paths().front()).parent_path();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path name = entry.path().filename();
    if (!entry.is_directory() || name.string().front() == '.') continue;
    if (fs::is_directory(beside / name)) continue;
    for (const fs::directory_entry& label : fs::directory_iterator(entry.path())) {
      if (LowerExtension(label.path().string()) != ".txt") continue;
      throw Error("label file '" + label.path().string() + "' belongs to no picture, as '" +
                  (beside / name).string() +
                  "' does not exist, accepted are labels divided as the pictures are");
    }
  }
}

}  // namespace

std::map<std::string, fs::path> LabelFilesIn(const fs::path& folder,
                                             const PictureFolder& pictures) {
  std::map<std::string, fs::path> files;
  if (!fs::is_directory(folder)) return files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    if (path.filename().string().front() == '.' || LowerExtension(path.string()) != ".txt") {
      continue;
    }
    const auto [twin, is_new] = files.emplace(path.stem().string(), path);
    if (!is_new) {
      throw Error("'" + twin->second.string() + "' and '" + path.string() +
                  "' have one name, accepted is one label file of each");
    }
  }
  if (!pictures.Find("classes")) files.erase("classes");  // The names of the classes.
  std::map<std::string, std::string> lonely;  // Pictures without labels, by their number.
  std::set<std::string> stems;
  for (const std::string& picture : pictures.paths()) {
    const std::string stem = fs::path(picture).stem().string();
    stems.insert(stem);
    if (files.count(stem) == 0) lonely.emplace(WithoutLeadingZeros(stem), picture);
  }
  for (const auto& [name, path] : files) {
    const auto lonely_picture = lonely.find(WithoutLeadingZeros(name));
    if (stems.count(name) > 0 || lonely_picture == lonely.end()) continue;
    throw Error("label file '" + path.string() + "' and picture '" + lonely_picture->second +
                "' differ by leading zeros, accepted is one name for both");
  }
  RefuseStrayLabels(folder, files, stems);
  RefuseLabelsOfNoSplit(folder, pictures);
  return files;
}

}  // namespace livemap::datasets
