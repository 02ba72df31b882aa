#include <cstdint>
#include <cstdio>
#include <limits>

#include "common/error.h"
#include "datasets/sequences.h"
#include "tools/bags/drive_bag.h"
#include "tools/bags/sequence_bag.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"

namespace livemap::tools {
namespace {

int BagFromKitti(int argc, char** argv) {
  CommandLine line(
      "livemap_bag_from_kitti DIR OUT.bag [flags]",
      "Makes a bag of a KITTI odometry folder: images/ (or image_0, image_2), calib.txt,\n"
      "poses.txt and, where there are such, times.txt and the right camera's image_1 (image_3).",
      2,
      {{"rate-hz", "HZ", "frames per second without times.txt (10)"},
       {"start-time", "ISO8601", "stamp of time zero, UTC (2026-01-01T12:00:00Z)"}});
  if (!line.Parse(argc, argv)) return 0;
  CheckOutputFile("OUT.bag", line.Positional(1), {line.Positional(0)});
  const datasets::Sequence sequence =
      datasets::ReadKittiSequence(line.Positional(0), line.Number("rate-hz", 10, 0.1, 1000));
  SayNotes("livemap_bag_from_kitti", sequence.notes);
  const ros::Time start = ReadStartTime(line);
  // What a duration of ROS can hold; its times go on until 2106.
  if (start.sec > static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::max())) {
    throw Error("--start-time is '" + line.Text("start-time", "") +
                "', accepted is a time before 2038-01-19T03:14:08Z");
  }
  WriteSequenceBag(sequence, line.Positional(1), start - ros::Time(0));
  std::printf("%s: %zu frames, %zu poses\n", line.Positional(1).c_str(), sequence.frames.size(),
              sequence.poses.size());
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_bag_from_kitti", argc, argv,
                                    livemap::tools::BagFromKitti);
}
