#include "perception/inference/inference_engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "common/error.h"
#include "common/sha256.h"
#include "perception/inference/processor.h"

namespace livemap::perception {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

ModelManifest Tiny() {
  return ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml");
}

/// Of the answers of two engines that run at the same time, 50 times each, from the expected one.
double LargestDifferenceOfTwoThreads(InferenceEngine& one, InferenceEngine& other,
                                     const cv::Mat& input, const cv::Mat& expected) {
  double worst[] = {0, 0};
  const auto run = [&](InferenceEngine& engine, double& largest) {
    for (int i = 0; i < 50; ++i)
      largest = std::max(largest, cv::norm(engine.Run(input), expected, cv::NORM_INF));
  };
  std::thread first([&] { run(one, worst[0]); });
  std::thread second([&] { run(other, worst[1]); });
  first.join();
  second.join();
  return std::max(worst[0], worst[1]);
}

std::string LoadError(const ModelManifest& manifest, EngineKind kind) {
  try {
    MakeInferenceEngine(manifest, 0, kind);
  } catch (const Error& error) {
    return error.what();
  }
  return "loaded";
}

float Sigmoid(float x) { return 1 / (1 + std::exp(-x)); }

class EachEngine : public ::testing::TestWithParam<EngineKind> {
 protected:
  void SetUp() override {
    if (GetParam() == EngineKind::kTorch && !HasTorchEngine()) {
      GTEST_SKIP() << "skipped, no libtorch";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Engines, EachEngine,
                         ::testing::Values(EngineKind::kOpenCv, EngineKind::kTorch),
                         [](const auto& kind) { return NameOf(kind.param); });

TEST_P(EachEngine, AnswersTheKnownFunctionOfTheImage) {
  const std::unique_ptr<InferenceEngine> engine = MakeInferenceEngine(Tiny(), 0, GetParam());
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

TEST_P(EachEngine, AnotherClassCountIsRefusedWithBothShapes) {
  ModelManifest manifest = Tiny();
  manifest.classes.emplace_back("deer");
  EXPECT_THAT(LoadError(manifest, GetParam()),
              AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 60 x 8"), HasSubstr("3 classes")));
}

TEST_P(EachEngine, OtherStridesAreRefusedWithBothShapes) {
  ModelManifest manifest = Tiny();
  manifest.head.strides = {8};
  EXPECT_THAT(LoadError(manifest, GetParam()),
              AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 48 x 7")));
}

TEST(OpenCvEngine, AnotherInputSizeIsRefused) {
  ModelManifest manifest = Tiny();
  std::swap(manifest.input.width, manifest.input.height);
  EXPECT_THAT(LoadError(manifest, EngineKind::kOpenCv),
              AllOf(HasSubstr("1 x 3 x 64 x 48"), HasSubstr("1 x 3 x 48 x 64")));
}

TEST(OpenCvEngine, AnotherOutputNameIsRefusedNamingBoth) {
  ModelManifest manifest = Tiny();
  manifest.head.output = "boxes";
  EXPECT_THAT(LoadError(manifest, EngineKind::kOpenCv),
              AllOf(HasSubstr("'boxes'"), HasSubstr("predictions")));
}

TEST(OpenCvEngine, AFileThatIsNoOnnxIsRefusedNamingIt) {
  for (const std::string& bytes :
       {std::string(), std::string(1000, 'x'), std::string("\x08\x06")}) {
    ModelManifest manifest = Tiny();
    manifest.file = ::testing::TempDir() + "inference_engine_test_no_model.onnx";
    manifest.sha256 = Sha256Hex(bytes);
    std::ofstream(manifest.file, std::ios::binary) << bytes;
    EXPECT_THAT(LoadError(manifest, EngineKind::kOpenCv), HasSubstr(manifest.file));
    std::filesystem::remove(manifest.file);
  }
}

TEST(OpenCvEngine, ACutOffModelIsRefused) {
  const std::string whole = ReadModelFile(Tiny());
  for (const std::size_t size : {whole.size() / 4, whole.size() / 2, whole.size() - 1}) {
    ModelManifest manifest = Tiny();
    manifest.file = ::testing::TempDir() + "inference_engine_test_cut.onnx";
    manifest.sha256 = Sha256Hex(whole.data(), size);
    std::ofstream(manifest.file, std::ios::binary) << whole.substr(0, size);
    EXPECT_NE(LoadError(manifest, EngineKind::kOpenCv), "loaded")
        << size << " bytes of " << whole.size();
    std::filesystem::remove(manifest.file);
  }
}

/// The tiny model's manifest with these bytes as its TorchScript file.
ModelManifest WithTorchFile(const std::string& bytes) {
  ModelManifest manifest = Tiny();
  manifest.torch_file = ::testing::TempDir() + "inference_engine_test.pt";
  manifest.torch_sha256 = Sha256Hex(bytes);
  std::ofstream(manifest.torch_file, std::ios::binary) << bytes;
  return manifest;
}

class TorchEngine : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasTorchEngine()) GTEST_SKIP() << "skipped, no libtorch";
  }
};

TEST_F(TorchEngine, AFileOfAnotherHashIsRefusedNamingBothBeforeItIsLoaded) {
  ModelManifest manifest = Tiny();
  const std::string found = manifest.torch_sha256;
  manifest.torch_sha256 = std::string(64, 'a');
  EXPECT_THAT(
      LoadError(manifest, EngineKind::kTorch),
      AllOf(HasSubstr(manifest.torch_file), HasSubstr(found), HasSubstr(std::string(64, 'a'))));
}

TEST_F(TorchEngine, AMissingFileIsNamed) {
  ModelManifest manifest = Tiny();
  manifest.torch_file = "/nowhere/m.pt";
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch), HasSubstr("/nowhere/m.pt"));
}

TEST_F(TorchEngine, AFileThatIsNoTorchScriptIsRefusedInOneLineNamingIt) {
  const std::string whole = ReadTorchFile(Tiny());
  for (const std::string& bytes : {std::string(), std::string(1000, 'x'), ReadModelFile(Tiny()),
                                   whole.substr(0, whole.size() / 2)}) {
    const ModelManifest manifest = WithTorchFile(bytes);
    const std::string error = LoadError(manifest, EngineKind::kTorch);
    EXPECT_THAT(error, AllOf(HasSubstr(manifest.torch_file), HasSubstr("cannot be loaded")));
    EXPECT_EQ(error.find('\n'), std::string::npos);
    std::filesystem::remove(manifest.torch_file);
  }
}

TEST_F(TorchEngine, AnInputOfAnotherShapeIsRefusedAndTheNextOneWorks) {
  const auto engine = MakeInferenceEngine(Tiny(), 1, EngineKind::kTorch);
  const int other[] = {1, 3, 64, 48};
  EXPECT_THROW(engine->Run(cv::Mat(4, other, CV_32F, cv::Scalar(0))), Error);
  EXPECT_THROW(engine->Run(cv::Mat()), Error);
  const int shape[] = {1, 3, 48, 64};
  EXPECT_THROW(engine->Run(cv::Mat(4, shape, CV_8U, cv::Scalar(0))), Error);
  EXPECT_EQ(engine->Run(cv::Mat(4, shape, CV_32F, cv::Scalar(0))).size[1], 60);
}

TEST_F(TorchEngine, TwoEnginesOnTwoThreadsAnswerAsOne) {
  const int shape[] = {1, 3, 48, 64};
  cv::Mat images(4, shape, CV_32F);
  cv::randu(images, 0, 1);
  const cv::Mat expected = MakeInferenceEngine(Tiny(), 1, EngineKind::kTorch)->Run(images).clone();
  // Made here, run there: an engine of a pool is not made on the thread that runs it.
  const auto one = MakeInferenceEngine(Tiny(), 1, EngineKind::kTorch);
  const auto other = MakeInferenceEngine(Tiny(), 2, EngineKind::kTorch);
  EXPECT_LT(LargestDifferenceOfTwoThreads(*one, *other, images, expected), 1e-4);
}

ModelManifest TinyInt8() {
  return ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny_int8.yaml");
}

class Int8Engine : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasTorchEngine()) GTEST_SKIP() << "skipped, no libtorch";
    if (!HasInt8Instructions()) GTEST_SKIP() << "skipped, no VNNI";
  }
};

