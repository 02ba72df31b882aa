#include "change/measures/change_pairs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>

#include "change/measures/change_metrics.h"
#include "common/error.h"
#include "imaging/image_header.h"
#include "protocol/change_class.h"

namespace livemap::change {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxPictureBytes = 64U << 20U;
constexpr std::int64_t kMaxPicturePixels = 64000000;
constexpr std::size_t kMaxPairs = 1000000;
constexpr std::array<std::uint8_t, 3> kMiscellaneousRgb{255, 242, 0};
constexpr double kMaxUnknownColours = 0.01;

bool IsPicture(const fs::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

std::vector<fs::path> Listed(const fs::path& folder, bool folders) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator item(folder, error), end; !error && item != end;
       item.increment(error)) {
    std::error_code ignored;
    const bool wanted =
        folders ? item->is_directory(ignored) : item->is_regular_file(ignored) && IsPicture(*item);
    if (wanted) found.push_back(item->path());
  }
  if (error) {
    throw Error("folder '" + folder.string() + "' cannot be read: " + error.message());
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// `stem` with any picture's extension in `folder`.
std::string PictureOf(const fs::path& folder, const std::string& stem, const fs::path& mask) {
  for (const char* extension : {".png", ".jpg", ".jpeg"}) {
    const fs::path path = folder / (stem + extension);
    std::error_code ignored;
    if (fs::is_regular_file(path, ignored)) return path.string();
  }
  throw Error("mask '" + mask.string() + "' has no picture '" + (folder / stem).string() +
              ".png' or .jpg");
}

void AddSequence(const fs::path& sequence, const std::string& prefix,
                 std::vector<ChangePairFiles>& pairs) {
  for (const fs::path& mask : Listed(sequence / "GT", false)) {
    const std::string stem = mask.stem().string();
    if (stem.size() < 3 || stem.compare(0, 2, "gt") != 0) continue;
    const std::string number = stem.substr(2);
    const fs::path direction = sequence / "GT_direction" / mask.filename();
    std::error_code ignored;
    pairs.push_back({prefix + number, PictureOf(sequence / "RGB", "1_" + number, mask),
                     PictureOf(sequence / "RGB", "2_" + number, mask), mask.string(),
                     fs::is_regular_file(direction, ignored) ? direction.string() : ""});
  }
}

bool IsSequence(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_directory(folder / "GT", ignored) && fs::is_directory(folder / "RGB", ignored);
}

void AddSequences(const fs::path& folder, std::vector<ChangePairFiles>& pairs) {
  for (const fs::path& sequence : Listed(folder, true)) {
    if (IsSequence(sequence)) AddSequence(sequence, sequence.filename().string() + "/", pairs);
  }
}

/// The deepest folder above all of `folders`, which are absolute.
fs::path CommonAncestor(const std::vector<fs::path>& folders) {
  fs::path common = folders[0].parent_path();
  for (const fs::path& folder : folders) {
    const auto holds = [&folder](const fs::path& above) {
      return std::mismatch(above.begin(), above.end(), folder.begin(), folder.end()).first ==
             above.end();
    };
    while (!holds(common) || common == folder) common = common.parent_path();
  }
  return common;
}

void AddFlat(const fs::path& folder, std::vector<ChangePairFiles>& pairs) {
  for (const fs::path& mask : Listed(folder / "mask", false)) {
    const std::string stem = mask.stem().string();
    pairs.push_back({stem, PictureOf(folder / "t0", stem, mask),
                     PictureOf(folder / "t1", stem, mask), mask.string(), ""});
  }
}

/// The class that a published colour stands for; none for a colour of no class.
std::optional<std::uint8_t> ClassOfColour(const std::array<std::uint8_t, 3>& rgb) {
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    if (protocol::ChangeClassColour(static_cast<protocol::ChangeClass>(i)) == rgb)
      return static_cast<std::uint8_t>(i);
  }
  if (rgb == kMiscellaneousRgb) return static_cast<std::uint8_t>(protocol::ChangeClass::kRubbish);
  if (rgb == std::array<std::uint8_t, 3>{0, 0, 0}) return kLeftOutPixel;
  return std::nullopt;
}

ChangeMask DecodeColours(const cv::Mat& image, const std::string& path) {
  ChangeMask mask;
  mask.classes = cv::Mat(image.size(), CV_8UC1);
  const int channels = image.channels();
  std::array<std::uint8_t, 3> last{255, 255, 255};
  std::optional<std::uint8_t> meaning = ClassOfColour(last);
  for (int row = 0; row < image.rows; ++row) {
    const auto* bgr = image.ptr<std::uint8_t>(row);
    auto* classes = mask.classes.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column, bgr += channels) {
      const std::array<std::uint8_t, 3> rgb{bgr[2], bgr[1], bgr[0]};
      if (rgb != last) {
        last = rgb;
        meaning = ClassOfColour(rgb);
      }
      classes[column] = meaning.value_or(kLeftOutPixel);
      mask.unknown_colour_pixels += meaning ? 0 : 1;
    }
  }
  if (static_cast<double>(mask.unknown_colour_pixels) >
      kMaxUnknownColours * static_cast<double>(image.total())) {
    throw Error("mask '" + path + "' has " + std::to_string(mask.unknown_colour_pixels) + " of " +
                std::to_string(image.total()) +
                " pixels in colours of no class, accepted is up to one in a hundred");
  }
  return mask;
}

