// Every model that ships must answer in this build as it answered where it was trained.

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include "perception/inference/inference_engine.h"
#include "perception/inference/processor.h"

namespace livemap::perception {
namespace {

/// Paths of the models/NAME.yaml that have a NAME.golden.yaml beside them; those of other kinds are
/// tested by their own modules.
std::vector<std::string> ShippedManifests() {
  std::vector<std::string> paths;
  const std::string suffix = ".golden.yaml";
  for (const auto& entry : std::filesystem::directory_iterator(LIVEMAP_SOURCE_DIR "/models")) {
    const std::string path = entry.path().string();
    if (path.size() > suffix.size() &&
        path.compare(path.size() - suffix.size(), suffix.size(), suffix) == 0) {
      const std::string manifest = path.substr(0, path.size() - suffix.size()) + ".yaml";
      if (!std::filesystem::exists(manifest)) continue;  // Of a part of another kind's model.
      if (!YAML::LoadFile(manifest)["kind"].IsDefined()) paths.push_back(manifest);
    }
  }
  return paths;
}

/// The image that models/README.md defines by a formula, as the normalised input tensor.
cv::Mat FormulaImage(const ModelManifest& manifest) {
  const int shape[] = {1, 3, manifest.input.height, manifest.input.width};
  cv::Mat images(4, shape, CV_32F);
  for (int plane = 0; plane < 3; ++plane) {
    const int channel = manifest.input.channels == ChannelOrder::kRgb ? plane : 2 - plane;
    const auto index = static_cast<std::size_t>(plane);
    float* pixel = images.ptr<float>(0, plane);
    for (int y = 0; y < manifest.input.height; ++y) {
      for (int x = 0; x < manifest.input.width; ++x) {
        const int value = (x * (channel + 1) + 2 * y + x * y / 64) % 256;
        *pixel++ = (static_cast<float>(value) - manifest.normalisation.mean[index]) /
                   manifest.normalisation.std[index];
      }
    }
  }
  return images;
}

/// The same as pixels, in the network's order of channels.
cv::Mat FormulaPixels(const ModelManifest& manifest) {
  cv::Mat pixels(manifest.input.height, manifest.input.width, CV_8UC3);
  for (int y = 0; y < pixels.rows; ++y) {
    for (int x = 0; x < pixels.cols; ++x) {
      for (int plane = 0; plane < 3; ++plane) {
        const int channel = manifest.input.channels == ChannelOrder::kRgb ? plane : 2 - plane;
        pixels.at<cv::Vec3b>(y, x)[plane] =
            static_cast<uchar>((x * (channel + 1) + 2 * y + x * y / 64) % 256);
      }
    }
  }
  return pixels;
}

void ExpectRows(const YAML::Node& rows, const cv::Mat& output, double tolerance) {
  ASSERT_GT(rows.size(), 0U);
  // A head of scores has one row.
  const int columns = output.size[output.dims - 1];
  const int count = static_cast<int>(output.total()) / columns;
  for (const YAML::Node& row : rows) {
    const int index = row["index"].as<int>();
    const auto values = row["values"].as<std::vector<double>>();
    ASSERT_TRUE(index >= 0 && index < count) << index;
    ASSERT_EQ(values.size(), static_cast<std::size_t>(columns));
    for (std::size_t column = 0; column < values.size(); ++column) {
      EXPECT_NEAR(output.ptr<float>()[index * columns + static_cast<int>(column)], values[column],
                  tolerance)
          << "row " << index << ", column " << column;
    }
  }
}

YAML::Node GoldenOf(const std::string& manifest) {
  return YAML::LoadFile(manifest.substr(0, manifest.size() - std::string("yaml").size()) +
                        "golden.yaml");
}

class Int8GoldenTest : public ::testing::TestWithParam<std::string> {};

TEST_P(Int8GoldenTest, TheModelAnswersInEightBitsAsWhereItWasMade) {
  ModelManifest manifest = ReadModelManifest(GetParam());
  if (manifest.int8_file.empty()) GTEST_SKIP() << "skipped, no int8_file";
  if (!HasTorchEngine()) GTEST_SKIP() << "skipped, no libtorch";
  if (!HasInt8Instructions()) GTEST_SKIP() << "skipped, no VNNI";
  manifest.precision = Precision::kInt8;
  const auto engine = MakeInferenceEngine(manifest, 0, EngineKind::kTorch);
  ASSERT_EQ(engine->ComputesIn(), Precision::kInt8);
  const YAML::Node golden = GoldenOf(GetParam());
  const auto tolerance = golden["int8_tolerance"].as<double>();
  ASSERT_LE(tolerance, 0.25);
  const cv::Mat pixels = FormulaPixels(manifest);
  const cv::Mat all = engine->Run(pixels).clone();
  ExpectRows(golden["int8_rows"], all, tolerance);
  const cv::Mat first = engine->RunFirstView(pixels);
  ASSERT_EQ(first.size[1], manifest.AnchorCountOfView(0));
  EXPECT_TRUE(std::equal(first.begin<float>(), first.end<float>(), all.ptr<float>()));
}

using Parameters = std::tuple<std::string, EngineKind>;
class GoldenTest : public ::testing::TestWithParam<Parameters> {};

TEST_P(GoldenTest, TheModelAnswersAsWhereItWasTrained) {
  const auto& [path, kind] = GetParam();
  const YAML::Node golden = GoldenOf(path);
  ModelManifest manifest = ReadModelManifest(path);
  manifest.precision = Precision::kFp32;
  if (kind == EngineKind::kTorch && !HasTorchEngine()) GTEST_SKIP() << "skipped, no libtorch";
  if (kind == EngineKind::kTorch && manifest.torch_file.empty()) {
    GTEST_SKIP() << "skipped, '" << path << "' has no torch_file";
  }
  const std::unique_ptr<InferenceEngine> engine = MakeInferenceEngine(manifest, 0, kind);
  ASSERT_EQ(engine->Kind(), kind);
  const cv::Mat output = engine->Run(FormulaImage(manifest));
  const auto tolerance = golden["tolerance"].as<double>();
  ASSERT_LE(tolerance, 1e-3);
  ExpectRows(golden["rows"], output, tolerance);
}

std::string NameOfTest(const std::string& path, const std::string& kind) {
  std::string name = std::filesystem::path(path).stem().string() + "_" + kind;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

std::string NameOfModel(const ::testing::TestParamInfo<Parameters>& parameters) {
  return NameOfTest(std::get<0>(parameters.param), NameOf(std::get<1>(parameters.param)));
}

INSTANTIATE_TEST_SUITE_P(Shipped, GoldenTest,
                         ::testing::Combine(::testing::ValuesIn(ShippedManifests()),
                                            ::testing::Values(EngineKind::kOpenCv,
                                                              EngineKind::kTorch)),
                         NameOfModel);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(GoldenTest);

INSTANTIATE_TEST_SUITE_P(Shipped, Int8GoldenTest, ::testing::ValuesIn(ShippedManifests()),
                         [](const auto& path) { return NameOfTest(path.param, "int8"); });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Int8GoldenTest);

}  // namespace
}  // namespace livemap::perception
