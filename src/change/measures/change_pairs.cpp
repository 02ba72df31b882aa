#include "change/measures/change_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>

#include "change/methods/change_probabilities.h"
#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text.h"
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

std::vector<fs::path> FoldersIn(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator item(folder, error), end; !error && item != end;
       item.increment(error)) {
    std::error_code ignored;
    if (item->is_directory(ignored)) found.push_back(item->path());
  }
  if (error) {
    throw Error("folder '" + folder.string() + "' cannot be read: " + error.message());
  }
  std::sort(found.begin(), found.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.string(), b.string());
  });
  return found;
}

/// The mask's picture of that name, in any spelling and with any number of leading zeros.
std::string PictureOf(const PictureFolder& pictures, const fs::path& folder,
                      const std::string& stem, const std::string& mask) {
  const std::optional<std::string> picture = pictures.Find(stem);
  if (picture) return *picture;
  throw Error("mask '" + mask + "' has no picture '" + (folder / stem).string() + ".png' or .jpg");
}

void AddSequencePairs(const fs::path& sequence, const std::string& prefix,
                      std::vector<ChangePairFiles>& pairs) {
  const fs::path rgb = sequence / "RGB";
  const PictureFolder pictures(rgb.string(), PictureNames::kNumbered);
  std::optional<PictureFolder> directions;
  std::error_code ignored;
  if (fs::is_directory(sequence / "GT_direction", ignored)) {
    directions.emplace((sequence / "GT_direction").string(), PictureNames::kNumbered);
  }
  const PictureFolder masks((sequence / "GT").string(), PictureNames::kNumbered);
  const auto all_masks = std::make_shared<MaskFolder>((sequence / "GT").string());
  for (const std::string& mask : masks.paths()) {
    const std::string stem = StemOf(mask);
    if (stem.size() < 3 || stem.compare(0, 2, "gt") != 0) continue;
    const std::string number = stem.substr(2);
    pairs.push_back({prefix + number, PictureOf(pictures, rgb, "1_" + number, mask),
                     PictureOf(pictures, rgb, "2_" + number, mask), mask,
                     directions ? directions->Find(stem).value_or("") : "", all_masks});
  }
}

bool IsSequenceOfPairs(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_directory(folder / "GT", ignored) && fs::is_directory(folder / "RGB", ignored);
}

void AddPairsOfSequences(const fs::path& folder, std::vector<ChangePairFiles>& pairs) {
  for (const fs::path& sequence : FoldersIn(folder)) {
    if (IsSequenceOfPairs(sequence))
      AddSequencePairs(sequence, sequence.filename().string() + "/", pairs);
  }
}

