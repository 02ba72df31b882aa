#include "imaging/frame_source.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/videoio.hpp>

#include "common/error.h"
#include "common/picture_folder.h"
#include "imaging/orientation.h"
#include "imaging/video_orientation.h"

namespace livemap::imaging {
namespace {

namespace fs = std::filesystem;

/// SourceFrame::steps of each picture.
std::vector<int> StepsOf(const std::vector<std::string>& paths) {
  constexpr std::uint64_t kMaxSteps = 100000;
  std::vector<int> steps(paths.size(), 1);
  std::vector<std::uint64_t> distances;
  for (std::size_t i = 1; i < paths.size(); ++i) {
    const auto before = NumberOf(StemOf(paths[i - 1]));
    const auto number = NumberOf(StemOf(paths[i]));
    if (!before || !number || *number <= *before) return steps;
    distances.push_back(*number - *before);
  }
  if (distances.empty()) return steps;
  const std::uint64_t step = *std::min_element(distances.begin(), distances.end());
  const auto usual = std::count(distances.begin(), distances.end(), step);
  const bool whole =
      std::all_of(distances.begin(), distances.end(), [step](std::uint64_t distance) {
        return distance % step == 0 && distance / step <= kMaxSteps;
      });
  // Numbers without a usual step, as stamps and places along a road, say nothing of what is
  // missing.
  if (!whole || 2 * static_cast<std::size_t>(usual) <= distances.size()) return steps;
  for (std::size_t i = 1; i < steps.size(); ++i)
    steps[i] = static_cast<int>(distances[i - 1] / step);
  return steps;
}

class FolderFrameSource : public FrameSource {
 public:
  FolderFrameSource(const std::string& directory, std::size_t max_bytes)
      : max_bytes_(max_bytes), paths_(PictureFolder(directory, PictureNames::kNumbered).paths()) {
    if (paths_.empty()) {
      throw Error("the image folder '" + directory + "' holds no .jpg, .jpeg or .png file");
    }
    steps_ = StepsOf(paths_);
  }

  std::optional<SourceFrame> Next() override {
    if (next_ == paths_.size()) return std::nullopt;
    SourceFrame frame;
    frame.steps = steps_[next_];
    const std::string& path = paths_[next_++];
    try {
      const std::string bytes = ReadFile(path, max_bytes_);
      frame.encoded.assign(bytes.begin(), bytes.end());
    } catch (const Error& error) {
      throw UnreadableFrame(error.what(), frame.steps);
    }
    frame.name = fs::path(path).filename().string();
    return frame;
  }

  void Rewind() override { next_ = 0; }

 private:
  const std::size_t max_bytes_;
  const std::vector<std::string> paths_;
  std::vector<int> steps_;
  std::size_t next_ = 0;
};

class VideoFrameSource : public FrameSource {
 public:
  explicit VideoFrameSource(std::string path)
      : path_(std::move(path)), orientation_(ReadVideoOrientation(path_)) {
    VideoFrameSource::Rewind();
    const double rate = capture_.get(cv::CAP_PROP_FPS);
    if (std::isfinite(rate) && rate > 0 && rate <= 1000) rate_hz_ = rate;
  }

  std::optional<SourceFrame> Next() override {
    SourceFrame frame;
    if (!capture_.read(frame.image) || frame.image.empty()) return std::nullopt;
    frame.image = Upright(frame.image, orientation_);
    frame.name = std::to_string(number_++);
    return frame;
  }

  void Rewind() override {
    number_ = 0;
    if (!capture_.open(path_)) throw Error("the video file '" + path_ + "' cannot be opened");
    // Whether OpenCV turns frames, and mirrors them, depends on its release and on FFmpeg's: where
    // the file says how, it is done here.
    capture_.set(cv::CAP_PROP_ORIENTATION_AUTO, orientation_ == kUpright ? 1 : 0);
  }

  double rate_hz() const override { return rate_hz_; }

 private:
  const std::string path_;
  const int orientation_;
  cv::VideoCapture capture_;
  double rate_hz_ = 0;
  std::uint64_t number_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> OpenFolder(const std::string& directory, std::size_t max_bytes) {
  return std::make_unique<FolderFrameSource>(directory, max_bytes);
}

std::unique_ptr<FrameSource> OpenVideo(const std::string& path) {
  if (!fs::is_regular_file(path)) throw Error("the video file '" + path + "' does not exist");
  return std::make_unique<VideoFrameSource>(path);
}

}  // namespace livemap::imaging
