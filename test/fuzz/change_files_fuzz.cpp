// Files of change detection: a remembered frame, or a prediction as numpy writes it. The first byte
// chooses.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

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

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  const std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] == 'n') {
      FuzzPrediction(rest);
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