/// The deepest folder above all of `folders`, which are absolute.
fs::path CommonFolderOfPairs(const std::vector<fs::path>& folders) {
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

void AddFlatPairs(const fs::path& folder, std::vector<ChangePairFiles>& pairs) {
  const PictureFolder before((folder / "t0").string(), PictureNames::kNamed);
  const PictureFolder after((folder / "t1").string(), PictureNames::kNamed);
  const auto all_masks = std::make_shared<MaskFolder>((folder / "mask").string());
  for (const std::string& mask :
       PictureFolder((folder / "mask").string(), PictureNames::kNamed).paths()) {
    const std::string stem = StemOf(mask);
    pairs.push_back({stem, PictureOf(before, folder / "t0", stem, mask),
                     PictureOf(after, folder / "t1", stem, mask), mask, "", all_masks});
  }
}

bool IsVisitPair(const fs::path& folder) {
  const PictureFolder pictures(folder.string(), PictureNames::kNamed);
  return pictures.Find("t0") && pictures.Find("t1") && pictures.Find("mask");
}

void AddVisitPairs(const fs::path& folder, std::vector<ChangePairFiles>& pairs) {
  const auto masks = std::make_shared<MaskFolder>(MaskFolder::OfChangeOrNot());
  for (const fs::path& visit : FoldersIn(folder)) {
    if (!IsVisitPair(visit)) continue;
    const PictureFolder pictures(visit.string(), PictureNames::kNamed);
    ChangePairFiles files{visit.filename().string(),
                          *pictures.Find("t1"),
                          *pictures.Find("t0"),
                          *pictures.Find("mask"),
                          "",
                          masks};
    files.ignored = pictures.Find("ignore").value_or("");
    const fs::path homography = visit / "H_t1_to_t0.txt";
    std::error_code unknown;
    if (fs::exists(homography, unknown)) files.homography = homography.string();
    pairs.push_back(std::move(files));
  }
}

cv::Matx33d ReadPairHomography(const std::string& path) {
  constexpr std::size_t kMaxBytes = 4096;
  std::istringstream text(ReadFile(path, kMaxBytes));
  cv::Matx33d homography;
  int count = 0;
  for (double value = 0; text >> value; ++count) {
    if (count < 9 && std::isfinite(value)) homography.val[count] = value;
  }
  if (count != 9 || !text.eof() || std::abs(cv::determinant(homography)) < 1e-12) {
    throw Error("homography '" + path + "' is not nine numbers of a matrix that can be inverted");
  }
  return homography;
}

/// The class that a published colour stands for; none for a colour of no class.
std::optional<std::uint8_t> MaskClassOfColour(const std::array<std::uint8_t, 3>& rgb) {
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    if (protocol::ChangeClassColour(static_cast<protocol::ChangeClass>(i)) == rgb)
      return static_cast<std::uint8_t>(i);
  }
  if (rgb == kMiscellaneousRgb) return static_cast<std::uint8_t>(protocol::ChangeClass::kRubbish);
  if (rgb == std::array<std::uint8_t, 3>{0, 0, 0}) return kLeftOutPixel;
  return std::nullopt;
}

/// What the colours of a mask are, without their meaning.
struct Colours {
  bool grey = true;          ///< All are black, white or a shade between.
  bool white = true;         ///< All are white.
  bool transparent = false;  ///< Some are.
};

Colours LookAtColours(const cv::Mat& image) {
  Colours colours;
  const int channels = image.channels();
  for (int row = 0; row < image.rows; ++row) {
    const auto* bgr = image.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column, bgr += channels) {
      const bool grey = bgr[0] == bgr[1] && bgr[1] == bgr[2];
      colours.grey = colours.grey && grey;
      colours.white = colours.white && grey && bgr[0] == 255;
      colours.transparent = colours.transparent || (channels == 4 && bgr[3] != 255);
    }
  }
  return colours;
}

/// What the values of a mask of one channel are.
struct Values {
  std::array<std::size_t, 256> counts{};

  bool HasClasses() const {
    return std::any_of(counts.begin() + 1, counts.begin() + protocol::kChangeClasses,
                       [](std::size_t count) { return count > 0; });
  }
};

Values LookAtValues(const cv::Mat& image) {
  Values values;
  for (int row = 0; row < image.rows; ++row) {
    const auto* pixels = image.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column) ++values.counts[pixels[column]];
  }
  return values;
}

bool HasClasses(const cv::Mat& image) {
  if (image.depth() != CV_8U) return false;
  if (image.channels() == 1) return LookAtValues(image).HasClasses();
  return image.channels() >= 3 && !LookAtColours(image).grey;
}

/// Whether a mask means something else beside masks of classes than alone.
bool IsAmbiguous(const cv::Mat& image) {
  if (image.depth() != CV_8U || image.channels() == 2 || HasClasses(image)) return false;
  if (image.channels() == 1) return LookAtValues(image).counts[kLeftOutPixel] > 0;
  return !LookAtColours(image).white;
}

