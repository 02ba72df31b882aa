#include "tools/bags/recording_flags.h"

#include <algorithm>

#include "common/error.h"
#include "recordings/lens.h"
#include "recordings/positions/gpx_track.h"
#include "recordings/positions/nmea_log.h"
#include "recordings/positions/position_table.h"
#include "recordings/time_text.h"
#include "tools/bags/exiftool.h"

namespace livemap::tools {
namespace {

/// What exiftool prints of every position within a video, and the names that ParsePositionTable
/// knows it by.
constexpr char kEmbeddedHeader[] = "time\tlatitude\tlongitude\tspeed_kmh\tcourse\n";
constexpr char kEmbeddedFormat[] =
    "$GPSDateTime\t$GPSLatitude\t$GPSLongitude\t$GPSSpeed\t$GPSTrack";

std::string LensNames() {
  std::string names;
  for (const recordings::Lens& lens : recordings::LensPresets()) {
    names += (names.empty() ? "" : ", ") + lens.name;
  }
  return names;
}

/// exiftool writes "-" for what a position does not state.
std::string WithoutDashes(const std::string& line) {
  std::string fields;
  std::size_t begin = 0;
  while (begin <= line.size()) {
    const std::size_t end = std::min(line.find('\t', begin), line.size());
    const std::string field = line.substr(begin, end - begin);
    fields += (begin == 0 ? "" : "\t") + (field == "-" ? "" : field);
    begin = end + 1;
  }
  return fields;
}

}  // namespace

std::vector<Flag> RecordingFlags() {
  return {
      {"gpx", "FILE", "the receiver's track, GPX 1.0 or 1.1"},
      {"nmea", "FILE", "the receiver's log, NMEA 0183"},
      {"csv", "FILE", "a table of positions: time,latitude,longitude and more"},
      {"time-zone", "+HH:MM", "of times that state no zone (none: such times are refused)"},
      {"camera", "FILE.yaml", "calibration and mounting, as config/cameras/*.yaml"},
      {"fov", "DEG", "instead: an ideal lens with this field of view across the longer side"},
      {"lens", "NAME", "instead: " + LensNames()},
      {"camera-height-m", "M", "camera above the road (1.3, or --camera's)"},
      {"camera-pitch-deg", "DEG", "how far the camera looks down (0, or --camera's)"},
      {"camera-forward-m", "M", "camera ahead of the receiver (0, or --camera's)"},
      {"fix-sigma-m", "M", "of positions that state no accuracy, per axis (3)"},
  };
}

std::optional<int> ReadTimeZone(const CommandLine& line, const std::string& flag) {
  if (!line.Has(flag)) return std::nullopt;
  const std::string text = line.Text(flag, "");
  const std::optional<int> zone_s = recordings::ParseZone(text);
  if (!zone_s) {
    throw Error("--" + flag + " is '" + text + "', accepted is a zone like +02:00 or Z");
  }
  return zone_s;
}

std::optional<recordings::RecordedTrack> ReadTrackFlags(const CommandLine& line) {
  std::optional<recordings::RecordedTrack> track;
  for (const char* flag : {"gpx", "nmea", "csv"}) {
    if (!line.Has(flag)) continue;
    if (track) throw Error("accepted is one of --gpx, --nmea and --csv");
    const std::string path = line.Text(flag, "");
    if (flag == std::string("gpx")) {
      track = recordings::ReadGpx(path);
    } else if (flag == std::string("nmea")) {
      track = recordings::ReadNmea(path);
    } else {
      track = recordings::ReadPositionTable(path, ReadTimeZone(line, "time-zone"));
    }
  }
  return track;
}

recordings::RecordedTrack ReadEmbeddedTrack(const std::vector<std::string>& videos,
                                            std::optional<int> zone_s) {
  std::vector<std::string> arguments = {"-ee", "-n", "-f", "-q", "-p", kEmbeddedFormat, "--"};
  arguments.insert(arguments.end(), videos.begin(), videos.end());
  const std::string answer = AskExiftool(arguments);
  std::string table = kEmbeddedHeader;
  std::size_t begin = 0;
  while (begin < answer.size()) {
    const std::size_t end = std::min(answer.find('\n', begin), answer.size());
    table += WithoutDashes(answer.substr(begin, end - begin)) + "\n";
    begin = end + 1;
  }
  try {
    return recordings::ParsePositionTable(table, zone_s,
                                          "what exiftool reads of " + videos.front());
  } catch (const Error& error) {
    throw Error(
        "the recording holds no positions of its own, accepted is --gpx, --nmea or --csv "
        "(" +
        std::string(error.what()) + ")");
  }
}

imaging::CameraCalibration ReadCalibrationFlags(const CommandLine& line, int width, int height) {
  const int given = static_cast<int>(line.Has("camera")) + static_cast<int>(line.Has("fov")) +
                    static_cast<int>(line.Has("lens"));
  if (given != 1) {
    throw Error(
        "the camera must be told by exactly one of --camera FILE.yaml, --fov DEG and "
        "--lens NAME (" +
        LensNames() + ")");
  }
  if (line.Has("camera")) {
    return recordings::CalibrationOf(datasets::ReadCameraFile(line.Text("camera", "")), width,
                                     height);
  }
  if (line.Has("lens")) {
    return recordings::CalibrationOf(recordings::FindLens(line.Text("lens", "")), width, height);
  }
  return recordings::CalibrationOf(recordings::PinholeLens(line.Number("fov", 66, 20, 150)), width,
                                   height);
}

datasets::CameraMounting ReadRecordingMounting(const CommandLine& line) {
  datasets::CameraMounting mounting;
  // The receivers of such recordings are in the camera, or lie beside it.
  mounting.forward_m = 0;
  mounting.height_m = 1.3;
  if (line.Has("camera")) mounting = datasets::ReadCameraFile(line.Text("camera", "")).mounting;
  mounting.forward_m = line.Number("camera-forward-m", mounting.forward_m, -20, 20);
  mounting.height_m = line.Number("camera-height-m", mounting.height_m, 0.1, 10);
  mounting.pitch_deg = line.Number("camera-pitch-deg", mounting.pitch_deg, -30, 89);
  return mounting;
}

}  // namespace livemap::tools
