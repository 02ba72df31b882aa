#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "imaging/decode.h"

namespace livemap::change {

/// The masks of one folder, which are all of one kind: what one says tells how to read another.
class MaskFolder {
 public:
  explicit MaskFolder(std::string path) : path_(std::move(path)) {}
  /// One whose masks say change or not, and nothing of classes: none is looked at.
  static MaskFolder OfChangeOrNot();

  /// Whether a mask has classes: a value from 1 to 9 in one channel, or a colour that is no grey.
  /// Looks at the files once, until one has; throws Error naming one that cannot be read. Not
  /// thread-safe.
  bool HasClasses();

 private:
  std::string path_;
  std::optional<bool> has_classes_;
};

/// The files of one pair.
struct ChangePairFiles {
  std::string name;    ///< Without extension, e.g. "000/07" or "1_00_0".
  std::string before;  ///< Path of the earlier picture.
  std::string after;   ///< Path of the later picture, whose view the mask has.
  std::string truth;   ///< Path of the mask.
  /// Path of the mask that says what appeared and what vanished; empty: the data set has none.
  std::string direction;
  std::shared_ptr<MaskFolder> masks{};  ///< Of the folder of `truth`; null: looked at anew.
  std::string ignored{};     ///< Path of a mask whose pixels above 0 are left out; empty: none.
  std::string homography{};  ///< Path of the homography from before to after; empty: none.
};

/// Finds the pairs of a data set, sorted by name:
/// - `raw/NNN/RGB/1_II.png`, `2_II.png`, `raw/NNN/GT/gtII.png`, as VL-CMU-CD and `livemap simulate
///   --change` have them; `directory` may also be the folder `raw`, or one of the NNN;
/// - `t0/NAME`, `t1/NAME`, `mask/NAME`, as it is passed on for two-class work (jpg or png);
/// - `NAME/t0`, `NAME/t1`, `NAME/mask` (0 and 255, in the view of t0), perhaps `NAME/ignore` and
///   `NAME/H_t1_to_t0.txt` (nine numbers, row by row), as pairs of two visits are passed on. t1 is
///   the picture that is warped, and so counts as the earlier one.
/// Numbers are in number order; a picture belongs to a mask by its number, however many leading
/// zeros each has, and extensions may be spelled in any way (PictureFolder).
/// Where a file `raw/NNN/GT_direction/gtII.png` is, as the simulator writes it, it comes along.
/// Other files beside them are ignored; a mask without its two pictures is an Error. Throws Error
/// naming the folder and what is accepted when it is neither or holds no pair.
std::vector<ChangePairFiles> FindChangePairs(const std::string& directory);
/// Of several data sets: each pair's name begins with the way to its data set from the folder that
/// holds them all. Throws Error as above, and when one is named twice.
std::vector<ChangePairFiles> FindChangePairs(const std::vector<std::string>& directories);

/// One pair in memory; all images have one size.
struct ChangePair {
  cv::Mat before;     ///< CV_8UC3, BGR.
  cv::Mat after;      ///< CV_8UC3, BGR.
  cv::Mat truth;      ///< CV_8UC1: ChangeClass, or kLeftOutPixel.
  cv::Mat direction;  ///< CV_8UC1: 0, kAppearedPixel, kVanishedPixel; empty without its file.
  /// False: the mask knows change and no change only, 1 and 0.
  bool with_classes = true;
  /// Pixel of `before` to pixel of `after`, where the data set says it.
  std::optional<cv::Matx33d> after_from_before{};
  /// Pixels of the mask whose colour is none of the published ones; they are left out.
  std::size_t unknown_colour_pixels = 0;
};

/// Reads a pair. A mask that says nothing of classes, of 0 and 255 alone or of grey in three
/// channels, is one of classes where another mask of its folder has some. Throws Error naming the
/// path: missing, above 64 MiB or 64 megapixels, corrupt, of another size than the others, a mask
/// that DecodeChangeMask refuses or that a JPEG's losses have changed, or one of direction with
/// other values, or a homography that is not nine finite numbers.
ChangePair LoadChangePair(const ChangePairFiles& files);

/// What a mask file's pixels mean.
struct ChangeMask {
  cv::Mat classes;  ///< CV_8UC1: ChangeClass, or kLeftOutPixel.
  bool with_classes = true;
  std::size_t unknown_colour_pixels = 0;
};

/// What is known of a mask from others beside it.
enum class MaskKind {
  kNotKnown,
  kClasses,  ///< Others have classes: in colour white is no change, in one channel 255 is left out.
};

/// `image` as decoded unchanged, 8 bit. One channel: indices of classes (0 to 9, 255 left out), or
/// 0 and 255 alone, change or not unless classes are known (a mask without 255 and without values
/// above 9 is one of indices). Three or four channels: the published colours, white no change,
/// black left out, and the colour of "miscellaneous", which the thesis (4.4.1) counts as rubbish.
/// Colours that are none of these are left out and counted. Throws Error naming `path` for more
/// than a hundredth of them, for transparent pixels, and, unless classes are known, for a mask in
/// colour that has shades of grey alone and is not all white: it may mean the opposite.
ChangeMask DecodeChangeMask(const cv::Mat& image, const std::string& path,
                            MaskKind known = MaskKind::kNotKnown);

/// Reads and decodes a JPEG or PNG, upright. Throws Error naming the path.
cv::Mat ReadPicture(const std::string& path, imaging::DecodeConfig::Pixels pixels);

}  // namespace livemap::change