ChangeMask DecodeColours(const cv::Mat& image, const std::string& path, MaskKind known) {
  const Colours colours = LookAtColours(image);
  if (colours.transparent) {
    throw Error("mask '" + path + "' has transparent pixels, accepted is a mask without any");
  }
  if (known == MaskKind::kNotKnown && colours.grey && !colours.white) {
    throw Error("mask '" + path + "' has " + PixelText(8, image.channels()) +
                " that are all black, white or grey, which may mean change in white or the "
                "published colours (white: no change, black: left out), accepted are one channel "
                "(0 and 255, or indices) or colours");
  }
  ChangeMask mask;
  mask.classes = cv::Mat(image.size(), CV_8UC1);
  const int channels = image.channels();
  std::array<std::uint8_t, 3> last{255, 255, 255};
  std::optional<std::uint8_t> meaning = MaskClassOfColour(last);
  bool counts = false;
  for (int row = 0; row < image.rows; ++row) {
    const auto* bgr = image.ptr<std::uint8_t>(row);
    auto* classes = mask.classes.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column, bgr += channels) {
      const std::array<std::uint8_t, 3> rgb{bgr[2], bgr[1], bgr[0]};
      if (rgb != last) {
        last = rgb;
        meaning = MaskClassOfColour(rgb);
      }
      classes[column] = meaning.value_or(kLeftOutPixel);
      counts = counts || classes[column] != kLeftOutPixel;
      mask.unknown_colour_pixels += meaning ? 0 : 1;
    }
  }
  if (static_cast<double>(mask.unknown_colour_pixels) >
          kMaxUnknownColours * static_cast<double>(image.total()) ||
      (known == MaskKind::kNotKnown && !counts)) {
    throw Error("mask '" + path + "' has " + std::to_string(mask.unknown_colour_pixels) + " of " +
                std::to_string(image.total()) + " pixels in colours of no class" +
                (counts ? "" : " and the others are black") +
                ", accepted is up to one in a hundred");
  }
  return mask;
}

ChangeMask DecodeIndices(const cv::Mat& image, const std::string& path, MaskKind known) {
  ChangeMask mask;
  const Values values = LookAtValues(image);
  for (std::size_t value = protocol::kChangeClasses; value < kLeftOutPixel; ++value) {
    if (values.counts[value] == 0) continue;
    throw Error("mask '" + path + "' has the value " + std::to_string(value) +
                ", accepted are 0 to 9 and 255 (classes), or 0 and 255 (change or not)");
  }
  mask.classes = image.clone();
  if (values.counts[kLeftOutPixel] > 0 && !values.HasClasses() && known == MaskKind::kNotKnown) {
    mask.with_classes = false;
    mask.classes.setTo(1, image == kLeftOutPixel);
  }
  return mask;
}

const std::uint8_t* BytesOf(const std::string& bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());
}

/// `path` is for messages.
cv::Mat DecodePicture(const std::string& bytes, const std::string& path,
                      imaging::DecodeConfig::Pixels pixels) {
  try {
    return imaging::DecodeImage(BytesOf(bytes), bytes.size(), kMaxPicturePixels, {pixels, true});
  } catch (const Error& error) {
    throw Error("picture '" + path + "': " + error.what());
  }
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
    AddFlatPairs(folder, pairs);
  } else if (IsSequenceOfPairs(folder)) {
    AddSequencePairs(folder, "", pairs);
  } else if (fs::is_directory(folder / "raw", ignored)) {
    AddPairsOfSequences(folder / "raw", pairs);
  } else {
    AddPairsOfSequences(folder, pairs);
    if (pairs.empty()) AddVisitPairs(folder, pairs);
  }
  if (pairs.empty() || pairs.size() > kMaxPairs) {
    throw Error("folder '" + directory + "' has " + std::to_string(pairs.size()) +
                " pairs, accepted are 1 to " + std::to_string(kMaxPairs) +
                " as raw/NNN/RGB/1_II.png, 2_II.png and raw/NNN/GT/gtII.png, as t0/, t1/ and "
                "mask/, or as NAME/t0.jpg, NAME/t1.jpg and NAME/mask.png");
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const auto& a, const auto& b) { return NaturalLess(a.name, b.name); });
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
  const fs::path common = CommonFolderOfPairs(folders);
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