TEST_F(Int8Engine, AnswersTheKnownFunctionOfThePixelsUpToAStep) {
  const std::unique_ptr<InferenceEngine> engine = MakeInferenceEngine(TinyInt8(), 1);
  ASSERT_EQ(engine->ComputesIn(), Precision::kInt8);
  EXPECT_EQ(engine->Kind(), EngineKind::kTorch);
  cv::Mat pixels(48, 64, CV_8UC3, cv::Scalar::all(0));
  pixels(cv::Rect(16, 8, 8, 8)).setTo(cv::Scalar(191, 64, 0));  // RGB: red 0.75, green 0.25
  const cv::Mat output = engine->Run(pixels);
  ASSERT_EQ(output.dims, 3);
  ASSERT_EQ(output.size[1], 60);
  ASSERT_EQ(output.size[2], 7);
  const float red_and_green[] = {
      0.5F, 0.5F, 0.75F * std::log(2.0F), 0.0F, Sigmoid(10), Sigmoid(10), Sigmoid(-10)};
  const float black[] = {0.5F, 0.5F, 0, 0, Sigmoid(-10), 0.5F, 0.5F};
  const float quarter[] = {
      0.5F, 0.5F, 0.75F / 4 * std::log(2.0F), 0.0F, Sigmoid(-5), Sigmoid(2.5F), Sigmoid(-2.5F)};
  for (int column = 0; column < 7; ++column) {
    EXPECT_NEAR(output.ptr<float>(0, 1 * 8 + 2)[column], red_and_green[column], 0.015) << column;
    EXPECT_NEAR(output.ptr<float>(0, 0)[column], black[column], 0.015) << column;
    EXPECT_NEAR(output.ptr<float>(0, 48 + 1)[column], quarter[column], 0.015) << column;
  }
}

