#include "imaging/frame_source.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <opencv2/videoio.hpp>

#include "common/error.h"

namespace livemap::imaging {
namespace {

namespace fs = std::filesystem;

bool HasImageExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png";
}

class FolderSource : public FrameSource {
 public:
  FolderSource(const std::string& directory, std::size_t max_bytes) : max_bytes_(max_bytes) {
    std::error_code error;
    for (fs::directory_iterator entry(directory, error), end; !error && entry != end;
         entry.increment(error)) {
      if (entry->is_regular_file() && HasImageExtension(entry->path())) {
        paths_.push_back(entry->path());
      }
    }
    if (error) throw Error("the image folder '" + directory + "': " + error.message());
    if (paths_.empty()) {
      throw Error("the image folder '" + directory + "' holds no .jpg, .jpeg or .png file");
    }
    std::sort(paths_.begin(), paths_.end());
  }

  std::optional<SourceFrame> Next() override {
    if (next_ == paths_.size()) return std::nullopt;
    const fs::path& path = paths_[next_++];
    const std::string bytes = ReadFile(path.string(), max_bytes_);
    SourceFrame frame;
    frame.encoded.assign(bytes.begin(), bytes.end());
    frame.name = path.filename().string();
    return frame;
  }

  void Rewind() override { next_ = 0; }

 private:
  const std::size_t max_bytes_;
  std::vector<fs::path> paths_;
  std::size_t next_ = 0;
};

class CaptureSource : public FrameSource {
 public:
  /// A device when `device` is not negative, else the file `path`.
  CaptureSource(std::string path, int device) : path_(std::move(path)), device_(device) {
    CaptureSource::Rewind();
    if (device_ < 0) {
      const double rate = capture_.get(cv::CAP_PROP_FPS);
      if (std::isfinite(rate) && rate > 0 && rate <= 1000) rate_hz_ = rate;
    }
  }

  std::optional<SourceFrame> Next() override {
    SourceFrame frame;
    if (!capture_.read(frame.image) || frame.image.empty()) return std::nullopt;
    frame.name = std::to_string(number_++);
    return frame;
  }

  void Rewind() override {
    number_ = 0;
    const bool opened = device_ >= 0 ? capture_.open(device_, cv::CAP_V4L2) : capture_.open(path_);
    if (!opened) {
      throw Error((device_ >= 0 ? "the camera device '" : "the video file '") + path_ +
                  "' cannot be opened");
    }
  }

  double rate_hz() const override { return rate_hz_; }

 private:
  const std::string path_;
  const int device_;
  cv::VideoCapture capture_;
  double rate_hz_ = 0;
  std::uint64_t number_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> OpenFolder(const std::string& directory, std::size_t max_bytes) {
  return std::make_unique<FolderSource>(directory, max_bytes);
}

std::unique_ptr<FrameSource> OpenVideo(const std::string& path) {
  if (!fs::is_regular_file(path)) throw Error("the video file '" + path + "' does not exist");
  return std::make_unique<CaptureSource>(path, -1);
}

std::unique_ptr<FrameSource> OpenDevice(const std::string& device) {
  const std::string prefix = "/dev/video";
  const std::string number =
      device.compare(0, prefix.size(), prefix) == 0 ? device.substr(prefix.size()) : device;
  const bool all_digits = !number.empty() && number.size() <= 3 &&
                          std::all_of(number.begin(), number.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
  if (!all_digits) {
    throw Error("the camera device is '" + device + "', accepted is /dev/videoN or N");
  }
  return std::make_unique<CaptureSource>(device, std::stoi(number));
}

}  // namespace livemap::imaging
