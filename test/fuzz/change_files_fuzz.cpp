// Files of change detection: a remembered frame, a prediction as numpy writes it, or the pixels of
// a mask of one, three or four channels. The first byte chooses.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "change/measures/change_pairs.h"
#include "change/measures/change_predictions.h"
#include "change/memory/place_record.h"
#include "common/error.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzRecord(const std::string& bytes) {
  const change::PlaceRecord record = change::ParsePlaceRecord(bytes, "fuzz");
  change::CheckPlaceFrame(record.frame);
  Require(record.features.points.size() <= change::kMaxRecordFeatures);
  Require(static_cast<std::size_t>(record.features.descriptors.rows) ==
          record.features.points.size());
  const double quality = change::PlaceQuality(record.frame, record.features);
  Require(quality >= 0 && quality <= 1);
  Require(change::SerialisePlaceRecord(record) == bytes);
}

void FuzzPrediction(const std::string& bytes) {
  const change::ChangeProbabilities probabilities = change::ParseNpyProbabilities(bytes, "fuzz");
  Require(probabilities.tells_classes());
  change::CheckProbabilities(probabilities, probabilities.of_class[0].size(), "fuzz");
  Require(change::MostLikely(probabilities).size() == probabilities.of_class[0].size());
}

void FuzzMask(const std::string& bytes) {
  if (bytes.size() < 3) return;
  const int channels = bytes[0] % 3 == 0 ? 1 : bytes[0] % 3 == 1 ? 3 : 4;
  const auto known = bytes[1] % 2 == 0 ? change::MaskKind::kNotKnown : change::MaskKind::kClasses;
  const int columns = static_cast<int>(bytes.size() - 2) / channels;
  if (columns == 0) return;
  const cv::Mat pixels(1, columns, CV_8UC(channels), const_cast<char*>(bytes.data()) + 2);
  const change::ChangeMask mask = change::DecodeChangeMask(pixels, "fuzz", known);
  Require(mask.classes.size() == pixels.size() && mask.classes.type() == CV_8UC1);
  Require(cv::countNonZero((mask.classes >= protocol::kChangeClasses) &
                           (mask.classes != int{change::kLeftOutPixel})) == 0);
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  const std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] == 'n') {
      FuzzPrediction(rest);
    } else if (data[0] == 'm') {
      FuzzMask(rest);
    } else {
      FuzzRecord(rest);
    }
  } catch (const Error& error) {
    Require(error.what()[0] != '\0');
  }
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzOne(data, size);
  return 0;
}
