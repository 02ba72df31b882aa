#include "change/methods/change_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "change/measures/change_pairs.h"
#include "change/measures/change_predictions.h"
#include "common/error.h"
#include "common/sha256.h"

namespace livemap::change {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kSame = 1e-3;

/// What test/change/make_change_model.py wrote; ctest runs it before.
std::string ModelFolder() {
  const char* folder = std::getenv("LIVEMAP_CHANGE_MODEL");
  return folder == nullptr ? "" : folder;
}

double Apart(const ChangeProbabilities& a, const ChangeProbabilities& b) {
  double most = a.of_class.size() == b.of_class.size() ? 0 : 1;
  for (std::size_t i = 0; most < 1 && i < a.of_class.size(); ++i) {
    most = std::max(most, cv::norm(a.of_class[i], b.of_class[i], cv::NORM_INF));
  }
  return most;
}

AlignedPair Scaled(const AlignedPair& pair, cv::Size size) {
  AlignedPair scaled;
  cv::resize(pair.before, scaled.before, size);
  cv::resize(pair.after, scaled.after, size);
  cv::resize(pair.valid, scaled.valid, size, 0, 0, cv::INTER_NEAREST);
  return scaled;
}

class ChangeNetworkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(ModelFolder() + "/made_of")) {
      GTEST_SKIP() << "skipped, no torch to make a network with (or not run by ctest)";
    }
  }

  static std::string Manifest() { return ReadFile(ModelFolder() + "/tiny.yaml", 1 << 16U); }

  /// The tiny network's manifest with one piece of its text replaced.
  static std::string With(const std::string& old_text, const std::string& new_text) {
    std::string yaml = Manifest();
    const std::size_t at = yaml.find(old_text);
    EXPECT_NE(at, std::string::npos) << old_text;
    return yaml.replace(at, old_text.size(), new_text);
  }

  static std::string ErrorOf(const std::string& yaml) {
    try {
      ChangeNetwork(ParseChangeManifest(yaml, "here.yaml", ModelFolder()));
    } catch (const Error& error) {
      return error.what();
    }
    return "loaded";
  }

  static ChangePairFiles Files(std::size_t number) {
    return FindChangePairs(ModelFolder() + "/pairs").at(number);
  }

  static AlignedPair Pair(std::size_t number) {
    const ChangePair pair = LoadChangePair(Files(number));
    return {pair.before, pair.after, cv::Mat(pair.after.size(), CV_8UC1, cv::Scalar(255))};
  }
};

TEST_F(ChangeNetworkTest, AnswersAsTheTrainingsOwnProgramDoesInBothOrders) {
  const auto network = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  for (const std::size_t number : {0U, 1U}) {
    const AlignedPair pair = Pair(number);
    const std::string name = Files(number).name;
    const std::string predictions = ModelFolder() + "/predictions/";
    const auto forward = ReadPrediction(predictions + "forward", name, pair.after.size());
    EXPECT_LE(Apart(network->Run(pair), forward), kSame) << name;
    const auto reversed = ReadPrediction(predictions + "reversed", name, pair.after.size());
    EXPECT_LE(Apart(network->Run({pair.after, pair.before, pair.valid}), reversed), kSame) << name;
    EXPECT_GT(Apart(forward, reversed), 10 * kSame) << "a network that says nothing tests nothing";
  }
}

TEST_F(ChangeNetworkTest, FeaturesOfBothPicturesGiveTheSameAsThePictures) {
  const auto network = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  AlignedPair pair = Pair(0);
  pair.valid(cv::Rect(0, 0, 70, 256)).setTo(0);
  const cv::Mat filled = FillUnknown(pair.before, pair.after, pair.valid);
  const ChangeFeatures before = network->Encode(filled);
  const ChangeFeatures after = network->Encode(pair.after);
  EXPECT_GT(before.Bytes(), 0U);
  EXPECT_LE(Apart(network->Compare(before, after, pair.valid), network->Run(pair)), kSame);
}

TEST_F(ChangeNetworkTest, WhereThePairIsNotValidNoChangeIsCertainWhateverTheSize) {
  const auto network = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  for (const cv::Size size : {cv::Size(320, 256), cv::Size(640, 480), cv::Size(501, 133)}) {
    AlignedPair pair = Scaled(Pair(0), size);
    const cv::Rect unknown(0, size.height / 3, size.width / 3, size.height / 2);
    pair.valid(unknown).setTo(0);
    pair.before(unknown).setTo(cv::Scalar(255, 0, 255));
    const ChangeProbabilities found = network->Run(pair);
    ASSERT_NO_THROW(CheckProbabilities(found, size, "found"));
    EXPECT_TRUE(found.tells_classes());
    EXPECT_EQ(cv::countNonZero(found.of_class[0](unknown) != 1), 0);
    for (std::size_t i = 1; i < found.of_class.size(); ++i) {
      EXPECT_EQ(cv::countNonZero(found.of_class[i](unknown)), 0);
    }
    // What the warp could not fill does not matter.
    pair.before(unknown).setTo(cv::Scalar(0, 90, 0));
    EXPECT_LE(Apart(found, network->Run(pair)), 1e-6);
  }
}

