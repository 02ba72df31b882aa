#include "change/methods/road_look.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "../road_pictures.h"
#include "change/registration/warp.h"
#include "common/error.h"
#include "common/text_file.h"
#include "perception/inference/manifest_section.h"

namespace livemap::change {
namespace {

using ::testing::HasSubstr;

const std::string kRoadModels = LIVEMAP_SOURCE_DIR "/models/";

ChangeManifest ShippedRoadManifest() {
  return ReadChangeManifest(kRoadModels + "change-small.yaml");
}

/// What is said of the shipped manifest with one piece of its text replaced.
std::string RoadManifestError(const std::string& old_text, const std::string& new_text) {
  std::string yaml = ReadTextFile(kRoadModels + "change-small.yaml", 1 << 16U);
  const std::size_t at = yaml.find(old_text);
  EXPECT_NE(at, std::string::npos) << old_text;
  yaml.replace(at, old_text.size(), new_text);
  try {
    ParseChangeManifest(yaml, "here.yaml", kRoadModels);
  } catch (const Error& error) {
    return error.what();
  }
  return "read";
}

/// A road seen from two places, a crate on it in the later picture alone.
AlignedPair CratePair() {
  const cv::Mat bare = RoadPicture(1);
  const WarpedPicture before = WarpByHomography(bare, RoadWarp().inv());
  cv::Mat after = bare.clone();
  cv::rectangle(after, cv::Rect(480, 262, 24, 20), cv::Scalar(30, 30, 40), cv::FILLED);
  cv::rectangle(after, cv::Rect(484, 266, 16, 4), cv::Scalar(150, 160, 170), cv::FILLED);
  return {FillUnknown(before.picture, after, before.valid), after, before.valid};
}

const cv::Rect kCrate(484, 266, 16, 12);

double MedianOddsOnRoad(const cv::Mat& log_odds) {
  std::vector<float> values;
  cv::Mat(log_odds(cv::Rect(300, 250, 360, 120))).clone().reshape(1, 1).copyTo(values);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

TEST(RoadLook, TellsACrateOnARoadThatTheRegistrationLeftOff) {
  RoadLook look(ShippedRoadManifest());
  const std::optional<AlignedPair> aligned = look.Align(CratePair());
  ASSERT_TRUE(aligned);
  const cv::Mat log_odds = look.LogOdds(*aligned);
  EXPECT_GT(cv::mean(log_odds(kCrate))[0], MedianOddsOnRoad(log_odds) + 3);
  EXPECT_LT(log_odds.at<float>(20, 480), -40) << "there is no road in the sky";
}

TEST(RoadLook, InTheOtherOrderTheViewStaysAndTheAnswerIsTheSame) {
  RoadLook look(ShippedRoadManifest());
  const AlignedPair pair = CratePair();
  const std::optional<AlignedPair> forward = look.Align(pair);
  const std::optional<AlignedPair> reversed =
      look.Align({pair.after, pair.before, pair.valid, true});
  ASSERT_TRUE(forward && reversed);
  EXPECT_EQ(cv::norm(reversed->before, pair.after, cv::NORM_INF), 0);
  const double one = cv::mean(look.LogOdds(*forward)(kCrate))[0];
  EXPECT_NEAR(cv::mean(look.LogOdds(*reversed)(kCrate))[0], one, 0.3);
}

TEST(RoadLook, SaysNothingOfTwoRoads) {
  const cv::Mat after = RoadPicture(1);
  const cv::Mat everywhere(after.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_FALSE(RoadLook(ShippedRoadManifest()).Align({RoadPicture(2), after, everywhere}));
}

TEST(RoadLook, RaisesChangeAndKeepsItsClass) {
  ChangeProbabilities probabilities = NothingChanged({3, 1}, true);
  probabilities.of_class[0].at<float>(0, 1) = 0.8F;
  probabilities.of_class[8].at<float>(0, 1) = 0.2F;
  const cv::Mat log_odds = (cv::Mat_<float>(1, 3) << 0, 0, -50);
  RaiseChange(log_odds, probabilities);
  EXPECT_FLOAT_EQ(probabilities.of_class[0].at<float>(0, 0), 0.5F);
  EXPECT_FLOAT_EQ(probabilities.of_class[4].at<float>(0, 0), 0.5F) << "other_objects";
  EXPECT_FLOAT_EQ(probabilities.of_class[8].at<float>(0, 1), 0.5F);
  EXPECT_FLOAT_EQ(probabilities.of_class[0].at<float>(0, 2), 1.0F);
}

TEST(RoadLook, ItsGraphAnswersAsWhereItWasMade) {
  const ChangeManifest manifest = ShippedRoadManifest();
  const YAML::Node golden = YAML::LoadFile(kRoadModels + "change-small.road.golden.yaml");
  const ChangeManifest::Graph& graph = manifest.road->graph;
  perception::OnnxGraph network(
      graph.file, perception::ReadHashedFile(manifest.name, graph.file, graph.sha256));
  const int shape[] = {1, 3, manifest.road->height, manifest.road->width};
  cv::Mat image(4, shape, CV_32F);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < shape[2]; ++y) {
      for (int x = 0; x < shape[3]; ++x) {
        const int value = (x * (c + 1) + 2 * y + x * y / 64) % 256;
        image.ptr<float>(0, c, y)[x] = (static_cast<float>(value) - 114.0F) / 58.0F;
      }
    }
  }
  const cv::Mat found = network.Run({{"image", image}})[0];
  for (const YAML::Node& each : golden["values"]) {
    EXPECT_NEAR(found.ptr<float>()[each["index"].as<std::size_t>()], each["value"].as<double>(),
                golden["tolerance"].as<double>());
  }
}

TEST(RoadLook, AManifestHasBothPartsOfItOrNone) {
  EXPECT_THAT(RoadManifestError("road: {width", "no_road: {width"), HasSubstr("no_road"));
  EXPECT_THAT(RoadManifestError("road: {file", "other: {file"), HasSubstr("other"));
  EXPECT_THAT(RoadManifestError("width: 640", "width: 641"), HasSubstr("a multiple of 8"));
  EXPECT_THAT(RoadManifestError("least_agreement: 0.45", "least_agreement: 2"),
              HasSubstr("least_agreement"));
}

}  // namespace
}  // namespace livemap::change
