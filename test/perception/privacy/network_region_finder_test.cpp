#include "perception/privacy/network_region_finder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "common/error.h"
#include "perception/privacy/picture_masker.h"
#include "test/perception/privacy/placed_networks.h"

namespace livemap::perception {
namespace {

constexpr float kRegionNan = std::numeric_limits<float>::quiet_NaN();

/// Twice as large as the tiny networks' input.
const cv::Size kStreetSize(128, 128);

class NetworkRegionFinderTest : public ::testing::Test {
 protected:
  std::string WhyNot(PrivateRegionSource source = PrivateRegionSource::kAuto) const {
    try {
      MakePrivateRegionFinder(Config(source));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  PrivateRegionConfig Config(PrivateRegionSource source) const {
    PrivateRegionConfig config;
    config.source = source;
    config.networks = placed_.Manifest();
    return config;
  }
  std::string Chosen(PrivateRegionSource source) const {
    return MakePrivateRegionFinder(Config(source))->Name();
  }

  PlacedNetworks placed_;
  const cv::Mat picture_ = cv::Mat(kStreetSize, CV_8UC3, cv::Scalar(80, 90, 100));
  const cv::Rect whole_{{}, kStreetSize};
};

TEST_F(NetworkRegionFinderTest, AutoTakesNetworksWherePlacedElseCascades) {
  placed_.WriteManifest();
  EXPECT_EQ(Chosen(PrivateRegionSource::kAuto), "cascades") << "no file";
  placed_.PlaceAll();
  EXPECT_EQ(Chosen(PrivateRegionSource::kAuto), "networks");
  EXPECT_EQ(Chosen(PrivateRegionSource::kCascades), "cascades");
  EXPECT_EQ(Chosen(PrivateRegionSource::kNetworks), "networks");
  EXPECT_EQ(MakePrivateRegionFinder({})->Name(), "cascades") << "nobody names a manifest";
}

TEST_F(NetworkRegionFinderTest, NetworksThatAreAskedForAreNeverReplacedByCascades) {
  EXPECT_NE(WhyNot(PrivateRegionSource::kNetworks).find("privacy.yaml"), std::string::npos);
  EXPECT_NE(WhyNot(PrivateRegionSource::kAuto).find("privacy.yaml"), std::string::npos)
      << "a manifest that is named and is not there";
  placed_.WriteManifest();
  EXPECT_NE(WhyNot(PrivateRegionSource::kNetworks).find("onnx"), std::string::npos);
  PrivateRegionConfig config = Config(PrivateRegionSource::kNetworks);
  config.networks.clear();
  EXPECT_THROW(MakePrivateRegionFinder(config), Error);
}

TEST_F(NetworkRegionFinderTest, AMissingFileBesideOthersIsNamedAndNotReplacedByCascades) {
  for (std::size_t missing = 0; missing < 3; ++missing) {
    placed_.PlaceAll();
    std::filesystem::remove(placed_.File(missing));
    EXPECT_NE(WhyNot().find(placed_.File(missing)), std::string::npos) << WhyNot();
  }
}

TEST_F(NetworkRegionFinderTest, ADamagedFileIsNamedAndNotReplacedByCascades) {
  for (std::size_t damaged = 0; damaged < 3; ++damaged) {
    placed_.PlaceAll();
    placed_.Place(damaged, "this is no network");
    const std::string why = WhyNot();
    EXPECT_NE(why.find(placed_.File(damaged)), std::string::npos) << why;
    EXPECT_NE(why.find("SHA-256"), std::string::npos) << why;
  }
}

TEST_F(NetworkRegionFinderTest, AFileThatIsNoNetworkIsRefusedThoughTheManifestNamesIt) {
  for (std::size_t which = 0; which < 3; ++which) {
    PlacedNetworks placed;
    placed.PlaceAllWith(which, "this is no network");
    EXPECT_THROW(NetworkRegionFinder{ReadPrivacyNetworks(placed.Manifest())}, Error) << which;
  }
}

TEST_F(NetworkRegionFinderTest, ANetworkOfOtherOutputsOrShapesIsRefused) {
  for (std::size_t which = 0; which < 3; ++which) {
    PlacedNetworks placed;
    placed.PlaceAllWith(which,
                        which == 1 ? PlacedNetworks::FaceFile(0.9F) : PlacedNetworks::PlateFile());
    EXPECT_THROW(NetworkRegionFinder{ReadPrivacyNetworks(placed.Manifest())}, Error) << which;
  }
  PlacedNetworks placed;
  placed.PlaceAllWith(0, TinyNetwork("input", PlacedNetworks::kSide, PlacedNetworks::kSide,
                                     {{"boxes", {1, 2, 4}, std::vector<float>(8, 0)},
                                      {"scores", {1, 2, 2}, std::vector<float>(4, 0)}}));
  EXPECT_THROW(NetworkRegionFinder{ReadPrivacyNetworks(placed.Manifest())}, Error);
}

TEST_F(NetworkRegionFinderTest, ANetworkThatAnswersNoNumbersIsRefusedAndNoPictureLeaves) {
  placed_.PlaceAllWith(0, PlacedNetworks::FaceFile(kRegionNan));
  EXPECT_NE(WhyNot().find("finite"), std::string::npos) << WhyNot();
  PictureMasker::Config config;
  config.mask.regions = Config(PrivateRegionSource::kAuto);
  EXPECT_THROW(PictureMasker{config}, Error);
  placed_.PlaceAllWith(0, PlacedNetworks::FaceFile(1.5F));
  EXPECT_NE(WhyNot().find("0 to 1"), std::string::npos) << WhyNot();
}

TEST_F(NetworkRegionFinderTest, AModelOfFacesThatIsNamedStaysInEffectUnderAuto) {
  placed_.PlaceAll();
  PrivateRegionConfig config = Config(PrivateRegionSource::kAuto);
  config.face_model = "/nowhere.onnx";
  try {
    MakePrivateRegionFinder(config);
    FAIL() << "a finder without its model of faces";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere.onnx"), std::string::npos) << error.what();
  }
  config.source = PrivateRegionSource::kNetworks;
  EXPECT_THROW(MakePrivateRegionFinder(config), Error) << "both cannot be had";
}

/// A find as it is masked: a tenth of its sides larger on each side, in whole pixels.
cv::Rect2d AsMasked(const cv::Rect2d& find) {
  return {find.x - find.width / 10, find.y - find.height / 10, 1.2 * find.width, 1.2 * find.height};
}

void ExpectNear(const cv::Rect& box, const cv::Rect2d& expected) {
  EXPECT_NEAR(box.x, expected.x, 1.5) << box;
  EXPECT_NEAR(box.y, expected.y, 1.5) << box;
  EXPECT_NEAR(box.br().x, expected.br().x, 1.5) << box;
  EXPECT_NEAR(box.br().y, expected.br().y, 1.5) << box;
}

/// The face of the tiny network lies at a quarter to a half of whatever it is shown, the plate at
/// 2 to 6 and 3 to 5 of 64.
TEST_F(NetworkRegionFinderTest, FindsOfCropsLieWhereTheyAreInThePicture) {
  placed_.PlaceAll();
  NetworkRegionFinder finder(ReadPrivacyNetworks(placed_.Manifest()));
  const cv::Mat picture(512, 512, CV_8UC3, cv::Scalar(80, 90, 100));
  const std::vector<PrivateRegion> found = finder.Find(picture, {{}, picture.size()});
  ASSERT_EQ(found.size(), 3U);
  ExpectNear(found[0].box, AsMasked({128, 128, 128, 128}));  // The face of the whole picture.
  EXPECT_TRUE(found[0].is_sure);
  const cv::Rect head = HeadCrop({128, 128, 128, 128}, picture.size());
  const double side = std::max(head.width, head.height) / 4.0;
  ExpectNear(found[1].box, AsMasked({head.x + side, head.y + side, side, side}));
  const cv::Rect car = VehicleCrop({256, 256, 256, 256}, picture.size());
  const double pixels = std::max(car.width, car.height) / 64.0;
  ExpectNear(found[2].box,
             AsMasked({car.x + 2 * pixels, car.y + 3 * pixels, 4 * pixels, 2 * pixels}));
  EXPECT_FALSE(found[2].is_sure) << "its score is 0.9";
}

TEST_F(NetworkRegionFinderTest, AFindThatIsLikeNoPlateIsNone) {
  // Two px left and right of the anchor, and eight above and below.
  placed_.PlaceAllWith(1, PlacedNetworks::PlateFile(8));
  NetworkRegionFinder finder(ReadPrivacyNetworks(placed_.Manifest()));
  const cv::Mat picture(512, 512, CV_8UC3, cv::Scalar(80, 90, 100));
  EXPECT_EQ(finder.Find(picture, {{}, picture.size()}).size(), 2U) << "the faces alone";
}

TEST_F(NetworkRegionFinderTest, OnlyCropsThatMeetTheWantedPartAreLookedAt) {
  placed_.PlaceAll();
  NetworkRegionFinder finder(ReadPrivacyNetworks(placed_.Manifest()));
  const cv::Mat picture(512, 512, CV_8UC3, cv::Scalar(80, 90, 100));
  EXPECT_EQ(finder.Find(picture, {0, 0, 90, 90}).size(), 1U) << "person and car are elsewhere";
  EXPECT_EQ(finder.Find(picture, {0, 0, 150, 150}).size(), 2U);
  EXPECT_EQ(finder.Find(picture, {0, 0, 250, 250}).size(), 3U);
}

TEST_F(NetworkRegionFinderTest, APictureThatCannotBeLookedAtIsRefused) {
  placed_.PlaceAll();
  NetworkRegionFinder finder(ReadPrivacyNetworks(placed_.Manifest()));
  EXPECT_THROW(finder.Find(cv::Mat(), {}), Error);
  EXPECT_THROW(finder.Find(cv::Mat(10, 10, CV_8UC1), {0, 0, 10, 10}), Error);
}

TEST_F(NetworkRegionFinderTest, AMaskerSaysWhatFindsItsFaces) {
  PictureMasker::Config config;
  EXPECT_EQ(PictureMasker(config).finder(), "cascades");
  placed_.PlaceAll();
  config.mask.regions.networks = placed_.Manifest();
  EXPECT_EQ(PictureMasker(config).finder(), "networks");
  config.privacy = false;
  EXPECT_EQ(PictureMasker(config).finder(), "nothing");
}

TEST(PrivacyCrops, LieInThePicture) {
  EXPECT_EQ(HeadCrop({-50, -50, 20, 20}, kStreetSize), cv::Rect());
  EXPECT_EQ(VehicleCrop({0, 0, 128, 128}, kStreetSize), cv::Rect({}, kStreetSize));
  const cv::Rect head = HeadCrop({40, 20, 30, 100}, kStreetSize);
  EXPECT_EQ(head, cv::Rect(34, 14, 42, 57)) << "the upper part with a margin";
  EXPECT_EQ(PixelsOf({kRegionNan, 0, 10, 10}, kStreetSize), cv::Rect());
  EXPECT_EQ(PixelsOf({120.5F, 10.2F, 100, 1}, kStreetSize), cv::Rect(120, 10, 8, 2));
  EXPECT_EQ(Moved({1, 2, 3, 4}, {10, 20}), cv::Rect2f(11, 22, 3, 4));
}

/// With the real networks, where they are.
TEST(RealPrivacyNetworks, FindTheFaceOfARealPhoto) {
  const std::string data = std::string(LIVEMAP_SOURCE_DIR) + "/../shared/data/";
  const std::string photos = data + "real_hazards/indian_road_obstacles/images/";
  if (!std::filesystem::is_directory(data + "models") || !std::filesystem::is_directory(photos)) {
    GTEST_SKIP() << "skipped, no data";
  }
  PrivacyNetworks networks =
      ReadPrivacyNetworks(std::string(LIVEMAP_SOURCE_DIR) + "/models/privacy.yaml");
  for (PrivacyNetworks::Network* each : {&networks.faces, &networks.plates, &networks.road_users}) {
    each->file = data + "models/" + std::filesystem::path(each->file).filename().string();
  }
  NetworkRegionFinder finder(networks);
  const cv::Mat photo = cv::imread(photos + "img_050.jpg");
  ASSERT_FALSE(photo.empty());
  const cv::Rect face(220, 118, 32, 42);
  bool has_face = false;
  for (const PrivateRegion& each : finder.Find(photo, {{}, photo.size()})) {
    has_face = has_face || (each.box & face).area() >= 0.5 * face.area();
  }
  EXPECT_TRUE(has_face);
}

}  // namespace
}  // namespace livemap::perception
