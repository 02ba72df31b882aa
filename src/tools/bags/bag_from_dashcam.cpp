// livemap_bag_from_dashcam: a recorder's videos and a receiver's track as a drive.

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "common/error.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "recordings/clock/clip_motion.h"
#include "recordings/clock/clock_offset.h"
#include "recordings/video/clip_sequence.h"
#include "recordings/video/video_file.h"
#include "tools/bags/recording_bag.h"
#include "tools/bags/recording_flags.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/progress.h"

namespace livemap::tools {
namespace {

constexpr char kDashcamName[] = "livemap_bag_from_dashcam";
/// Frames of 29.97 Hz are a little late for 10 Hz.
constexpr double kRateSlackS = 0.005;

std::vector<Flag> DashcamFlags() {
  std::vector<Flag> flags = RecordingFlags();
  for (const Flag& flag : std::initializer_list<Flag>{
           {"offset", "S", "to add to the recorder's clock, seconds (estimated)"},
           {"search", "S", "offsets that are tried, to both sides (30)"},
           {"start-time", "TIME", "of the first frame, e.g. 2026-01-31T12:34:56Z (the file's)"},
           {"recorder-zone", "+HH:MM", "of the recorder's clock (UTC)"},
           {"rate", "HZ", "frames per second at most (10)"},
           {"width", "PIXELS", "of the pictures at most (as they are)"},
           {"jpeg-quality", "Q", "of the bag's pictures, 1 to 100 (90)"}}) {
    flags.push_back(flag);
  }
  return flags;
}

/// What was recorded, still by the recorder's clock.
struct Recording {
  std::vector<recordings::Clip> clips;
  cv::Size size;  ///< Of upright frames as the bag has them.

