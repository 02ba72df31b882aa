#include "perception/inference/onnx_inputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"
#include "perception/inference/model_manifest.h"

namespace livemap::perception {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::string TinyModel() {
  return ReadModelFile(
      ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml"));
}

TEST(OnnxInputs, OfARealModelAreRead) {
  const std::vector<OnnxInput> inputs = ReadOnnxInputs(TinyModel());
  ASSERT_EQ(inputs.size(), 1U);
  EXPECT_EQ(inputs[0].name, "images");
  EXPECT_THAT(inputs[0].shape, ElementsAre(1, 3, 48, 64));
}

TEST(OnnxInputs, ADimensionWithoutSizeIsMinusOne) {
  // graph { input { name: "x"  type { tensor_type { shape { dim { dim_param: "n" } dim { 5 } } } }
  // } }
  const std::string dims = "\x0a\x03\x12\x01n\x0a\x02\x08\x05";
  const std::string shape = "\x12" + std::string(1, static_cast<char>(dims.size())) + dims;
  const std::string tensor = "\x0a" + std::string(1, static_cast<char>(shape.size())) + shape;
  const std::string input =
      "\x0a\x01x\x12" + std::string(1, static_cast<char>(tensor.size())) + tensor;
  const std::string graph = "\x5a" + std::string(1, static_cast<char>(input.size())) + input;
  const std::string model = "\x3a" + std::string(1, static_cast<char>(graph.size())) + graph;
  const std::vector<OnnxInput> inputs = ReadOnnxInputs(model);
  ASSERT_EQ(inputs.size(), 1U);
  EXPECT_EQ(inputs[0].name, "x");
  EXPECT_THAT(inputs[0].shape, ElementsAre(-1, 5));
}

TEST(OnnxInputs, NoBytesHaveNoInputs) { EXPECT_THAT(ReadOnnxInputs(""), IsEmpty()); }

TEST(OnnxInputs, ACutOffModelIsRefused) {
  const std::string whole = TinyModel();
  EXPECT_THROW(ReadOnnxInputs(whole.substr(0, whole.size() / 2)), Error);
}

TEST(OnnxInputs, LengthsBeyondTheEndAndEndlessNumbersAreRefused) {
  EXPECT_THROW(ReadOnnxInputs("\x3a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"), Error);
  EXPECT_THROW(ReadOnnxInputs(std::string(40, '\xff')), Error);
  EXPECT_THROW(ReadOnnxInputs("\x3b"), Error) << "groups are no part of ONNX";
}

}  // namespace
}  // namespace livemap::perception