ChangeMask DecodeIndices(const cv::Mat& image, const std::string& path) {
  ChangeMask mask;
  std::array<std::size_t, 256> counts{};
  for (int row = 0; row < image.rows; ++row) {
    const auto* values = image.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column) ++counts[values[column]];
  }
  for (std::size_t value = protocol::kChangeClasses; value < kLeftOutPixel; ++value) {
    if (counts[value] == 0) continue;
    throw Error("mask '" + path + "' has the value " + std::to_string(value) +
                ", accepted are 0 to 9 and 255 (classes), or 0 and 255 (change or not)");
  }
  const bool some_class = std::any_of(counts.begin() + 1, counts.begin() + protocol::kChangeClasses,
                                      [](auto n) { return n; });
  mask.classes = image.clone();
  if (counts[kLeftOutPixel] != 0 && !some_class) {
    mask.with_classes = false;
    mask.classes.setTo(1, image == kLeftOutPixel);
  }
  return mask;
}

}  // namespace

std::vector<ChangePairFiles> FindChangePairs(const std::string& directory) {
  const fs::path folder(directory);
  std::error_code ignored;
  std::vector<ChangePairFiles> pairs;
  if (!fs::is_directory(folder, ignored)) {
    throw Error("'" + directory + "' is not a folder");
  }
  if (fs::is_directory(folder / "mask", ignored)) {
    AddFlat(folder, pairs);
  } else if (IsSequence(folder)) {
    AddSequence(folder, "", pairs);
  } else if (fs::is_directory(folder / "raw", ignored)) {
    AddSequences(folder / "raw", pairs);
  } else {
    AddSequences(folder, pairs);
  }
  if (pairs.empty() || pairs.size() > kMaxPairs) {
    throw Error("folder '" + directory + "' has " + std::to_string(pairs.size()) +
                " pairs, accepted are 1 to " + std::to_string(kMaxPairs) +
                " as raw/NNN/RGB/1_II.png, 2_II.png and raw/NNN/GT/gtII.png, or as t0/, t1/ and "
                "mask/");
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  return pairs;
}

std::vector<ChangePairFiles> FindChangePairs(const std::vector<std::string>& directories) {
  if (directories.size() == 1) return FindChangePairs(directories[0]);
  std::vector<fs::path> folders;
  for (const std::string& directory : directories) {
    fs::path folder = fs::absolute(directory).lexically_normal();
    if (!folder.has_filename()) folder = folder.parent_path();  // It ended in a slash.
    if (std::count(folders.begin(), folders.end(), folder) != 0) {
      throw Error("folder '" + directory + "' is named twice");
    }
    folders.push_back(folder);
  }
  const fs::path common = CommonAncestor(folders);
  std::vector<ChangePairFiles> pairs;
  std::set<fs::path> masks;
  for (const fs::path& folder : folders) {
    const std::string prefix = folder.lexically_relative(common).string() + "/";
    for (ChangePairFiles& files : FindChangePairs(folder.string())) {
      if (!masks.insert(fs::canonical(files.truth)).second) {
        throw Error("folder '" + folder.string() + "' has pairs of another folder: mask '" +
                    files.truth + "' is named twice");
      }
      files.name.insert(0, prefix);
      pairs.push_back(std::move(files));
    }
  }
  return pairs;
}

cv::Mat ReadPicture(const std::string& path, int flags) {
  const std::string bytes = ReadFile(path, kMaxPictureBytes);
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const auto header = imaging::ReadImageHeader(data, bytes.size());
  if (!header || header->format == imaging::ImageHeader::Format::kWebp) {
    throw Error("'" + path + "' is no JPEG or PNG picture");
  }
  if (std::int64_t{header->width} * header->height > kMaxPicturePixels) {
    throw Error("picture '" + path + "' is " + std::to_string(header->width) + "x" +
                std::to_string(header->height) + ", accepted are up to 64 megapixels");
  }
  cv::Mat image;
  if (imaging::HasImageEnd(data, bytes.size(), header->format)) {
    try {
      image = cv::imdecode(
          cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<std::uint8_t*>(data)),
          flags);
    } catch (const cv::Exception&) {
      image.release();
    }
  }
  if (image.empty()) throw Error("picture '" + path + "' is corrupt or cut off");
  return image;
}