cv::Mat ReadPicture(const std::string& path, imaging::DecodeConfig::Pixels pixels) {
  return DecodePicture(ReadFile(path, kMaxPictureBytes), path, pixels);
}

ChangeMask DecodeChangeMask(const cv::Mat& image, const std::string& path, MaskKind known) {
  if (image.depth() != CV_8U || (image.channels() != 1 && image.channels() < 3)) {
    throw Error("mask '" + path + "' has " +
                PixelText(static_cast<int>(8 * image.elemSize1()), image.channels()) +
                ", accepted are 8 bits and one channel, or colour");
  }
  return image.channels() == 1 ? DecodeIndices(image, path, known)
                               : DecodeColours(image, path, known);
}

namespace {

/// A mask that a JPEG's losses have not made another: two values that lie far apart.
cv::Mat DecodeLossy(const cv::Mat& image, const std::string& path) {
  constexpr int kDark = 40;
  constexpr int kBright = 215;
  cv::Mat bright;
  if (image.type() == CV_8UC1) bright = image >= kBright;
  if (bright.empty() || cv::countNonZero(bright) == 0 ||
      cv::countNonZero((image > kDark) & (image < kBright)) > 0) {
    throw Error("mask '" + path +
                "' is a JPEG, which has changed the values that were drawn, accepted is a PNG, or "
                "one channel of black and white");
  }
  return bright;
}

cv::Mat ReadMask(const std::string& path) {
  const std::string bytes = ReadFile(path, kMaxPictureBytes);
  const cv::Mat image = DecodePicture(bytes, path, imaging::DecodeConfig::Pixels::kAsStored);
  const auto header = imaging::ReadImageHeader(BytesOf(bytes), bytes.size());
  return header->format == imaging::ImageHeader::Format::kJpeg ? DecodeLossy(image, path) : image;
}

ChangeMask ReadChangeMask(const std::string& path, MaskFolder& masks) {
  const cv::Mat image = ReadMask(path);
  const bool classes = IsAmbiguous(image) && masks.HasClasses();
  return DecodeChangeMask(image, path, classes ? MaskKind::kClasses : MaskKind::kNotKnown);
}

}  // namespace

MaskFolder MaskFolder::OfChangeOrNot() {
  MaskFolder folder("");
  folder.has_classes_ = false;
  return folder;
}

bool MaskFolder::HasClasses() {
  if (!has_classes_) {
    const PictureFolder masks(path_, PictureNames::kNamed);
    has_classes_ =
        std::any_of(masks.paths().begin(), masks.paths().end(), [](const std::string& mask) {
          return change::HasClasses(ReadMask(mask));  // The values that a JPEG's losses hide.
        });
  }
  return *has_classes_;
}

ChangePair LoadChangePair(const ChangePairFiles& files) {
  ChangePair pair;
  pair.before = ReadPicture(files.before, imaging::DecodeConfig::Pixels::kColour);
  pair.after = ReadPicture(files.after, imaging::DecodeConfig::Pixels::kColour);
  MaskFolder masks(fs::path(files.truth).parent_path().string());
  ChangeMask mask = ReadChangeMask(files.truth, files.masks ? *files.masks : masks);
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
  if (!files.ignored.empty()) {
    const cv::Mat ignored = ReadPicture(files.ignored, imaging::DecodeConfig::Pixels::kAsStored);
    check(ignored, files.ignored);
    if (ignored.type() != CV_8UC1) {
      throw Error("mask '" + files.ignored + "' has " +
                  PixelText(static_cast<int>(8 * ignored.elemSize1()), ignored.channels()) +
                  ", accepted are 8 bits and one channel");
    }
    pair.truth.setTo(int{kLeftOutPixel}, ignored > 0);
  }
  if (!files.homography.empty()) pair.after_from_before = ReadPairHomography(files.homography);
  if (files.direction.empty()) return pair;
  pair.direction = ReadPicture(files.direction, imaging::DecodeConfig::Pixels::kAsStored);
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
