#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap {

/// "a,b" to its names; none from "". Throws Error naming `flag` on an empty one.
std::vector<std::string> SplitNames(const std::string& flag, const std::string& text);
std::string JoinNames(const std::vector<std::string>& names);

/// models/hazards-first.yaml: of the installed package (share/livemap beside this program's
/// lib/livemap), else of the source tree that this program was built from.
std::string DefaultModelPath();

/// A JPEG or PNG file as BGR, 8 bit; throws Error naming the file. At most 100 megapixels.
cv::Mat ReadImage(const std::string& path);

}  // namespace livemap
