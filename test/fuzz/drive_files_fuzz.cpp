// The readers of files that a drive is made of, or that are about one: survey tables and labels,
// tables of detections, routes, TUM and KITTI lists, camera files, image headers. The first byte
// chooses the reader, of the two tables the text does. A TUM list is also paired
// with itself, every second line, as pictures with depth images.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/error.h"
#include "datasets/camera_file.h"
#include "datasets/labels.h"
#include "datasets/route.h"
#include "datasets/sequences.h"
#include "datasets/survey.h"
#include "evaluation/detection/detection_table.h"
#include "imaging/image_header.h"

namespace {

void PairWithItself(const std::vector<livemap::datasets::SequenceFrame>& list) {
  std::vector<livemap::datasets::SequenceFrame> pictures, depths;
  for (std::size_t i = 0; i < list.size(); ++i) (i % 2 == 0 ? pictures : depths).push_back(list[i]);
  const std::vector<livemap::datasets::SequenceFrame> paired =
      livemap::datasets::AssociateDepth(pictures, depths);
  if (paired.size() > std::min(pictures.size(), depths.size())) __builtin_trap();
  for (const livemap::datasets::SequenceFrame& frame : paired) {
    const std::int64_t apart = frame.stamp_ns - frame.depth_stamp_ns;
    if (std::abs(apart) >= livemap::datasets::kMaxDepthDifferenceNs) __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 8) {
      case 0:
        if (text.rfind("image,", 0) == 0) {
          livemap::evaluation::ParseDetectionTable(text, "input");
        } else {
          livemap::datasets::ParseSurveyTable(text, "input");
        }
        break;
      case 1:
        livemap::datasets::ParseYoloLabels(text, "input");
        break;
      case 2:
        livemap::datasets::ParseRoute(text, "input");
        break;
      case 3:
        PairWithItself(livemap::datasets::ParseTumAssociations(text, "input"));
        break;
      case 4:
        livemap::datasets::ParseTumTrajectory(text, "input");
        break;
      case 5:
        livemap::datasets::ParseKittiPoses(text, "input");
        break;
      case 6:
        livemap::datasets::ParseCameraFile(text, "input");
        break;
      default:
        livemap::imaging::ReadImageHeader(data + 1, size - 1);
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the readers promise.
  }
  return 0;
}
