#include "perception/inference/model_manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/support/temporary_directory.h"

namespace livemap::perception {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kTinyManifest = LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml";

const std::string kGood = R"(name: n
file: n.onnx
sha256: 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef
classes: [pothole, traffic_cone]
input: {width: 64, height: 48, channels: rgb, resize: letterbox, pad_value: 114}
normalisation: {mean: [1, 2, 3], std: [4, 5, 6]}
head: {type: yolox, strides: [8, 16], output: predictions}
thresholds: {traffic_cone: 0.7, pothole: 0.6}
nms_iou: 0.5
)";

std::string Replaced(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string ErrorOf(const std::string& yaml) {
  try {
    ParseModelManifest(yaml, "x.yaml", "models");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ModelManifest, EveryValueIsRead) {
  const ModelManifest manifest = ParseModelManifest(kGood, "x.yaml", "models");
  EXPECT_EQ(manifest.name, "n");
  EXPECT_EQ(manifest.file, "models/n.onnx");
  EXPECT_EQ(manifest.sha256.substr(0, 4), "0123");
  EXPECT_THAT(manifest.classes, ElementsAre("pothole", "traffic_cone"));
  EXPECT_EQ(manifest.input.width, 64);
  EXPECT_EQ(manifest.input.height, 48);
  EXPECT_EQ(manifest.input.channels, ChannelOrder::kRgb);
  EXPECT_EQ(manifest.input.pad_value, 114);
  EXPECT_THAT(manifest.normalisation.mean, ElementsAre(1, 2, 3));
  EXPECT_THAT(manifest.normalisation.std, ElementsAre(4, 5, 6));
  EXPECT_THAT(manifest.head.strides, ElementsAre(8, 16));
  EXPECT_EQ(manifest.head.output, "predictions");
  EXPECT_THAT(manifest.thresholds, ElementsAre(0.6F, 0.7F)) << "by class index, not by file order";
  EXPECT_EQ(manifest.nms_iou, 0.5F);
  EXPECT_EQ(manifest.AnchorCount(), 8 * 6 + 4 * 3);
  EXPECT_EQ(manifest.engine, EngineKind::kOpenCv);
  EXPECT_EQ(manifest.torch_file, "");
}

const std::string kTorchKeys =
    "torch_file: n.pt\ntorch_sha256: " + std::string(64, 'b') + "\nengine: torch\n";

TEST(ModelManifest, TheTorchFileAndTheChoiceOfAnEngineAreRead) {
  const ModelManifest manifest = ParseModelManifest(kGood + kTorchKeys, "x.yaml", "models");
  EXPECT_EQ(manifest.torch_file, "models/n.pt");
  EXPECT_EQ(manifest.torch_sha256, std::string(64, 'b'));
  EXPECT_EQ(manifest.engine, EngineKind::kTorch);
  EXPECT_EQ(ParseModelManifest(kGood + "engine: opencv\n", "x.yaml", "models").engine,
            EngineKind::kOpenCv);
}

TEST(ModelManifest, AHalfOrWrongChoiceOfAnEngineIsRefused) {
  EXPECT_THAT(ErrorOf(kGood + "torch_file: n.pt\n"),
              AllOf(HasSubstr("torch_sha256 is missing"), HasSubstr("both torch_file and")));
  EXPECT_THAT(ErrorOf(kGood + "torch_sha256: " + std::string(64, 'b') + "\n"),
              HasSubstr("torch_file is missing"));
  EXPECT_THAT(ErrorOf(kGood + "torch_file: n.pt\ntorch_sha256: b\n"),
              AllOf(HasSubstr("torch_sha256 is 'b'"), HasSubstr("64 lower-case")));
  EXPECT_THAT(ErrorOf(kGood + "engine: abacus\n"),
              AllOf(HasSubstr("engine is 'abacus'"), HasSubstr("opencv or torch")));
  EXPECT_THAT(ErrorOf(kGood + "engine: torch\n"),
              AllOf(HasSubstr("engine is 'torch'"), HasSubstr("no torch_file")));
}

struct BadManifest {
  std::string from;
  std::string to;
  std::string named;     // the key that the error must name
  std::string accepted;  // what it must say is accepted
};

class BadManifestTest : public ::testing::TestWithParam<BadManifest> {};

TEST_P(BadManifestTest, IsRefusedNamingTheKeyAndWhatIsAccepted) {
  EXPECT_THAT(
      ErrorOf(Replaced(GetParam().from, GetParam().to)),
      AllOf(HasSubstr("x.yaml"), HasSubstr(GetParam().named), HasSubstr(GetParam().accepted)));
}

INSTANTIATE_TEST_SUITE_P(
    Manifests, BadManifestTest,
    ::testing::Values(
        BadManifest{"name: n\n", "", "'name'", "is missing"},
        BadManifest{"name: n\n", "name: n\nflavour: 1\n", "unknown key 'flavour'", "nms_iou"},
        BadManifest{"name: n\n", "name: n\nname: m\n", "'name'", "twice"},
        BadManifest{"name: n\n", "name: [n]\n", "name is a list", "a text"},
        BadManifest{"0123456789abcdef0123", "0123456789ABCDEF0123", "sha256", "64 lower-case"},
        BadManifest{"0123456789abcdef0123", "01", "sha256", "64 lower-case"},
        BadManifest{"classes: [pothole, traffic_cone]", "classes: []", "classes", "a list of 1"},
        BadManifest{"[pothole, traffic_cone]", "[pothole, pothole]", "classes", "distinct"},
        BadManifest{"width: 64", "width: 0", "input.width is '0'", "from 1 to 4096"},
        BadManifest{"width: 64", "width: 1e9", "input.width is '1e9'", "a whole number"},
        BadManifest{"width: 64", "width: 100", "head.strides[0] is '8'", "a divisor"},
        BadManifest{"channels: rgb", "channels: yuv", "input.channels is 'yuv'", "rgb or bgr"},
        BadManifest{"letterbox", "stretch", "input.resize is 'stretch'", "letterbox"},
        BadManifest{"pad_value: 114", "pad_value: 256", "pad_value is '256'", "from 0 to 255"},
        BadManifest{", pad_value: 114", "", "'pad_value'", "is missing"},
        BadManifest{"mean: [1, 2, 3]", "mean: [1, 2]", "normalisation.mean", "a list of 3"},
        BadManifest{"std: [4, 5, 6]", "std: [4, 0, 6]", "normalisation.std[1] is '0'", "0.001"},
        BadManifest{"std: [4, 5, 6]", "std: [4, .inf, 6]", "normalisation.std[1]", "a number"},
        BadManifest{"type: yolox", "type: yolov8", "head.type is 'yolov8'", "yolox or score"},
        BadManifest{"type: yolox", "type: score", "unknown key 'nms_iou'", "thresholds"},
        BadManifest{"strides: [8, 16]", "strides: [8, 16], views: 3", "head.views is '3'",
                    "a divisor of the number of strides, 2"},
        BadManifest{"strides: [8, 16]", "strides: [8, 16], mirrored: 1", "head.mirrored is '1'",
                    "true or false"},
        BadManifest{"strides: [8, 16]", "strides: [8, 16], views: 0", "head.views is '0'",
                    "1 to 4"},
        BadManifest{"strides: [8, 16]", "strides: [8, 0]", "head.strides[1]", "whole number"},
        BadManifest{"pothole: 0.6", "pothole: .nan", "thresholds.pothole is '.nan'", "a number"},
        BadManifest{"pothole: 0.6", "pothole: 1.5", "thresholds.pothole is '1.5'", "0.999"},
        BadManifest{", pothole: 0.6", "", "'pothole' in 'thresholds'", "is missing"},
        BadManifest{", pothole: 0.6", ", pothole: 0.6, deer: 0.1", "'deer' in 'thresholds'",
                    "accepted are"},
        BadManifest{"nms_iou: 0.5", "nms_iou: .nan", "nms_iou", "from 0 to 1"},
        BadManifest{"nms_iou: 0.5", "nms_iou: [", "x.yaml", "no valid YAML"}));

TEST(ModelManifest, AHeadOfScoresHasNeitherStridesNorSuppression) {
  const std::string no_nms = Replaced("nms_iou: 0.5\n", "");
  std::string text = no_nms;
  const std::string yolox = "{type: yolox, strides: [8, 16], output: predictions}";
  const std::size_t at = text.find(yolox);
  text.replace(at, yolox.size(), "{type: score, output: score}");
  const ModelManifest manifest = ParseModelManifest(text, "x.yaml", "models");
  EXPECT_EQ(manifest.head.type, HeadType::kScore);
  EXPECT_EQ(manifest.head.output, "score");
  EXPECT_TRUE(manifest.head.strides.empty());
  EXPECT_THAT(manifest.thresholds, ElementsAre(0.6F, 0.7F));
  EXPECT_THAT(manifest.OutputShape(), ElementsAre(1, 2));
  text.replace(at, 12, "{type: score, strides: [8]");
  EXPECT_THAT(ErrorOf(text), HasSubstr("unknown key 'strides' in 'head'"));
  EXPECT_THAT(ErrorOf(no_nms), HasSubstr("'nms_iou' is missing"));
}

TEST(ModelManifest, TheOutputOfABoxHeadHasARowPerCell) {
  EXPECT_THAT(ParseModelManifest(kGood, "x.yaml", "models").OutputShape(),
              ElementsAre(1, 8 * 6 + 4 * 3, 7));
}

TEST(ModelManifest, AFileThatIsNoMapIsRefused) {
  EXPECT_THAT(ErrorOf(""), HasSubstr("accepted is a map"));
  EXPECT_THAT(ErrorOf("- 1\n"), HasSubstr("accepted is a map"));
  EXPECT_THAT(ErrorOf(std::string(70000, '#')), HasSubstr("70000 bytes"));
}

TEST(ModelManifest, DeepNestingIsAnErrorAndNoCrash) {
  EXPECT_NE(ErrorOf(std::string(60000, '[')), "accepted");
  EXPECT_NE(ErrorOf(std::string(60000, '{')), "accepted");
}

TEST(ModelManifest, AMissingFileIsNamed) {
  try {
    ReadModelManifest("/nowhere/m.yaml");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nowhere/m.yaml"));
  }
}

TEST(ModelManifest, AByteOrderMarkIsSkipped) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/tiny.yaml";
  std::ofstream(path) << "\xef\xbb\xbf" << ReadFile(kTinyManifest, 1U << 20U);
  EXPECT_EQ(ReadModelManifest(path).classes, ReadModelManifest(kTinyManifest).classes);
}

TEST(ModelFile, IsReadWhenItsHashIsTheManifests) {
  const ModelManifest manifest = ReadModelManifest(kTinyManifest);
  EXPECT_EQ(ReadModelFile(manifest).size(), std::filesystem::file_size(manifest.file));
}

TEST(ModelFile, AnotherHashIsRefusedNamingBoth) {
  ModelManifest manifest = ReadModelManifest(kTinyManifest);
  const std::string found = manifest.sha256;
  manifest.sha256 = std::string(64, 'a');
  try {
    ReadModelFile(manifest);
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr(manifest.file), HasSubstr(found), HasSubstr(std::string(64, 'a'))));
  }
}