TEST_F(ChangeNetworkTest, PicturesOfAnotherSizeThanTheNetworksAreLetterboxed) {
  const auto network = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  const AlignedPair pair = Pair(0);
  const ChangeProbabilities small = network->Run(pair);
  const ChangeProbabilities large = network->Run(Scaled(pair, {640, 512}));
  // Enlarged pictures are a little softer, so only most of it agrees.
  cv::Mat again;
  cv::resize(large.of_class[0], again, pair.after.size(), 0, 0, cv::INTER_AREA);
  EXPECT_LT(cv::norm(again, small.of_class[0], cv::NORM_L1) / static_cast<double>(again.total()),
            0.1);
}

TEST(CloserLook, ShowsTheMiddleOfLargePicturesLarger) {
  const cv::Size input(320, 256);
  EXPECT_EQ(CloserLook({960, 480}, 0.583, input), cv::Rect(200, 32, 560, 448));
  EXPECT_EQ(CloserLook({640, 480}, 0.583, input), cv::Rect(133, 115, 373, 298));
  EXPECT_TRUE(CloserLook({320, 240}, 0.583, input).empty()) << "it would only be enlarged";
  EXPECT_TRUE(CloserLook({960, 480}, 0, input).empty());
  EXPECT_EQ(CloserLook({2000, 300}, 0.583, input).height, 300);
}

TEST_F(ChangeNetworkTest, ACloserLookIsTheAnswerToTheMiddleAlone) {
  const auto once = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  ChangeNetwork twice(ParseChangeManifest(
      With("invalid: other_picture", "invalid: other_picture, closer_look: 0.6"), "here.yaml",
      ModelFolder()));
  const AlignedPair pair = Scaled(Pair(0), {640, 512});
  const cv::Rect middle = CloserLook({640, 512}, 0.6, {320, 256});
  ASSERT_EQ(middle.width, 384);
  const ChangeProbabilities found = twice.Run(pair);
  const ChangeProbabilities whole = once->Run(pair);
  const ChangeProbabilities alone = once->Run(
      {pair.before(middle).clone(), pair.after(middle).clone(), pair.valid(middle).clone()});
  for (std::size_t i = 0; i < found.of_class.size(); ++i) {
    EXPECT_LE(cv::norm(found.of_class[i](middle), alone.of_class[i], cv::NORM_INF), 1e-5);
    EXPECT_EQ(found.of_class[i].at<float>(0, 0), whole.of_class[i].at<float>(0, 0));
  }
  EXPECT_GT(Apart(found, whole), 10 * kSame);
}

TEST_F(ChangeNetworkTest, PicturesAndFeaturesThatDoNotFitAreRefused) {
  const auto network = MakeChangeNetwork(ModelFolder() + "/tiny.yaml");
  const AlignedPair pair = Pair(0);
  EXPECT_THROW(network->Run({pair.before, pair.after, cv::Mat()}), Error);
  EXPECT_THROW(network->Encode(cv::Mat()), Error);
  EXPECT_THROW(network->Encode(cv::Mat(10, 10, CV_8UC1)), Error);
  const ChangeFeatures one = network->Encode(pair.before);
  const ChangeFeatures other = network->Encode(Scaled(pair, {160, 128}).before);
  EXPECT_THROW(network->Compare(one, other, pair.valid), Error);
  EXPECT_THROW(network->Compare(one, {}, pair.valid), Error);
  EXPECT_THROW(network->Compare(one, one, cv::Mat(5, 5, CV_8UC1)), Error);
}

TEST_F(ChangeNetworkTest, AManifestThatIsWrongIsRefusedNamingWhatIsAccepted) {
  EXPECT_THAT(ErrorOf("[]"), HasSubstr("a map"));
  EXPECT_THAT(ErrorOf("name: [unclosed"), HasSubstr("no valid YAML"));
  EXPECT_THAT(ErrorOf(With("kind: change\n", "")),
              AllOf(HasSubstr("here.yaml"), HasSubstr("kind")));
  EXPECT_THAT(ErrorOf(With("kind: change\n", "kind: score\n")),
              AllOf(HasSubstr("'score'"), HasSubstr("accepted is change")));
  EXPECT_THAT(ErrorOf(With("no_change, barrier", "barrier, no_change")),
              AllOf(HasSubstr("classes"), HasSubstr("in this order no_change, barrier")));
  EXPECT_THAT(ErrorOf(With("barrier, ", "")), HasSubstr("a list of 9"));
  EXPECT_THAT(ErrorOf(With("name: tiny", "name: tiny\nlicence: mine")), HasSubstr("unknown key"));
  EXPECT_THAT(ErrorOf(With("invalid: other_picture", "invalid: black")),
              AllOf(HasSubstr("input.invalid is 'black'"), HasSubstr("other_picture")));
  EXPECT_THAT(ErrorOf(With("invalid: other_picture", "invalid: other_picture, closer_look: 1")),
              HasSubstr("input.closer_look is '1'"));
  EXPECT_THAT(ErrorOf(With("levels: 5", "levels: 0")), HasSubstr("head.levels is '0'"));
  EXPECT_THAT(ErrorOf(With("changed: 0.5", "changed: 1.5")), HasSubstr("thresholds.changed"));
}