TEST_F(Int8Engine, AFileOfAnotherHashAMissingOneAndOneWithoutViewsAreRefusedNamingThem) {
  ModelManifest manifest = TinyInt8();
  manifest.int8_sha256 = std::string(64, 'a');
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch),
              AllOf(HasSubstr(manifest.int8_file), HasSubstr(std::string(64, 'a'))));
  manifest.int8_file = "/nowhere/m.int8.pt";
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch), HasSubstr("/nowhere/m.int8.pt"));
  manifest.int8_file.clear();
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch), HasSubstr("no int8_file"));
  // A TorchScript file in float32 has no method of a view.
  manifest.int8_file = manifest.torch_file;
  manifest.int8_sha256 = manifest.torch_sha256;
  const std::string error = LoadError(manifest, EngineKind::kTorch);
  EXPECT_THAT(error, AllOf(HasSubstr(manifest.torch_file), HasSubstr("view_0")));
  EXPECT_EQ(error.find('\n'), std::string::npos);
}

TEST_F(Int8Engine, ACutOffFileIsRefusedInOneLine) {
  const std::string whole = ReadInt8File(TinyInt8());
  for (const std::string& bytes :
       {std::string(), std::string(1000, 'x'), whole.substr(0, whole.size() / 2)}) {
    ModelManifest manifest = TinyInt8();
    manifest.int8_file = ::testing::TempDir() + "inference_engine_test.int8.pt";
    manifest.int8_sha256 = Sha256Hex(bytes);
    std::ofstream(manifest.int8_file, std::ios::binary) << bytes;
    const std::string error = LoadError(manifest, EngineKind::kTorch);
    EXPECT_THAT(error, AllOf(HasSubstr(manifest.int8_file), HasSubstr("cannot be loaded")));
    EXPECT_EQ(error.find('\n'), std::string::npos);
    std::filesystem::remove(manifest.int8_file);
  }
}

TEST_F(Int8Engine, OtherClassesAndStridesAreRefusedWithBothShapes) {
  ModelManifest manifest = TinyInt8();
  manifest.classes.emplace_back("deer");
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch),
              AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 60 x 8")));
  manifest = TinyInt8();
  manifest.head.strides = {8};
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch),
              AllOf(HasSubstr("1 x 60 x 7"), HasSubstr("1 x 48 x 7")));
}