TEST(ModelFile, AMissingFileIsNamed) {
  ModelManifest manifest = ReadModelManifest(kTinyManifest);
  manifest.file = "/nowhere/m.onnx";
  EXPECT_THROW(ReadModelFile(manifest), Error);
}

const std::string kInt8Keys = "int8_file: n.int8.pt\nint8_sha256: " + std::string(64, 'c') + "\n";

TEST(ModelManifest, TheFileInEightBitsAndThePrecisionAreRead) {
  const ModelManifest without = ParseModelManifest(kGood, "x.yaml", "models");
  EXPECT_EQ(without.int8_file, "");
  EXPECT_EQ(without.precision, Precision::kFp32);
  const std::string both = kGood + kTorchKeys + kInt8Keys;
  const ModelManifest beside = ParseModelManifest(both, "x.yaml", "models");
  EXPECT_EQ(beside.int8_file, "models/n.int8.pt");
  EXPECT_EQ(beside.int8_sha256, std::string(64, 'c'));
  EXPECT_EQ(beside.precision, Precision::kFp32) << "the file alone does not choose it";
  EXPECT_EQ(ParseModelManifest(both + "precision: int8\n", "x.yaml", "models").precision,
            Precision::kInt8);
  EXPECT_EQ(ParseModelManifest(both + "precision: fp32\n", "x.yaml", "models").precision,
            Precision::kFp32);
}

