#include "perception/privacy/privacy_mask.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "common/error.h"
#include "test/perception/privacy/drawn_people.h"

namespace livemap::perception {
namespace {

/// Grey road with grain, as a camera sees it.
cv::Mat Street() {
  cv::Mat noise(240, 320, CV_8UC3);
  cv::RNG random(7);
  random.fill(noise, cv::RNG::NORMAL, 120, 6);
  return noise;
}

/// Different pixels in a part of the picture: a block of the mask is one.
std::size_t ColoursIn(const cv::Mat& bgr, const cv::Rect& part) {
  std::set<std::array<std::uint8_t, 3>> colours;
  for (const cv::Vec3b& pixel : cv::Mat_<cv::Vec3b>(bgr(part))) {
    colours.insert({pixel[0], pixel[1], pixel[2]});
  }
  return colours.size();
}

bool IsCovered(const cv::Rect& part, const PrivacyMask& mask) {
  for (const cv::Rect& masked : mask.Masked()) {
    if ((masked & part).area() >= 0.9 * part.area()) return true;
  }
  return false;
}

/// Says what the test tells it to, as doubtful or as sure.
class ToldFinder final : public PrivateRegionFinder {
 public:
  explicit ToldFinder(const std::vector<cv::Rect>& regions, const bool& is_sure = kDoubtful)
      : regions_(regions), is_sure_(is_sure) {}
  std::vector<PrivateRegion> Find(const cv::Mat&, const cv::Rect&) override {
    std::vector<PrivateRegion> found;
    for (const cv::Rect& region : regions_) found.push_back({region, is_sure_});
    return found;
  }

 private:
  static constexpr bool kDoubtful = false;

