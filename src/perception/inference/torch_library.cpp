#include "perception/inference/torch_library.h"

#include <dlfcn.h>

#include <string>

#include "common/error.h"
#include "perception/inference/engines.h"

namespace livemap::perception {
namespace {

constexpr char kLibrary[] = "liblivemap_torch_engine.so";

/// It is found as a library that a program is linked with, and never closed: libtorch's threads and
/// tensors may outlive the last engine.
decltype(&LiveMapMakeTorchEngine) OpenTorchLibrary() {
  void* library = dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  void* maker = library == nullptr ? nullptr : dlsym(library, "LiveMapMakeTorchEngine");
  if (maker == nullptr) {
    const char* reason = dlerror();
    throw Error(std::string("the torch engine cannot be loaded: ") +
                (reason == nullptr ? kLibrary : reason));
  }
  return reinterpret_cast<decltype(&LiveMapMakeTorchEngine)>(maker);
}

std::unique_ptr<InferenceEngine> Make(const ModelManifest& manifest, int threads, bool int8) {
  static const auto maker = OpenTorchLibrary();
  return std::unique_ptr<InferenceEngine>(maker(manifest, threads, int8));
}

}  // namespace

bool HasTorchEngine() { return true; }

std::unique_ptr<InferenceEngine> MakeTorchEngine(const ModelManifest& manifest, int threads) {
  return Make(manifest, threads, false);
}

std::unique_ptr<InferenceEngine> MakeInt8Engine(const ModelManifest& manifest, int threads) {
  return Make(manifest, threads, true);
}

}  // namespace livemap::perception
