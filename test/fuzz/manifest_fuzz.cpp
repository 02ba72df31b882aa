// Whatever a model consists of: the text of a manifest of a detector or of a network of change, or
// the bytes of an ONNX file up to its declared inputs, or a packed file. The first byte chooses.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "change/methods/change_manifest.h"
#include "common/error.h"
#include "perception/inference/model_manifest.h"
#include "perception/inference/onnx_inputs.h"
#include "perception/inference/unpack.h"

namespace livemap::fuzz {
namespace {

constexpr std::size_t kMaxUnpacked = 1 << 16;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// What is accepted must hold what the header promises.
void CheckManifest(const perception::ModelManifest& manifest) {
  Require(!manifest.name.empty() && manifest.sha256.size() == 64);
  Require(!manifest.classes.empty());
  Require(manifest.thresholds.size() == manifest.classes.size());
  Require(manifest.input.width > 0 && manifest.input.height > 0 && manifest.AnchorCount() > 0);
  for (const float threshold : manifest.thresholds) Require(threshold > 0 && threshold < 1);
  for (std::size_t i = 0; i < 3; ++i) {
    Require(std::isfinite(manifest.normalisation.mean[i]) && manifest.normalisation.std[i] > 0);
  }
  for (const int stride : manifest.head.strides) {
    Require(manifest.input.width % stride == 0 && manifest.input.height % stride == 0);
  }
}

void CheckChangeManifest(const change::ChangeManifest& manifest) {
  Require(!manifest.name.empty() && !manifest.output.empty());
  for (const auto& graph : {manifest.whole, manifest.encoder, manifest.head}) {
    Require(!graph.file.empty() && graph.sha256.size() == 64);
  }
  Require(manifest.input.width > 0 && manifest.input.height > 0);
  Require(manifest.levels >= 1 && manifest.levels <= 10);
  for (const double threshold :
       {manifest.changed, manifest.changed_at_fpr_001, manifest.changed_at_fpr_010}) {
    Require(threshold > 0 && threshold < 1);
  }
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  const std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] == 'z') {
      Require(perception::Unpacked(std::string(rest), "fuzz", kMaxUnpacked).size() <=
              std::max(kMaxUnpacked, rest.size()));
    } else if (data[0] == 'o') {
      perception::ReadOnnxInputs(rest);
    } else if (data[0] == 'c') {
      CheckChangeManifest(change::ParseChangeManifest(std::string(rest), "fuzz", "models"));
    } else {
      CheckManifest(perception::ParseModelManifest(std::string(rest), "fuzz", "models"));
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