  const std::vector<cv::Rect>& regions_;
  const bool& is_sure_;
};

/// The largest difference of any channel between two pictures, in a part of them.
double DifferenceIn(const cv::Mat& a, const cv::Mat& b, const cv::Rect& part) {
  return cv::norm(a(part), b(part), cv::NORM_INF);
}

TEST(PrivacyMask, AFaceOfAnySizeIsNotRecognisableAnyMore) {
  for (const int height : {40, 80, 140}) {
    cv::Mat before = Street();
    DrawFace(before, {160, 120}, height);
    cv::GaussianBlur(before, before, {}, height / 60.0);
    cv::Mat after = before.clone();
    PrivacyMask mask({});
    mask.Apply(after, 1);
    const cv::Rect face(160 - height * 3 / 10, 120 - height * 3 / 10, height * 6 / 10,
                        height * 7 / 10);
    EXPECT_TRUE(IsCovered(face, mask)) << "face of " << height << " pixels";
    const auto found = MakePrivateRegionFinder({})->Find(after, {{}, after.size()});
    for (const PrivateRegion& again : found) {
      EXPECT_LT((again.box & face).area(), 0.5 * face.area()) << "still a face of " << height;
    }
  }
}

/// The cascade misses one drawn plate in thirty; more would be a mistake of ours.
TEST(PrivacyMask, NumberPlatesAreNotReadableAnyMore) {
  constexpr int kPlates = 20;
  cv::RNG random(3);
  int masked = 0;
  for (int i = 0; i < kPlates; ++i) {
    const int width = random.uniform(60, 160);
    // One after the other: compilers differ in which argument of a call they evaluate first.
    const int top = random.uniform(30, 190);
    const int left = random.uniform(10, 150);
    const cv::Rect plate(left, top, width, cvRound(width / 4.6));
    cv::Mat before = Street();
    DrawPlate(before, plate.tl(), width, "A" + std::to_string(100 + 37 * i) + "BC");
    cv::GaussianBlur(before, before, {}, 0.7);  // As a lens does.
    cv::Mat after = before.clone();
    PrivacyMask mask({});
    mask.Apply(after, 1);
    if (!IsCovered(plate, mask)) continue;
    ++masked;
    EXPECT_GT(ColoursIn(before, plate), 100U);
    EXPECT_LE(ColoursIn(after, plate), 60U) << "masked, but readable: plate " << i;
  }
  EXPECT_GE(masked, 18) << "of " << kPlates;
}

/// Wherever a face lies that meets the wanted part, and however large it is.
TEST(PrivacyMask, AFaceThatMeetsTheWantedPartIsMaskedAsInTheWholePicture) {
  const cv::Rect part(260, 160, 240, 160);
  cv::RNG random(11);
  int in_whole = 0;
  int in_part = 0;
  for (int i = 0; i < 30; ++i) {
    const int height = 30 + 6 * i;
    cv::Mat street(400, 640, CV_8UC3);
    random.fill(street, cv::RNG::NORMAL, 120, 6);
    const cv::Rect face(random.uniform(part.x - height / 2, part.br().x), random.uniform(100, 260),
                        height * 6 / 10, height * 7 / 10);
    DrawFace(street, {face.x + height * 3 / 10, face.y + height * 3 / 10}, height);
    cv::GaussianBlur(street, street, {}, height / 60.0);
    if ((face & part).empty()) continue;
    cv::Mat again = street.clone();
    PrivacyMask whole({});
    whole.Apply(street, 1);
    PrivacyMask partly({});
    partly.Apply(again, 1, part);
    in_whole += IsCovered(face, whole);
    in_part += IsCovered(face, partly);
  }
  EXPECT_GE(in_whole, 20);
  EXPECT_GE(in_part, in_whole);
}

/// The cascades take some shadows for a plate.
TEST(PrivacyMask, AFalseFindOnTheSubjectLeavesItClear) {
  int finds = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    cv::Mat shadows(240, 320, CV_8UC3);
    cv::RNG random(seed);
    random.fill(shadows, cv::RNG::NORMAL, 120, 60);
    cv::GaussianBlur(shadows, shadows, {}, 4.0);
    cv::cvtColor(shadows, shadows, cv::COLOR_BGR2GRAY);
    cv::equalizeHist(shadows, shadows);
    cv::cvtColor(shadows, shadows, cv::COLOR_GRAY2BGR);
    const cv::Rect whole({}, shadows.size());
    for (const PrivateRegion& found : MakePrivateRegionFinder({})->Find(shadows, whole)) {
      ++finds;
      cv::Mat after = shadows.clone();
      PrivacyMask({}).Apply(after, 1, whole, {found.box});
      EXPECT_EQ(DifferenceIn(shadows, after, found.box), 0) << "seed " << seed << found.box;
    }
  }
  EXPECT_GE(finds, 2) << "else this test shows nothing";
}

TEST(PrivacyMask, AClearFaceOrPlateOnTheSubjectIsMasked) {
  cv::RNG random(5);
  int plates = 0;
  for (int i = 0; i < 12; ++i) {
    cv::Mat before = Street();
    const int height = 34 + 9 * i;
    DrawFace(before, {160, 125}, height);
    cv::GaussianBlur(before, before, {}, std::max(0.5, height / 60.0));
    cv::Mat after = before.clone();
    PrivacyMask({}).Apply(after, 1, {{}, after.size()}, {{0, 0, 320, 240}});
    const cv::Rect face(160 - height * 3 / 10, 125 - height * 3 / 10, height * 6 / 10,
                        height * 6 / 10);
    EXPECT_LE(ColoursIn(after, face), 60U) << "face of " << height;

    const int width = random.uniform(55, 90);
    // One after the other: compilers differ in which argument of a call they evaluate first.
    const int top = random.uniform(30, 190);
    const int left = random.uniform(10, 150);
    const cv::Rect plate(left, top, width, cvRound(width / 4.6));
    before = Street();
    DrawPlate(before, plate.tl(), width, "A" + std::to_string(100 + 37 * i) + "BC");
    cv::GaussianBlur(before, before, {}, 0.7);
    after = before.clone();
    PrivacyMask({}).Apply(after, 1, {{}, after.size()}, {{0, 0, 320, 240}});
    plates += ColoursIn(after, plate) <= 60U;
  }
  EXPECT_GE(plates, 10) << "of 12";
}

TEST(PrivacyMask, ADoubtfulFindIsMaskedUpToTheSubjectAndNotOverIt) {
  const std::vector<cv::Rect> told = {{100, 100, 80, 80}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  const cv::Mat before = Street();
  cv::Mat after = before.clone();
  const cv::Rect subject(140, 80, 100, 120);
  mask.Apply(after, 1, {{}, after.size()}, {subject});
  EXPECT_EQ(DifferenceIn(before, after, subject), 0);
  EXPECT_LE(ColoursIn(after, {92, 92, 46, 96}), 15U) << "beside the subject it is masked";
}

TEST(PrivacyMask, ASureFindIsMaskedOverTheSubjectTooAlsoWhereADoubtfulOneLies) {
  class Both final : public PrivateRegionFinder {
   public:
    std::vector<PrivateRegion> Find(const cv::Mat&, const cv::Rect&) override {
      return {{{100, 100, 80, 80}, true}, {{110, 110, 120, 80}, false}};
    }
  };
  PrivacyMask mask({}, std::make_unique<Both>());
  const cv::Mat before = Street();
  cv::Mat after = before.clone();
  mask.Apply(after, 1, {{}, after.size()}, {{90, 90, 200, 140}});
  EXPECT_LE(ColoursIn(after, {100, 100, 80, 80}), 40U);
  EXPECT_EQ(DifferenceIn(before, after, {200, 100, 60, 90}), 0) << "of the doubtful one alone";
}

TEST(PrivacyMask, AFaceThatWasSureStaysSureWhileItIsRemembered) {
  std::vector<cv::Rect> told = {{100, 100, 80, 80}};
  bool is_sure = true;
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told, is_sure));
  const cv::Rect subject(90, 90, 120, 120);
  const auto is_masked = [&](std::uint64_t frame) {
    const cv::Mat before = Street();
    cv::Mat after = before.clone();
    mask.Apply(after, frame, {{}, after.size()}, {subject});
    return DifferenceIn(before, after, {100, 100, 80, 80}) > 0;
  };
  EXPECT_TRUE(is_masked(1));
  is_sure = false;
  EXPECT_TRUE(is_masked(2)) << "found again, with doubt";
  told.clear();
  EXPECT_TRUE(is_masked(3)) << "lost";
  EXPECT_FALSE(is_masked(100));
  told = {{100, 100, 80, 80}};
  EXPECT_FALSE(is_masked(101)) << "that was another face";
}

