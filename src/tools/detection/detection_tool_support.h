#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::tools {

/// "a,b" to its names; none from "". Throws Error naming `flag` on an empty one.
std::vector<std::string> SplitNames(const std::string& flag, const std::string& text);
std::string JoinNames(const std::vector<std::string>& names);

/// A JPEG or PNG file as BGR, 8 bit; throws Error naming the file. At most 100 megapixels.
cv::Mat ReadImage(const std::string& path);
/// The same of a file's bytes; `name` names it in errors.
cv::Mat DecodePhoto(const std::uint8_t* bytes, std::size_t size, const std::string& name);

}  // namespace livemap::tools
