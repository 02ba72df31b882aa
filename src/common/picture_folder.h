#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace livemap {

/// Whether `a` stands before `b` when runs of digits are read as numbers: "img-9" before "img-10".
/// Names that differ by leading zeros alone are in the order of their bytes, so that every two
/// names have an order.
bool NaturalLess(std::string_view a, std::string_view b);

/// The name with each run of digits without its leading zeros: "gt_007" and "gt_7" are "gt_7".
std::string WithoutLeadingZeros(std::string_view name);

/// The whole number that a name's last run of digits says: 12 of "frame_0012"; none where there
/// are no digits or more than 18 in a row.
std::optional<std::uint64_t> NumberOf(std::string_view name);

/// A file's name without folder and extension.
std::string StemOf(const std::string& path);

/// The extension of a path in lower case, with its dot: ".jpg" of "A/7.JPG"; empty where it has
/// none.
std::string LowerExtension(const std::string& path);

/// Whether a name ends as those of JPEG and PNG files do, in any spelling: .jpg, .JPEG, .jpe,
/// .jfif, .Png.
bool HasPictureExtension(const std::string& path);

/// What the names of a folder's pictures are.
enum class PictureNames {
  kNumbered,  ///< A sequence: "7.png" and "007.jpg" would be the same picture.
  kNamed,     ///< A set: each name is a picture's own, "7.png" and "007.png" are two.
};

/// The JPEG and PNG files of a folder, for every reader of folders: none is passed over and none is
/// guessed. Hidden files and files of other kinds do not count.
class PictureFolder {
 public:
  /// Throws Error naming the folder when it cannot be read; naming the file when it is a picture of
  /// a kind that is not read (BMP, TIFF, WebP and so on) or a link that leads nowhere; and naming
  /// both of two files that have one name but for the extension or, with kNumbered, but for leading
  /// zeros.
  PictureFolder(const std::string& directory, PictureNames names);

  /// Paths in natural order; empty where the folder holds no picture.
  const std::vector<std::string>& paths() const& { return paths_; }
  std::vector<std::string> paths() && { return std::move(paths_); }

  /// The picture of that name, without extension: the one that has it letter by letter, else the
  /// one that has it but for leading zeros. None without such a picture. Throws Error naming two
  /// that have it but for leading zeros.
  std::optional<std::string> Find(const std::string& stem) const;

 private:
  std::string directory_;
  std::vector<std::string> paths_;
  std::map<std::string, std::string> by_stem_;
  std::multimap<std::string, std::string> by_number_;  ///< By WithoutLeadingZeros.
};

}  // namespace livemap
