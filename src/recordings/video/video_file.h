#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "recordings/time_text.h"

namespace livemap::recordings {

/// How frames are handed out.
struct VideoOutput {
  int max_width = 0;  ///< Of the upright frame, pixels; wider ones are scaled down; 0: as they are.
  bool grey = false;  ///< CV_8UC1 instead of CV_8UC3 (BGR).
};

/// One frame of a video file, upright.
struct VideoFrame {
  std::int64_t time_ns = 0;  ///< Since the file's first frame, as the file states it.
  cv::Mat image;             ///< The caller may keep it.
};

/// Reads one video file by FFmpeg's libraries: the times are those that the file states for each
/// frame, whatever its rate, and frames stand upright as the file's rotation has it. Not
/// thread-safe.
class VideoFile {
 public:
  /// Throws Error naming the file: it is none, is cut off (an MP4 without its index), has no video,
  /// or frames of more than 16384 pixels a side.
  VideoFile(const std::string& path, VideoOutput output);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// The next frame whose time is later than that of the frame before; none at the end. Frames that
  /// cannot be decoded are passed over and counted. Throws Error naming the file and the frame for
  /// one without a time.
  std::optional<VideoFrame> Next();
  /// Passes over a frame: as Next, without the work of making an image of it. Its time; none at the
  /// end.
  std::optional<std::int64_t> Skip();
  /// The image of the frame that Skip has passed last.
  cv::Mat Skipped();

  const std::string& path() const { return path_; }
  /// Of the upright frame before it is scaled down.
  cv::Size size() const;
  /// From the first frame to the end of the last, by the file's header.
  std::int64_t duration_ns() const;
  /// What the file states as the time when it was made (`creation_time`), where it is a time after
  /// 1980. By the container it is UTC; many recorders write their local time there.
  std::optional<std::int64_t> creation_ns() const;
  /// Packets and frames that could not be decoded or repeat a time, so far.
  std::size_t left_out() const { return left_out_; }

 private:
  struct Decoder;

  const std::string path_;
  const VideoOutput output_;
  std::unique_ptr<Decoder> decoder_;
  int orientation_;
  std::size_t left_out_ = 0;
  std::size_t frames_ = 0;
  std::optional<std::int64_t> first_time_;
  std::int64_t last_time_ns_ = -1;
};

}  // namespace livemap::recordings