  std::int64_t begin_ns() const { return *clips.front().start_ns; }
  std::int64_t end_ns() const { return *clips.back().start_ns + clips.back().duration_ns; }
};

/// When a file begins by its header, and else by its name; none where neither says.
std::optional<std::int64_t> StartOf(const recordings::VideoFile& video, int zone_s) {
  std::optional<std::int64_t> local_ns = video.creation_ns();
  if (!local_ns) {
    local_ns = recordings::TimeOfFileName(std::filesystem::path(video.path()).filename().string());
  }
  if (!local_ns) return std::nullopt;
  return *local_ns - std::int64_t{zone_s} * 1'000'000'000;
}

recordings::TimeText ReadStartFlag(const CommandLine& line) {
  const std::string text = line.Text("start-time", "");
  const auto time = recordings::ParseTimeText(text);
  if (time) return *time;
  throw Error("--start-time is '" + text + "', accepted is a time like 2026-01-31T12:34:56Z");
}

Recording ReadRecording(const CommandLine& line, const std::vector<std::string>& paths,
                        const recordings::VideoOutput& output) {
  const int zone_s = ReadTimeZone(line, "recorder-zone").value_or(0);
  Recording recording;
  std::string first;
  std::vector<recordings::Clip> clips;
  for (const std::string& path : paths) {
    const recordings::VideoFile video(path, output);
    const cv::Size size = video.size();
    if (!first.empty() && size != recording.size) {
      throw Error("the videos '" + first + "' and '" + path +
                  "' have frames of different sizes, accepted are the pieces of one recording");
    }
    first = path;
    recording.size = size;
    clips.push_back({path, StartOf(video, zone_s), video.duration_ns()});
  }
  std::optional<std::int64_t> shift_ns;
  if (line.Has("start-time")) {
    const recordings::TimeText start = ReadStartFlag(line);
    const std::int64_t start_ns =
        start.has_zone ? start.stamp_ns : start.stamp_ns - std::int64_t{zone_s} * 1'000'000'000;
    if (!clips.front().start_ns) clips.front().start_ns = start_ns;
    shift_ns = start_ns;
  }
  recordings::ClipSequence sequence = recordings::OrderClips(std::move(clips));
  SayNotes(kDashcamName, sequence.notes);
  if (shift_ns) {
    *shift_ns -= *sequence.clips.front().start_ns;
    for (recordings::Clip& clip : sequence.clips) *clip.start_ns += *shift_ns;
  }
  recording.clips = std::move(sequence.clips);
  return recording;
}

/// "'a.mp4' to 'd.mp4', 2026-01-31T12:34:56.000Z to ...", by the recorder's clock.
std::string NamesAndTimes(const Recording& recording) {
  const std::string& first = recording.clips.front().path;
  const std::string& last = recording.clips.back().path;
  return "'" + first + "'" + (last == first ? "" : " to '" + last + "'") + ", " +
         Rfc3339(recording.begin_ns()) + " to " + Rfc3339(recording.end_ns());
}

std::string NamesAndTimes(const std::string& name, const recordings::RecordedTrack& track) {
  return name + ", " + Rfc3339(track.begin_ns()) + " to " + Rfc3339(track.end_ns());
}

/// Where the positions come from, as CommandLine has it.
std::string TrackName(const CommandLine& line) {
  for (const char* flag : {"gpx", "nmea", "csv"}) {
    if (line.Has(flag)) return "'" + line.Text(flag, "") + "'";
  }
  return "within the videos";
}

/// Throws Error where the offset that was given leaves no frame within the track's times.
void CheckOffset(const Recording& recording, const recordings::RecordedTrack& track,
                 double offset_s, const std::string& track_name) {
  const std::int64_t offset_ns = Nanoseconds(offset_s);
  if (recording.begin_ns() + offset_ns <= track.end_ns() &&
      recording.end_ns() + offset_ns >= track.begin_ns()) {
    return;
  }
  std::ostringstream sentence;
  sentence << "--offset " << offset_s << " brings no frame into the track's times: the recording, "
           << NamesAndTimes(recording) << " by its own clock, becomes "
           << Rfc3339(recording.begin_ns() + offset_ns) << " to "
           << Rfc3339(recording.end_ns() + offset_ns) << ", and the track is "
           << NamesAndTimes(track_name, track) << "; accepted is what has to be added, from "
           << std::ceil(Seconds(track.begin_ns() - recording.end_ns())) << " to "
           << std::floor(Seconds(track.end_ns() - recording.begin_ns()))
           << ", and without --offset it is found";
  throw Error(sentence.str());
}

/// Throws Error where recording and track are of other times, with the zone that may be meant.
/// `zone_s` is the recorder's as it was given.
void CheckTimes(const Recording& recording, const recordings::RecordedTrack& track, double reach_s,
                int zone_s, const std::string& track_name) {
  const std::int64_t reach_ns = Nanoseconds(reach_s);
  const auto overlap = [&](std::int64_t shift_ns) {
    return recording.begin_ns() + shift_ns - reach_ns < track.end_ns() &&
           recording.end_ns() + shift_ns + reach_ns > track.begin_ns();
  };
  if (overlap(0)) return;
  std::ostringstream sentence;
  sentence << "the recording, " << NamesAndTimes(recording) << ", and the track, "
           << NamesAndTimes(track_name, track) << ", are of different times";
  constexpr std::int64_t kQuarterS = 900;
  for (std::int64_t quarters = -56; quarters <= 56; ++quarters) {
    if (!overlap((zone_s - quarters * kQuarterS) * 1'000'000'000)) continue;
    char zone[16];
    std::snprintf(zone, sizeof zone, "%c%02d:%02d", quarters < 0 ? '-' : '+',
                  static_cast<int>(std::abs(quarters) / 4),
                  static_cast<int>(std::abs(quarters) % 4 * 15));
    sentence << ": --recorder-zone " << zone << " would bring them together";
    throw Error(sentence.str());
  }
  sentence << ": --start-time says when the recording begins";
  throw Error(sentence.str());
}

/// The offset that is given or found, told on standard output.
double OffsetOf(const CommandLine& line, const Recording& recording,
                const recordings::RecordedTrack& track) {
  recordings::ClockOffsetConfig config;
  config.search_s = line.Number("search", config.search_s, 1, 300);
  if (line.Has("offset")) return line.Number("offset", 0, -86400, 86400);
  Progress progress("clocks, second",
                    static_cast<std::size_t>(Seconds(recording.end_ns() - recording.begin_ns())));
  const auto motions = recordings::MeasureMotion(
      recording.clips, [&](double seconds) { progress.At(static_cast<std::size_t>(seconds)); });
  const recordings::ClockOffsetAnswer answer = recordings::FindClockOffset(motions, track, config);
  if (!answer.offset) {
    throw Error(
        "how far the clocks of recorder and receiver are apart cannot be told: " + answer.reason +
        "; --offset S says what to add to the recorder's times (0: its clock is right)");
  }
  std::printf(
      "clocks: %+.2f s are added to the recorder's times, standard deviation %.2f s "
      "(correlation of turns %.2f, of speeds %.2f)\n",
      answer.offset->seconds, answer.offset->sigma_s, answer.offset->turn_correlation,
      answer.offset->speed_correlation);
  return answer.offset->seconds;
}

/// How frames become the bag's.
struct FrameConfig {
  recordings::VideoOutput output;
  double rate_hz = 10;
  int jpeg_quality = 90;
};

struct FrameCounts {
  std::size_t written = 0;
  std::size_t outside = 0;  ///< Of the track.
  std::size_t left_out = 0;
};

FrameCounts WriteFrames(const Recording& recording, const recordings::RecordedTrack& track,
                        double offset_s, const FrameConfig& config, RecordingBag& bag) {
  FrameCounts counts;
  const double step_s = 1 / config.rate_hz - kRateSlackS;
  std::optional<std::int64_t> last_ns;
  std::vector<std::uint8_t> jpeg;
  Progress progress("frames, second",
                    static_cast<std::size_t>(Seconds(recording.end_ns() - recording.begin_ns())));
  for (const recordings::Clip& clip : recording.clips) {
    recordings::VideoFile video(clip.path, config.output);
    while (const std::optional<std::int64_t> time_ns = video.Skip()) {
      const std::int64_t stamp_ns = *clip.start_ns + *time_ns + Nanoseconds(offset_s);
      if (last_ns && Seconds(stamp_ns - *last_ns) < step_s) continue;
      if (stamp_ns < track.begin_ns() || stamp_ns > track.end_ns()) {
        ++counts.outside;
        continue;
      }
      cv::imencode(".jpg", video.Skipped(), jpeg, {cv::IMWRITE_JPEG_QUALITY, config.jpeg_quality});
      bag.AddFrame(stamp_ns, jpeg);
      last_ns = stamp_ns;
      ++counts.written;
      progress.At(
          static_cast<std::size_t>(Seconds(*clip.start_ns + *time_ns - recording.begin_ns())));
    }
    counts.left_out += video.left_out();
  }
  return counts;
}

void SayCounts(const FrameCounts& counts) {
  if (counts.outside > 0) {
    std::fprintf(stderr,
                 "%s: %zu frames before the track's first position or after its last one, "
                 "left out\n",
                 kDashcamName, counts.outside);
  }
  if (counts.left_out > 0) {
    std::fprintf(stderr, "%s: %zu frames are damaged or repeat a time, left out\n", kDashcamName,
                 counts.left_out);
  }
}

cv::Size SizeInBag(cv::Size size, int max_width) {
  if (max_width == 0 || size.width <= max_width) return size;
  return {max_width, cvRound(static_cast<double>(size.height) * max_width / size.width)};
}

int BagFromDashcam(int argc, char** argv) {
  CommandLine line(
      "livemap_bag_from_dashcam VIDEO... OUT.bag [flags]",
      "Makes a bag of a recorder's videos and a receiver's track. The videos are the pieces of "
      "one\n"
      "recording in any order. Positions are those of --gpx, --nmea or --csv, else those that the\n"
      "videos hold. How far the two clocks are apart is found from stops and turns.",
      CommandLine::kOneOrMore, DashcamFlags());
  if (!line.Parse(argc, argv)) return 0;
  std::vector<std::string> videos = line.Positionals();
  const std::string out = videos.back();
  videos.pop_back();
  if (videos.empty() || std::filesystem::path(out).extension() != ".bag") {
    throw Error("accepted are one or more videos, then the bag to be written, which ends in .bag");
  }
  for (const std::string& video : videos) {
    if (!std::filesystem::is_directory(video)) continue;
    throw Error("VIDEO '" + video +
                "' is a folder, accepted are the video files of one recording by their names");
  }
  std::vector<std::string> inputs = videos;
  for (const char* flag : {"gpx", "nmea", "csv", "camera"}) {
    if (line.Has(flag)) inputs.push_back(line.Text(flag, ""));
  }
  CheckOutputFile("OUT.bag", out, inputs);

  FrameConfig config;
  config.output.max_width = line.Whole("width", 0, 64, 16384);
  config.rate_hz = line.Number("rate", config.rate_hz, 0.1, 1000);
  config.jpeg_quality = line.Whole("jpeg-quality", config.jpeg_quality, 1, 100);
  RecordingSetup setup;
  setup.default_sigma_m = line.Number("fix-sigma-m", setup.default_sigma_m, 0.01, 1000);
  setup.mounting = ReadRecordingMounting(line);
  const Recording recording = ReadRecording(line, videos, config.output);
  const cv::Size size = SizeInBag(recording.size, config.output.max_width);
  setup.calibration = ReadCalibrationFlags(line, size.width, size.height);
  auto track = ReadTrackFlags(line);
  if (!track) track = ReadEmbeddedTrack(videos, ReadTimeZone(line, "time-zone"));
  SayNotes(kDashcamName, track->notes);
  setup.track = *track;
  const std::string track_name = TrackName(line);
  if (line.Has("offset")) {
    CheckOffset(recording, *track, line.Number("offset", 0, -86400, 86400), track_name);
  } else {
    CheckTimes(recording, *track, line.Number("search", 30, 1, 300),
               ReadTimeZone(line, "recorder-zone").value_or(0), track_name);
  }
  const double offset_s = OffsetOf(line, recording, *track);
  RecordingBag bag(out, setup, recording.begin_ns() + Nanoseconds(offset_s));
  const FrameCounts counts = WriteFrames(recording, *track, offset_s, config, bag);
  SayCounts(counts);
  if (counts.written == 0) {
    throw Error("no frame of the recording lies within the track's times");
  }
  bag.Finish();
  std::printf("%s: %zu frames of %dx%d, %.1f s, %zu positions\n", out.c_str(), counts.written,
              size.width, size.height, Seconds(recording.end_ns() - recording.begin_ns()),
              bag.fixes());
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram(livemap::tools::kDashcamName, argc, argv,
                                    livemap::tools::BagFromDashcam);
}