TEST_F(ChangeNetworkTest, GraphsThatAreNotTheManifestsAreRefusedNamingTheFile) {
  const std::string graph = ModelFolder() + "/tiny.encoder.onnx";
  const std::string hash = Sha256Hex(ReadFile(graph, 1 << 24U));
  EXPECT_THAT(ErrorOf(With(hash, std::string(64, 'a'))),
              AllOf(HasSubstr("tiny.encoder.onnx"), HasSubstr(hash)));
  EXPECT_THAT(ErrorOf(With("tiny.encoder.onnx", "nowhere.onnx")), HasSubstr("nowhere.onnx"));
  EXPECT_THAT(ErrorOf(With("width: 320", "width: 352")),
              AllOf(HasSubstr("1 x 3 x 256 x 320"), HasSubstr("1 x 3 x 256 x 352")));
  EXPECT_THAT(ErrorOf(With("levels: 5", "levels: 4")), HasSubstr("has 5 outputs"));
  EXPECT_THAT(ErrorOf(With("output: probabilities", "output: boxes")), HasSubstr("'boxes'"));
  // The whole graph where the encoder should be: the right hash is not enough.
  const std::string whole_hash = Sha256Hex(ReadFile(ModelFolder() + "/tiny.onnx", 1 << 26U));
  std::string yaml = With("tiny.encoder.onnx", "tiny.onnx");
  yaml.replace(yaml.find(hash), hash.size(), whole_hash);
  EXPECT_THAT(ErrorOf(yaml), AllOf(HasSubstr("tiny.onnx"), HasSubstr("'image'")));
}

/// The picture that models/README.md defines by a formula, BGR.
cv::Mat FormulaPicture(const perception::ModelManifest::Input& input) {
  cv::Mat picture(input.height, input.width, CV_8UC3);
  for (int y = 0; y < input.height; ++y) {
    for (int x = 0; x < input.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        picture.at<cv::Vec3b>(y, x)[2 - c] =
            static_cast<std::uint8_t>((x * (c + 1) + 2 * y + x * y / 64) % 256);
      }
    }
  }
  return picture;
}

/// The networks of change with golden outputs: those that ship, and the tiny one.
std::vector<std::string> GoldenManifests() {
  std::vector<std::string> paths;
  for (const std::string& folder : {std::string(LIVEMAP_SOURCE_DIR "/models"), ModelFolder()}) {
    if (!std::filesystem::is_directory(folder)) continue;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      std::filesystem::path path = entry.path();
      if (path.extension() != ".yaml" || path.stem().extension() == ".golden") continue;
      const YAML::Node kind = YAML::LoadFile(path.string())["kind"];
      if (kind.IsDefined() && kind.as<std::string>() == "change") paths.push_back(path.string());
    }
  }
  return paths;
}

TEST(GoldenChange, NetworksAnswerAsWhereTheyWereTrained) {
  const std::vector<std::string> paths = GoldenManifests();
  if (paths.empty()) GTEST_SKIP() << "skipped, no network of change";
  for (const std::string& path : paths) {
    const auto network = MakeChangeNetwork(path);
    const YAML::Node golden = YAML::LoadFile(path.substr(0, path.size() - 4) + "golden.yaml");
    const cv::Mat first = FormulaPicture(network->manifest().input);
    cv::Mat second;
    cv::flip(first, second, 1);
    cv::Mat valid(first.size(), CV_8UC1, cv::Scalar(255));
    valid(cv::Rect(0, 0, 16, first.rows)).setTo(0);
    const ChangeProbabilities found =
        network->Compare(network->Encode(first), network->Encode(second), valid);
    ASSERT_LE(golden["tolerance"].as<double>(), kSame);
    ASSERT_GT(golden["pixels"].size(), 0U);
    for (const YAML::Node& pixel : golden["pixels"]) {
      const auto values = pixel["values"].as<std::vector<double>>();
      ASSERT_EQ(values.size(), static_cast<std::size_t>(protocol::kChangeClasses));
      const cv::Point at(pixel["x"].as<int>(), pixel["y"].as<int>());
      for (std::size_t i = 0; i < values.size(); ++i) {
        // Of what was not seen Compare says nothing, whatever the network believes.
        const double expected = valid.at<uchar>(at) != 0 ? values[i] : (i == 0 ? 1 : 0);
        EXPECT_NEAR(found.of_class[i].at<float>(at), expected, golden["tolerance"].as<double>())
            << path << ", class " << i;
      }
    }
  }
}

}  // namespace
}  // namespace livemap::change
