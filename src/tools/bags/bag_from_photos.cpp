// livemap_bag_from_photos: geotagged stills as a drive.

#include <cstdio>
#include <filesystem>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/time.h"
#include "datasets/image_file.h"
#include "recordings/positions/photo_list.h"
#include "tools/bags/exiftool.h"
#include "tools/bags/recording_bag.h"
#include "tools/bags/recording_flags.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/progress.h"

namespace livemap::tools {
namespace {

constexpr char kPhotosName[] = "livemap_bag_from_photos";

recordings::PhotoList ReadPhotos(const std::string& directory, std::optional<int> zone_s) {
  const PictureFolder folder(directory, PictureNames::kNamed);
  if (folder.paths().empty()) {
    throw Error("the folder '" + directory + "' holds no .jpg, .jpeg or .png file");
  }
  std::vector<std::string> arguments = {"-json", "-n", "-q"};
  for (const std::string& tag : recordings::PhotoTags()) arguments.push_back("-" + tag);
  arguments.emplace_back("--");
  arguments.insert(arguments.end(), folder.paths().begin(), folder.paths().end());
  return recordings::ParsePhotoList(AskExiftool(arguments), zone_s, directory);
}

/// The places of the photos themselves, which are their fixes.
recordings::RecordedTrack TrackOf(const recordings::PhotoList& list) {
  recordings::RecordedTrack track;
  for (const recordings::Photo& photo : list.photos) track.positions.push_back(photo.position);
  return track;
}

int BagFromPhotos(int argc, char** argv) {
  CommandLine line(
      "livemap_bag_from_photos DIR OUT.bag [flags]",
      "Makes a bag of a folder of geotagged photos of one camera, in the order of their times.\n"
      "Positions are those of --gpx, --nmea or --csv, else those in the photos.",
      2, RecordingFlags());
  if (!line.Parse(argc, argv)) return 0;
  const std::string &directory = line.Positional(0), &out = line.Positional(1);
  CheckOutputFile("OUT.bag", out, {directory});
  RecordingSetup setup;
  setup.default_sigma_m = line.Number("fix-sigma-m", setup.default_sigma_m, 0.01, 1000);
  setup.mounting = ReadRecordingMounting(line);
  const recordings::PhotoList list = ReadPhotos(directory, ReadTimeZone(line, "time-zone"));
  SayNotes(kPhotosName, list.notes);
  const datasets::ImageFile first = datasets::ReadImageFile(list.photos.front().path, 0, 0);
  const int width = first.header.width, height = first.header.height;
  setup.calibration = ReadCalibrationFlags(line, width, height);
  setup.track = ReadTrackFlags(line).value_or(TrackOf(list));
  SayNotes(kPhotosName, setup.track.notes);

  RecordingBag bag(out, setup, list.photos.front().position.stamp_ns);
  Progress progress("photo", list.photos.size());
  for (std::size_t i = 0; i < list.photos.size(); ++i) {
    const recordings::Photo& photo = list.photos[i];
    bag.AddFrame(photo.position.stamp_ns, datasets::ReadImageFile(photo.path, width, height).bytes);
    progress.At(i + 1);
  }
  bag.Finish();
  const double length_s =
      Seconds(list.photos.back().position.stamp_ns - list.photos.front().position.stamp_ns);
  std::printf("%s: %zu photos, %.1f s, %zu positions\n", out.c_str(), list.photos.size(), length_s,
              bag.fixes());
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram(livemap::tools::kPhotosName, argc, argv,
                                    livemap::tools::BagFromPhotos);
}
