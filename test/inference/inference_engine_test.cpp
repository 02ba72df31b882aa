#include "inference/inference_engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/sha256.h"

namespace livemap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

ModelManifest Tiny() { return ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/inference/tiny.yaml"); }

std::string LoadError(const ModelManifest& manifest) {
  try {
    MakeInferenceEngine(manifest, 0);
  } catch (const Error& error) {
    return error.what();
  }
  return "loaded";
}

float Sigmoid(float x) { return 1 / (1 + std::exp(-x)); }

TEST(InferenceEngine, AnswersTheKnownFunctionOfTheImage) {
  const std::unique_ptr<InferenceEngine> engine = MakeInferenceEngine(Tiny(), 0);
  const int shape[] = {1, 3, 48, 64};
  cv::Mat images(4, shape, CV_32F, cv::Scalar(0));
  // The cell at column 2, row 1 of stride 8: red 0.75, green 0.25.
  for (int y = 8; y < 16; ++y) {
    for (int x = 16; x < 24; ++x) {
      images.ptr<float>(0, 0)[y * 64 + x] = 0.75F;
      images.ptr<float>(0, 1)[y * 64 + x] = 0.25F;
    }
  }
  const cv::Mat output = engine->Run(images);
  ASSERT_EQ(output.dims, 3);
  ASSERT_EQ(output.size[1], 60);
  ASSERT_EQ(output.size[2], 7);
  const float red_and_green[] = {
      0.5F, 0.5F, 0.75F * std::log(2.0F), 0.0F, Sigmoid(10), Sigmoid(10), Sigmoid(-10)};
  const float black[] = {0.5F, 0.5F, 0, 0, Sigmoid(-10), 0.5F, 0.5F};
  // The cell of stride 16 that holds it, at column 1, row 0, sees a quarter of it.
  const float quarter[] = {
      0.5F, 0.5F, 0.75F / 4 * std::log(2.0F), 0.0F, Sigmoid(-5), Sigmoid(2.5F), Sigmoid(-2.5F)};
  for (int column = 0; column < 7; ++column) {
    EXPECT_NEAR(output.ptr<float>(0, 1 * 8 + 2)[column], red_and_green[column], 1e-4) << column;
    EXPECT_NEAR(output.ptr<float>(0, 0)[column], black[column], 1e-4) << column;
    EXPECT_NEAR(output.ptr<float>(0, 48 + 1)[column], quarter[column], 1e-4) << column;
  }
}

TEST(InferenceEngine, AnotherClassCountIsRefusedWithBothShapes) {
  ModelManifest manifest = Tiny();
  manifest.classes.emplace_back("deer");
  EXPECT_THAT(LoadError(manifest),
              AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 60 x 8"), HasSubstr("3 classes")));
}

TEST(InferenceEngine, OtherStridesAreRefusedWithBothShapes) {
  ModelManifest manifest = Tiny();
  manifest.head.strides = {8};
  EXPECT_THAT(LoadError(manifest), AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 48 x 7")));
}

TEST(InferenceEngine, AnotherInputSizeIsRefused) {
  ModelManifest manifest = Tiny();
  std::swap(manifest.input.width, manifest.input.height);
  EXPECT_THAT(LoadError(manifest),
              AllOf(HasSubstr("1 x 3 x 64 x 48"), HasSubstr("1 x 3 x 48 x 64")));
}

TEST(InferenceEngine, AnotherOutputNameIsRefusedNamingBoth) {
  ModelManifest manifest = Tiny();
  manifest.head.output = "boxes";
  EXPECT_THAT(LoadError(manifest), AllOf(HasSubstr("'boxes'"), HasSubstr("predictions")));
}

TEST(InferenceEngine, AFileThatIsNoOnnxIsRefusedNamingIt) {
  for (const std::string& bytes :
       {std::string(), std::string(1000, 'x'), std::string("\x08\x06")}) {
    ModelManifest manifest = Tiny();
    manifest.file = ::testing::TempDir() + "inference_engine_test_no_model.onnx";
    manifest.sha256 = Sha256Hex(bytes);
    std::ofstream(manifest.file, std::ios::binary) << bytes;
    EXPECT_THAT(LoadError(manifest), HasSubstr(manifest.file));
    std::filesystem::remove(manifest.file);
  }
}

TEST(InferenceEngine, ACutOffModelIsRefused) {
  const std::string whole = ReadModelFile(Tiny());
  for (const std::size_t size : {whole.size() / 4, whole.size() / 2, whole.size() - 1}) {
    ModelManifest manifest = Tiny();
    manifest.file = ::testing::TempDir() + "inference_engine_test_cut.onnx";
    manifest.sha256 = Sha256Hex(whole.data(), size);
    std::ofstream(manifest.file, std::ios::binary) << whole.substr(0, size);
    EXPECT_NE(LoadError(manifest), "loaded") << size << " bytes of " << whole.size();
    std::filesystem::remove(manifest.file);
  }
}

}  // namespace
}  // namespace livemap