TEST_F(Int8Engine, AnInputOfAnotherShapeIsRefusedAndTheNextOneWorks) {
  const auto engine = MakeInferenceEngine(TinyInt8(), 1);
  const int floats[] = {1, 3, 48, 64};
  EXPECT_THROW(engine->Run(cv::Mat(4, floats, CV_32F, cv::Scalar(0))), Error);
  EXPECT_THROW(engine->Run(cv::Mat()), Error);
  EXPECT_THROW(engine->Run(cv::Mat(64, 48, CV_8UC3, cv::Scalar())), Error);
  EXPECT_THROW(engine->Run(cv::Mat(48, 128, CV_8UC3, cv::Scalar()).colRange(0, 64)), Error);
  EXPECT_EQ(engine->Run(cv::Mat(48, 64, CV_8UC3, cv::Scalar())).size[1], 60);
}

TEST_F(Int8Engine, TwoEnginesOnTwoThreadsAnswerAsOne) {
  cv::Mat pixels(48, 64, CV_8UC3);
  cv::randu(pixels, 0, 256);
  const cv::Mat expected = MakeInferenceEngine(TinyInt8(), 1)->Run(pixels).clone();
  const auto one = MakeInferenceEngine(TinyInt8(), 1);
  const auto other = MakeInferenceEngine(TinyInt8(), 2);
  EXPECT_EQ(LargestDifferenceOfTwoThreads(*one, *other, pixels, expected), 0);
}

TEST(EngineChoice, EightBitsAreLibtorchsAloneAndOnlyWhereTheProcessorHasInstructionsForThem) {
  EXPECT_EQ(MakeInferenceEngine(TinyInt8(), 1, EngineKind::kOpenCv)->ComputesIn(),
            Precision::kFp32);
  if (!HasTorchEngine()) return;
  EXPECT_EQ(MakeInferenceEngine(TinyInt8(), 1, EngineKind::kTorch)->ComputesIn(),
            HasInt8Instructions() ? Precision::kInt8 : Precision::kFp32);
  ModelManifest manifest = TinyInt8();
  manifest.precision = Precision::kFp32;
  EXPECT_EQ(MakeInferenceEngine(manifest, 1, EngineKind::kTorch)->ComputesIn(), Precision::kFp32);
}

TEST(Processor, HasInstructionsForEightBitsWhereTheKernelSaysSo) {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line) && line.rfind("flags", 0) != 0) {
  }
  if (line.rfind("flags", 0) != 0) GTEST_SKIP() << "skipped, /proc/cpuinfo has no flags";
  line += ' ';
  const bool listed = line.find(" avx512_vnni ") != std::string::npos ||
                      line.find(" avx_vnni ") != std::string::npos;
  EXPECT_EQ(HasInt8Instructions(), listed);
}

TEST(EngineChoice, IsTheManifestsUnlessOneIsGiven) {
  ModelManifest manifest = Tiny();
  EXPECT_EQ(MakeInferenceEngine(manifest, 0)->Kind(), EngineKind::kOpenCv);
  manifest.engine = EngineKind::kTorch;
  EXPECT_EQ(MakeInferenceEngine(manifest, 0)->Kind(),
            HasTorchEngine() ? EngineKind::kTorch : EngineKind::kOpenCv);
  EXPECT_EQ(MakeInferenceEngine(manifest, 0, EngineKind::kOpenCv)->Kind(), EngineKind::kOpenCv);
}

TEST(EngineChoice, TorchWithoutItsFileOrItsLibraryIsRefusedSayingSo) {
  ModelManifest manifest = Tiny();
  manifest.torch_file.clear();
  EXPECT_THAT(LoadError(manifest, EngineKind::kTorch),
              AllOf(HasSubstr("torch engine was asked for model 'tiny'"),
                    HasSubstr(HasTorchEngine() ? "torch_file" : "no libtorch")));
}

TEST(EngineChoice, IsReadFromText) {
  EXPECT_EQ(ParseEngineChoice("auto", "x"), std::nullopt);
  EXPECT_EQ(ParseEngineChoice("opencv", "x"), EngineKind::kOpenCv);
  EXPECT_EQ(ParseEngineChoice("torch", "x"), EngineKind::kTorch);
  try {
    ParseEngineChoice("abacus", "flag --engine");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "flag --engine is 'abacus', accepted are auto, opencv and torch");
  }
}

}  // namespace
}  // namespace livemap::perception
