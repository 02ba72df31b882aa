#pragma once

#include "perception/inference/inference_engine.h"
#include "perception/inference/model_manifest.h"

// What the library liblivemap_torch_engine.so is opened for.
extern "C" {
/// A new engine of libtorch, which the caller deletes. Throws Error as MakeInferenceEngine.
livemap::perception::InferenceEngine* LiveMapMakeTorchEngine(
    const livemap::perception::ModelManifest& manifest, int threads, bool int8);
}
