#include "tools/detection/detection_tool_support.h"

#include <opencv2/imgproc.hpp>
#include <sstream>

#include "common/error.h"
#include "imaging/decode.h"

namespace livemap::tools {

std::vector<std::string> SplitNames(const std::string& flag, const std::string& text) {
  std::vector<std::string> names;
  if (text.empty()) return names;
  std::istringstream stream(text + ",");
  for (std::string name; std::getline(stream, name, ',');) {
    if (name.empty()) {
      throw Error("option " + flag + " is '" + text + "', accepted are names, like pothole,deer");
    }
    names.push_back(name);
  }
  return names;
}

std::string JoinNames(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

cv::Mat ReadImage(const std::string& path) {
  constexpr std::size_t kMaxBytes = std::size_t{64} * 1024 * 1024;
  const std::string bytes = ReadFile(path, kMaxBytes);
  return DecodePhoto(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), path);
}

cv::Mat DecodePhoto(const std::uint8_t* bytes, std::size_t size, const std::string& name) {
  constexpr std::int64_t kMaxPixels = 100'000'000;
  try {
    cv::Mat image = imaging::DecodeImage(bytes, size, kMaxPixels);
    if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
    return image;
  } catch (const Error& error) {
    throw Error("image '" + name + "': " + error.what());
  }
}

}  // namespace livemap::tools