TEST(PrivacyMask, ACrowdHidesTheSubjectToo) {
  const std::vector<cv::Rect> told(101, cv::Rect(10, 10, 5, 5));
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  const cv::Mat before = Street();
  cv::Mat after = before.clone();
  mask.Apply(after, 1, {{}, after.size()}, {{100, 100, 60, 60}});
  EXPECT_LE(ColoursIn(after, {100, 100, 60, 60}), 9U);
}

TEST(PrivacyMask, ASubjectBeyondThePictureOrOfNoSizeIsNone) {
  const std::vector<cv::Rect> told = {{0, 0, 60, 60}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  const cv::Mat before = Street();
  cv::Mat after = before.clone();
  mask.Apply(after, 1, {{}, after.size()}, {{-20, -20, 40, 40}, {400, 10, 9, 9}, {}});
  EXPECT_EQ(DifferenceIn(before, after, {0, 0, 20, 20}), 0);
  EXPECT_GT(DifferenceIn(before, after, {20, 20, 40, 40}), 0);
}

TEST(PrivacyMask, AroundTheWantedPartNothingIsRecognisableAndThePartStaysAsItIs) {
  const cv::Rect part(40, 60, 100, 80);
  cv::Mat before = Street();
  cv::Mat after = before.clone();
  const std::vector<cv::Rect> nobody;
  PrivacyMask mask({}, std::make_unique<ToldFinder>(nobody));
  mask.Apply(after, 1, part);
  EXPECT_EQ(cv::norm(before(part), after(part), cv::NORM_INF), 0);
  EXPECT_GT(ColoursIn(before, {150, 0, 170, 240}), 1000U);
  EXPECT_LE(ColoursIn(after, {150, 0, 170, 240}), 20U);
}

TEST(PrivacyMask, APartBeyondThePictureIsRefused) {
  PrivacyMask mask({});
  cv::Mat picture = Street();
  for (const cv::Rect& part : {cv::Rect(300, 0, 40, 40), cv::Rect(-1, 0, 9, 9), cv::Rect()}) {
    EXPECT_THROW(mask.Apply(picture, 1, part), Error) << part;
  }
}

TEST(PrivacyMask, TheRestOfThePictureStaysAsItIs) {
  cv::Mat before = Street();
  DrawFace(before, {160, 120}, 80);
  cv::Mat after = before.clone();
  PrivacyMask mask({});
  mask.Apply(after, 1);
  cv::Mat changed;
  cv::absdiff(before, after, changed);
  for (const cv::Rect& masked : mask.Masked()) changed(masked & cv::Rect(0, 0, 320, 240)) = 0;
  EXPECT_EQ(cv::countNonZero(changed.reshape(1)), 0);
}

TEST(PrivacyMask, TheMaskIsAQuarterLargerThanWhatWasFound) {
  const std::vector<cv::Rect> told = {{100, 100, 40, 80}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 1);
  ASSERT_EQ(mask.Masked().size(), 1U);
  EXPECT_EQ(mask.Masked()[0], cv::Rect(95, 90, 50, 100));
}

TEST(PrivacyMask, AFaceThatIsLostStaysMaskedForTenFrames) {
  std::vector<cv::Rect> told = {{100, 100, 40, 40}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 5);
  const std::vector<cv::Rect> found = std::exchange(told, {});
  for (std::uint64_t frame = 6; frame <= 15; ++frame) {
    picture = Street();
    mask.Apply(picture, frame);
    EXPECT_TRUE(IsCovered(found[0], mask)) << "frame " << frame;
  }
  mask.Apply(picture, 16);
  EXPECT_TRUE(mask.Masked().empty()) << "after ten frames";
}

TEST(PrivacyMask, FramesWithoutPictureCountToo) {
  std::vector<cv::Rect> told = {{100, 100, 40, 40}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 5);
  told.clear();
  mask.Apply(picture, 400);
  EXPECT_TRUE(mask.Masked().empty()) << "a minute later it is another place";
}

TEST(PrivacyMask, AFaceIsMaskedInPicturesOfFramesBeforeTheOneInWhichItWasFound) {
  std::vector<cv::Rect> told = {{100, 100, 40, 40}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 100);
  const std::vector<cv::Rect> found = std::exchange(told, {});
  for (const std::uint64_t frame : {98U, 90U}) {
    picture = Street();
    mask.Apply(picture, frame);
    EXPECT_TRUE(IsCovered(found[0], mask)) << "frame " << frame;
  }
}

TEST(PrivacyMask, AnOlderPictureForgetsNothingOfTheNewerOnes) {
  std::vector<cv::Rect> told = {{100, 100, 40, 40}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 100);
  const std::vector<cv::Rect> found = std::exchange(told, {});
  mask.Apply(picture, 20);
  EXPECT_TRUE(mask.Masked().empty()) << "eighty frames before it is another place";
  mask.Apply(picture, 105);
  EXPECT_TRUE(IsCovered(found[0], mask)) << "of frame 100";
}

TEST(PrivacyMask, ACrowdMasksTheWholePicture) {
  const std::vector<cv::Rect> told(101, cv::Rect(10, 10, 5, 5));
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  mask.Apply(picture, 1);
  EXPECT_EQ(mask.Masked(), (std::vector<cv::Rect>{{0, 0, 320, 240}}));
}

TEST(PrivacyMask, ARegionBeyondTheEdgeIsMaskedAsFarAsItIsInThePicture) {
  const std::vector<cv::Rect> told = {{-20, -20, 60, 60}, {300, 230, 100, 100}, {700, 500, 5, 5}};
  PrivacyMask mask({}, std::make_unique<ToldFinder>(told));
  cv::Mat picture = Street();
  EXPECT_NO_THROW(mask.Apply(picture, 1));
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 0), picture.at<cv::Vec3b>(3, 3)) << "one block";
}

TEST(PrivacyMask, WithoutDetectorThereIsNoMaskAndSoNoPicture) {
  PrivacyMask::Config config;
  config.regions.cascades = "/nowhere";
  try {
    PrivacyMask mask(config);
    FAIL() << "a mask without detectors";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/haarcascade"), std::string::npos)
        << error.what();
  }
}

TEST(PrivacyMask, AModelThatIsNoneIsRefused) {
  PrivacyMask::Config config;
  config.regions.face_model = testing::TempDir() + "no_model.onnx";
  std::ofstream(config.regions.face_model) << "this is no network";
  EXPECT_THROW(PrivacyMask mask(config), Error);
  config.regions.face_model = "/nowhere.onnx";
  EXPECT_THROW(PrivacyMask mask(config), Error);
}

TEST(PrivacyMask, APictureThatCannotBeLookedAtIsRefused) {
  PrivacyMask mask({});
  cv::Mat grey(10, 10, CV_8UC1, cv::Scalar(0));
  EXPECT_THROW(mask.Apply(grey, 1), Error);
  cv::Mat empty;
  EXPECT_THROW(mask.Apply(empty, 1), Error);
}

}  // namespace
}  // namespace livemap::perception
