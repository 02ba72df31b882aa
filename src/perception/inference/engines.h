#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perception/inference/inference_engine.h"

namespace livemap::perception {

/// The makers behind MakeInferenceEngine; what it says of hashes, shapes, threads and errors
/// holds for them.
std::unique_ptr<InferenceEngine> MakeOpenCvEngine(const ModelManifest& manifest, int threads);
std::unique_ptr<InferenceEngine> MakeTorchEngine(const ModelManifest& manifest, int threads);
/// libtorch with int8_file, whatever the processor has.
std::unique_ptr<InferenceEngine> MakeInt8Engine(const ModelManifest& manifest, int threads);

/// "1 x 3 x 400 x 640"; "?" for a negative size.
std::string ShapeText(const std::vector<std::int64_t>& sizes);
std::vector<std::int64_t> ShapeOf(const cv::Mat& tensor);

/// The shape of the input that the manifest promises.
std::vector<std::int64_t> InputShape(const ModelManifest& manifest);

/// Runs the engine once, which also makes the first frame as fast as the others, and throws Error
/// when the output is not the manifest's. `file` is the model's, for the error.
void CheckOutput(InferenceEngine& engine, const ModelManifest& manifest, const std::string& file);

/// The first line of a library's message: errors here are one sentence.
std::string FirstLine(const std::string& text);

}  // namespace livemap::perception
