#include <cstdio>

#include "datasets/sequences.h"
#include "tools/bags/sequence_bag.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"

namespace livemap::tools {
namespace {

/// A bag has no time zero: a sequence that begins there is moved by one second.
ros::Duration TumStart(const datasets::Sequence& sequence) {
  bool from_zero = sequence.frames.front().stamp_ns <= 0;
  for (const datasets::StampedPose& pose : sequence.poses)
    from_zero = from_zero || pose.stamp_ns <= 0;
  return ros::Duration(from_zero ? 1 : 0);
}

int BagFromTum(int argc, char** argv) {
  CommandLine line(
      "livemap_bag_from_tum DIR OUT.bag",
      "Makes a bag of a TUM RGB-D folder: associations.txt (or rgb.txt and depth.txt),\n"
      "camera.yaml (or --camera, or TUM's own), groundtruth.txt and the pictures they list. Stamps "
      "are the sequence's own,\n"
      "one second later where it begins at zero.",
      2, {{"camera", "FILE", "the camera, laid out as camera.yaml"}});
  if (!line.Parse(argc, argv)) return 0;
  CheckOutputFile("OUT.bag", line.Positional(1), {line.Positional(0)});
  const datasets::Sequence sequence =
      datasets::ReadTumSequence(line.Positional(0), line.Text("camera", ""));
  SayNotes("livemap_bag_from_tum", sequence.notes);
  WriteSequenceBag(sequence, line.Positional(1), TumStart(sequence));
  std::printf("%s: %zu frames, %zu poses\n", line.Positional(1).c_str(), sequence.frames.size(),
              sequence.poses.size());
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_bag_from_tum", argc, argv, livemap::tools::BagFromTum);
}