ChangeMask DecodeChangeMask(const cv::Mat& image, const std::string& path) {
  if (image.depth() != CV_8U || (image.channels() != 1 && image.channels() < 3)) {
    throw Error("mask '" + path + "' has " + std::to_string(image.channels()) + " channels of " +
                std::to_string(8 * image.elemSize1()) +
                " bits, accepted are 8 bits and one channel, or colour");
  }
  return image.channels() == 1 ? DecodeIndices(image, path) : DecodeColours(image, path);
}

ChangePair LoadChangePair(const ChangePairFiles& files) {
  ChangePair pair;
  pair.before = ReadPicture(files.before, cv::IMREAD_COLOR);
  pair.after = ReadPicture(files.after, cv::IMREAD_COLOR);
  ChangeMask mask = DecodeChangeMask(ReadPicture(files.truth, cv::IMREAD_UNCHANGED), files.truth);
  pair.truth = std::move(mask.classes);
  pair.with_classes = mask.with_classes;
  pair.unknown_colour_pixels = mask.unknown_colour_pixels;
  const auto check = [&](const cv::Mat& image, const std::string& path) {
    if (image.size() == pair.after.size()) return;
    throw Error("'" + path + "' is " + std::to_string(image.cols) + "x" +
                std::to_string(image.rows) + ", accepted is the size of '" + files.after + "', " +
                std::to_string(pair.after.cols) + "x" + std::to_string(pair.after.rows));
  };
  check(pair.before, files.before);
  check(pair.truth, files.truth);
  if (files.direction.empty()) return pair;
  pair.direction = ReadPicture(files.direction, cv::IMREAD_UNCHANGED);
  check(pair.direction, files.direction);
  if (pair.direction.type() != CV_8UC1 ||
      cv::countNonZero(pair.direction > int{protocol::kVanishedPixel}) > 0) {
    throw Error("mask '" + files.direction +
                "' is no mask of direction, accepted are 8 bits of one channel with 0, 1 "
                "(appeared) and 2 (vanished)");
  }
  return pair;
}

}  // namespace livemap::change
