#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::change {

/// The files of one pair.
struct ChangePairFiles {
  std::string name;    ///< Without extension, e.g. "000/07" or "1_00_0".
  std::string before;  ///< Path of the earlier picture.
  std::string after;   ///< Path of the later picture, whose view the mask has.
  std::string truth;   ///< Path of the mask.
  /// Path of the mask that says what appeared and what vanished; empty: the data set has none.
  std::string direction;
};

/// Finds the pairs of a data set, sorted by name:
/// - `raw/NNN/RGB/1_II.png`, `2_II.png`, `raw/NNN/GT/gtII.png`, as VL-CMU-CD and `livemap simulate
///   --change` have them; `directory` may also be the folder `raw`, or one of the NNN;
/// - `t0/NAME`, `t1/NAME`, `mask/NAME`, as it is passed on for two-class work (jpg or png).
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
  /// Pixels of the mask whose colour is none of the published ones; they are left out.
  std::size_t unknown_colour_pixels = 0;
};

/// Reads a pair. Throws Error naming the path: missing, above 64 MiB or 64 megapixels, corrupt, of
/// another size than the others, a mask that DecodeChangeMask refuses, or one of direction with
/// other values.
ChangePair LoadChangePair(const ChangePairFiles& files);

/// What a mask file's pixels mean.
struct ChangeMask {
  cv::Mat classes;  ///< CV_8UC1: ChangeClass, or kLeftOutPixel.
  bool with_classes = true;
  std::size_t unknown_colour_pixels = 0;
};

/// `image` as decoded unchanged, 8 bit. One channel: indices of classes (0 to 9, 255 left out), or
/// 0 and 255 alone, change or not (a mask without 255 and without values above 9 is one of
/// indices). Three or four channels: the published colours, white no change, black left out, and
/// the colour of "miscellaneous", which the thesis (4.4.1) counts as rubbish. Colours that are
/// none of these are left out and counted; more than a hundredth of them is an Error naming `path`.
ChangeMask DecodeChangeMask(const cv::Mat& image, const std::string& path);

/// Reads and decodes an image file after a look at its header; `flags` as cv::imdecode's. Throws
/// Error naming the path.
cv::Mat ReadPicture(const std::string& path, int flags);

}  // namespace livemap::change
