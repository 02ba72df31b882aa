#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "common/picture_folder.h"

namespace livemap::datasets {

/// The label files of a folder (.txt in any spelling) by their names without extension; none where
/// there is no such folder. classes.txt is no label file unless a picture has that name. Throws
/// Error for two files of one name, and for what would be passed over: a file whose name is that of
/// one of `pictures` but for leading zeros, a file that belongs to no picture, and a folder of
/// label files where the pictures have no such folder.
std::map<std::string, std::filesystem::path> LabelFilesIn(const std::filesystem::path& folder,
                                                          const PictureFolder& pictures);

}  // namespace livemap::datasets
