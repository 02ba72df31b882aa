#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::imaging {

/// One frame of a source that is no ROS topic: either still encoded or decoded already.
struct SourceFrame {
  std::vector<std::uint8_t> encoded;  ///< A whole JPEG or PNG file; empty when `image` is set.
  cv::Mat image;                      ///< CV_8UC1 or CV_8UC3 (BGR).
  std::string name;                   ///< File name or running number, for messages.
  /// How many frames of the source's rate it comes after the one before: above 1 where pictures of
  /// a folder are missing between them.
  int steps = 1;
  /// How long ago a camera took it, by its driver's clock; 0: unknown, or no camera.
  double age_s = 0;
};

/// One frame of a source cannot be read.
class UnreadableFrame : public Error {
 public:
  /// `steps` of the frame: see SourceFrame::steps.
  UnreadableFrame(const std::string& what, int steps) : Error(what), steps_(steps) {}
  int steps() const { return steps_; }

 private:
  int steps_;
};

/// Hands out frames one after the other. Not thread-safe.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// The next frame, waiting for it where it is a live device. None at the end (file, folder) or
  /// while the device gives nothing. Throws UnreadableFrame for one unreadable frame, whose
  /// time passes all the same; the next call goes on.
  virtual std::optional<SourceFrame> Next() = 0;
  /// Back to the first frame. Throws Error when the source cannot be opened again.
  virtual void Rewind() = 0;
  /// Frames per second that the source itself names (a video's header); 0 when it names none.
  virtual double rate_hz() const { return 0; }
};

/// The JPEG and PNG files of `directory` in the order of their names with numbers read as numbers,
/// read one by one. Throws Error when the folder cannot be read or holds no image, and as
/// PictureFolder does. `max_bytes` bounds one file. Where most numbers follow one another in one
/// step, a larger step stands for pictures that are missing (SourceFrame::steps).
std::unique_ptr<FrameSource> OpenFolder(const std::string& directory, std::size_t max_bytes);

/// A video file through cv::VideoCapture, its frames upright as ReadVideoOrientation says. Throws
/// Error when it cannot be opened.
std::unique_ptr<FrameSource> OpenVideo(const std::string& path);

}  // namespace livemap::imaging