TEST(ModelManifest, APrecisionWithoutItsFileAndHalfAFileInEightBitsAreRefused) {
  const std::string torch = kGood + kTorchKeys;
  EXPECT_THAT(ErrorOf(torch + "precision: int8\n"),
              AllOf(HasSubstr("precision is 'int8'"), HasSubstr("no int8_file")));
  const std::string opencv = kGood + kTorchKeys.substr(0, kTorchKeys.find("engine"));
  EXPECT_EQ(ErrorOf(opencv + kInt8Keys), "accepted");
  EXPECT_THAT(ErrorOf(opencv + kInt8Keys + "precision: int8\n"), HasSubstr("engine is not torch"));
  EXPECT_THAT(ErrorOf(torch + kInt8Keys + "precision: fp16\n"),
              AllOf(HasSubstr("precision is 'fp16'"), HasSubstr("fp32"), HasSubstr("int8")));
  EXPECT_THAT(ErrorOf(torch + "int8_file: n.int8.pt\n"), HasSubstr("int8_sha256 is missing"));
  EXPECT_THAT(ErrorOf(torch + "int8_sha256: " + std::string(64, 'c') + "\n"),
              HasSubstr("int8_file is missing"));
  EXPECT_THAT(ErrorOf(torch + "int8_file: n.int8.pt\nint8_sha256: c\n"), HasSubstr("int8_sha256"));
  EXPECT_THAT(ErrorOf(kGood + kInt8Keys), HasSubstr("a torch_file beside it"));
}

