// Stands in for torch_engine.cpp where libtorch is not installed.
#include "common/error.h"
#include "perception/inference/engines.h"

namespace livemap::perception {

bool HasTorchEngine() { return false; }

std::unique_ptr<InferenceEngine> MakeTorchEngine(const ModelManifest& manifest, int) {
  throw Error(
      "the torch engine was asked for model '" + manifest.name +
      "', this build has no libtorch: accepted is opencv, or install libtorch-dev and build "
      "again");
}

std::unique_ptr<InferenceEngine> MakeInt8Engine(const ModelManifest& manifest, int threads) {
  return MakeTorchEngine(manifest, threads);
}

}  // namespace livemap::perception
