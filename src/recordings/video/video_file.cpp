#include "recordings/video/video_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <filesystem>

#include "common/error.h"
#include "imaging/orientation.h"
#include "imaging/video_orientation.h"

namespace livemap::recordings {
namespace {

constexpr int kMaxSide = 16384;
/// FFmpeg's names of what recorders, phones and action cameras write.
constexpr char kContainers[] = "mov,matroska,avi,mpegts,mpeg,asf,flv";
constexpr AVRational kNanosecond{1, 1'000'000'000};
constexpr AVRational kMicrosecond{1, AV_TIME_BASE};  // FFmpeg's own unit.

std::string ReasonOf(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

}  // namespace

struct VideoFile::Decoder {
  struct CloseFormat {
    void operator()(AVFormatContext* it) const { avformat_close_input(&it); }
  };
  struct FreeCodec {
    void operator()(AVCodecContext* it) const { avcodec_free_context(&it); }
  };
  struct FreeFrame {
    void operator()(AVFrame* it) const { av_frame_free(&it); }
  };
  struct FreePacket {
    void operator()(AVPacket* it) const { av_packet_free(&it); }
  };
  struct FreeScaler {
    void operator()(SwsContext* it) const { sws_freeContext(it); }
  };

  std::unique_ptr<AVFormatContext, CloseFormat> format;
  std::unique_ptr<AVCodecContext, FreeCodec> codec;
  std::unique_ptr<AVFrame, FreeFrame> frame{av_frame_alloc()};
  std::unique_ptr<AVPacket, FreePacket> packet{av_packet_alloc()};
  std::unique_ptr<SwsContext, FreeScaler> scaler;
  AVStream* stream = nullptr;
  bool draining = false;

  void Open(const std::string& path);
  /// The next decoded frame is in `frame`; false at the end. `damaged` counts what is none.
  bool Decode(std::size_t& damaged);
  /// Feeds one packet; false at the end of the file.
  bool Feed(std::size_t& damaged);
  cv::Mat Convert(cv::Size size, bool grey);
};

void VideoFile::Decoder::Open(const std::string& path) {
  // FFmpeg's own words go to standard error; what matters is thrown.
  av_log_set_level(AV_LOG_QUIET);
  AVFormatContext* opened = nullptr;
  // Recorders' containers alone: a play list would have other files read, or the network.
  AVDictionary* options = nullptr;
  av_dict_set(&options, "format_whitelist", kContainers, 0);
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  const int code = avformat_open_input(&opened, ("file:" + path).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (code < 0) {
    throw Error("'" + path + "' is no whole video file: " + ReasonOf(code));
  }
  format.reset(opened);
  if (avformat_find_stream_info(opened, nullptr) < 0) {
    throw Error("'" + path + "' is no whole video file");
  }
  const AVCodec* decoder = nullptr;
  const int index = av_find_best_stream(opened, AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
  if (index < 0 || decoder == nullptr) {
    throw Error("'" + path + "' has no video that can be decoded");
  }
  stream = opened->streams[index];
  codec.reset(avcodec_alloc_context3(decoder));
  if (!codec || avcodec_parameters_to_context(codec.get(), stream->codecpar) < 0 ||
      avcodec_open2(codec.get(), decoder, nullptr) < 0) {
    throw Error("the video of '" + path + "' cannot be decoded");
  }
  if (codec->width < 16 || codec->height < 16 || codec->width > kMaxSide ||
      codec->height > kMaxSide) {
    throw Error("the video '" + path + "' has frames of " + std::to_string(codec->width) + "x" +
                std::to_string(codec->height) + " pixels, accepted are 16 to " +
                std::to_string(kMaxSide) + " a side");
  }
}

bool VideoFile::Decoder::Feed(std::size_t& damaged) {
  while (av_read_frame(format.get(), packet.get()) >= 0) {
    const bool ours = packet->stream_index == stream->index;
    const int sent = ours ? avcodec_send_packet(codec.get(), packet.get()) : 0;
    av_packet_unref(packet.get());
    if (!ours) continue;
    if (sent >= 0) return true;
    ++damaged;
  }
  return false;
}

bool VideoFile::Decoder::Decode(std::size_t& damaged) {
  for (;;) {
    const int received = avcodec_receive_frame(codec.get(), frame.get());
    if (received >= 0) return true;
    if (received == AVERROR_EOF) return false;
    if (received != AVERROR(EAGAIN)) {
      // A frame that cannot be decoded; the decoder goes on with the next packet.
      ++damaged;
    }
    if (draining && received != AVERROR(EAGAIN)) continue;
    if (draining) return false;
    if (!Feed(damaged)) {
      draining = true;
      avcodec_send_packet(codec.get(), nullptr);
    }
  }
}

cv::Mat VideoFile::Decoder::Convert(cv::Size size, bool grey) {
  const AVPixelFormat target = grey ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_BGR24;
  scaler.reset(sws_getCachedContext(
      scaler.release(), frame->width, frame->height, static_cast<AVPixelFormat>(frame->format),
      size.width, size.height, target, SWS_AREA | SWS_ACCURATE_RND, nullptr, nullptr, nullptr));
  if (!scaler) throw Error("a frame cannot be converted: its pixels are of no known format");
  cv::Mat image(size, grey ? CV_8UC1 : CV_8UC3);
  const std::array<std::uint8_t*, 4> planes = {image.data, nullptr, nullptr, nullptr};
  const std::array<int, 4> strides = {static_cast<int>(image.step), 0, 0, 0};
  sws_scale(scaler.get(), frame->data, frame->linesize, 0, frame->height, planes.data(),
            strides.data());
  return image;
}

VideoFile::VideoFile(const std::string& path, VideoOutput output)
    : path_(path), output_(output), decoder_(std::make_unique<Decoder>()) {
  if (!std::filesystem::is_regular_file(path)) {
    throw Error("the video file '" + path + "' does not exist");
  }
  decoder_->Open(path);
  orientation_ = imaging::ReadVideoOrientation(path);
}

VideoFile::~VideoFile() = default;

std::optional<std::int64_t> VideoFile::Skip() {
  while (decoder_->Decode(left_out_)) {
    const AVFrame& frame = *decoder_->frame;
    if (frame.best_effort_timestamp == AV_NOPTS_VALUE) {
      throw Error("frame " + std::to_string(frames_ + 1) + " of '" + path_ + "' has no time");
    }
    if (!first_time_) first_time_ = frame.best_effort_timestamp;
    const std::int64_t time_ns = av_rescale_q(frame.best_effort_timestamp - *first_time_,
                                              decoder_->stream->time_base, kNanosecond);
    ++frames_;
    if (time_ns <= last_time_ns_) {
      ++left_out_;
      continue;
    }
    last_time_ns_ = time_ns;
    return time_ns;
  }
  return std::nullopt;
}

cv::Mat VideoFile::Skipped() {
  const AVFrame& frame = *decoder_->frame;
  cv::Size stored(frame.width, frame.height);
  // The width of the upright frame is the height of one that lies.
  const int upright_width = imaging::SwapsSides(orientation_) ? stored.height : stored.width;
  if (output_.max_width > 0 && upright_width > output_.max_width) {
    const double scale = static_cast<double>(output_.max_width) / upright_width;
    stored = cv::Size(std::max(1, cvRound(stored.width * scale)),
                      std::max(1, cvRound(stored.height * scale)));
  }
  const cv::Mat image = decoder_->Convert(stored, output_.grey);
  return orientation_ == imaging::kUpright ? image : imaging::Upright(image, orientation_);
}

std::optional<VideoFrame> VideoFile::Next() {
  const std::optional<std::int64_t> time_ns = Skip();
  if (!time_ns) return std::nullopt;
  return VideoFrame{*time_ns, Skipped()};
}

cv::Size VideoFile::size() const {
  const cv::Size stored(decoder_->codec->width, decoder_->codec->height);
  return imaging::SwapsSides(orientation_) ? cv::Size(stored.height, stored.width) : stored;
}

std::int64_t VideoFile::duration_ns() const {
  const AVStream& stream = *decoder_->stream;
  if (stream.duration != AV_NOPTS_VALUE && stream.duration > 0) {
    return av_rescale_q(stream.duration, stream.time_base, kNanosecond);
  }
  const std::int64_t whole = decoder_->format->duration;
  return whole == AV_NOPTS_VALUE || whole < 0 ? 0 : av_rescale_q(whole, kMicrosecond, kNanosecond);
}

std::optional<std::int64_t> VideoFile::creation_ns() const {
  for (const AVDictionary* metadata : {decoder_->format->metadata, decoder_->stream->metadata}) {
    const AVDictionaryEntry* const entry = av_dict_get(metadata, "creation_time", nullptr, 0);
    const std::optional<TimeText> time = entry ? ParseTimeText(entry->value) : std::nullopt;
    if (time) return time->stamp_ns;
  }
  return std::nullopt;
}

}  // namespace livemap::recordings