TEST(ModelManifest, AViewIsAsMuchSmallerAsItsCellsAreLarger) {
  ModelManifest manifest;
  manifest.input.width = 640;
  manifest.input.height = 400;
  manifest.head.strides = {4, 8, 16, 5, 10, 20};
  manifest.head.views = 2;
  EXPECT_EQ(manifest.SizeOfView(0), cv::Size(640, 400));
  EXPECT_EQ(manifest.SizeOfView(1), cv::Size(512, 320));
  EXPECT_EQ(manifest.AnchorCountOfView(0), 160 * 100 + 80 * 50 + 40 * 25);
  EXPECT_EQ(manifest.AnchorCountOfView(1), 128 * 80 + 64 * 40 + 32 * 20);
  EXPECT_EQ(manifest.AnchorCount(), manifest.AnchorCountOfView(0) + manifest.AnchorCountOfView(1));
}

TEST(ModelManifest, AViewInEightBitsThatIsLargerThanTheFirstIsRefused) {
  const std::string larger = Replaced("strides: [8, 16]", "strides: [8, 4], views: 2");
  EXPECT_EQ(ErrorOf(larger), "accepted");
  EXPECT_THAT(ErrorOf(larger + kTorchKeys + kInt8Keys),
              AllOf(HasSubstr("head.strides"), HasSubstr("first view")));
}

TEST(TorchFile, IsReadWhenItsHashIsTheManifestsAndRefusedWhereThereIsNone) {
  ModelManifest manifest = ReadModelManifest(kTinyManifest);
  EXPECT_EQ(ReadTorchFile(manifest).size(), std::filesystem::file_size(manifest.torch_file));
  std::swap(manifest.torch_sha256, manifest.sha256);
  EXPECT_THROW(ReadTorchFile(manifest), Error);
  manifest.torch_file.clear();
  EXPECT_THROW(ReadTorchFile(manifest), Error);
}

}  // namespace
}  // namespace livemap::perception
