#include "perception/privacy/picture_masker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "common/error.h"

namespace livemap::perception {
namespace {

const cv::Rect kFace(20, 20, 20, 20);

/// Finds what may be a face at kFace in every picture; nothing where it is told so, or breaks.
class OneFace final : public PrivateRegionFinder {
 public:
  OneFace(const bool& breaks, const bool& finds) : breaks_(breaks), finds_(finds) {}
  std::vector<PrivateRegion> Find(const cv::Mat&, const cv::Rect&) override {
    if (breaks_) throw std::runtime_error("no memory");
    if (!finds_) return {};
    return {{kFace, /*is_sure=*/false}};
  }

 private:
  const bool& breaks_;
  const bool& finds_;
};

class PictureMaskerTest : public ::testing::Test {
 protected:
  PictureMaskerTest()
      : masker_(std::make_unique<PrivacyMask>(PrivacyMask::Config{},
                                              std::make_unique<OneFace>(breaks_, finds_))) {
    cv::RNG random(3);
    random.fill(image_, cv::RNG::UNIFORM, 0, 256);
    before_ = image_.clone();
  }

  bool IsUnchanged() const { return cv::norm(image_, before_, cv::NORM_INF) == 0; }
  static double DifferenceIn(const cv::Mat& a, const cv::Mat& b, const cv::Rect& part) {
    return cv::norm(a(part), b(part), cv::NORM_INF);
  }

  bool breaks_ = false;
  bool finds_ = true;
  PictureMasker masker_;
  cv::Mat image_ = cv::Mat(120, 160, CV_8UC3);
  cv::Mat before_;
  const cv::Rect whole_{0, 0, 160, 120};
};

TEST_F(PictureMaskerTest, MasksACopyAndLeavesTheCamerasImage) {
  const PictureMasker::Masked masked = masker_.Mask(image_, 1, whole_);
  EXPECT_GT(DifferenceIn(masked.bgr, before_, kFace), 0);
  EXPECT_EQ(DifferenceIn(masked.bgr, before_, {80, 60, 60, 60}), 0);
  EXPECT_TRUE(IsUnchanged()) << "others look at it too";
  EXPECT_EQ(masker_.counters().masked_regions, 1u);
  EXPECT_EQ(masker_.counters().withheld, 0u);
}

TEST_F(PictureMaskerTest, OnlyTheWantedPartIsClear) {
  const cv::Rect part(80, 60, 40, 40);
  const PictureMasker::Masked masked = masker_.Mask(image_, 1, part);
  EXPECT_EQ(DifferenceIn(masked.bgr, before_, part), 0);
  EXPECT_GT(DifferenceIn(masked.bgr, before_, {0, 80, 40, 40}), 0);
}

TEST_F(PictureMaskerTest, OverASubjectADoubtfulFaceStaysClear) {
  const cv::Mat masked = masker_.Mask(image_, 1, whole_, {{20, 20, 10, 20}}).bgr;
  EXPECT_EQ(DifferenceIn(masked, before_, {20, 20, 10, 20}), 0);
  EXPECT_GT(DifferenceIn(masked, before_, {30, 20, 10, 20}), 0) << "the face's other half";
}

TEST_F(PictureMaskerTest, APictureThatCannotBeMaskedIsWithheld) {
  breaks_ = true;
  const PictureMasker::Masked broken = masker_.Mask(image_, 1, whole_);
  EXPECT_TRUE(broken.bgr.empty());
  EXPECT_EQ(broken.why_withheld, "no memory");
  breaks_ = false;
  EXPECT_TRUE(masker_.Mask(image_, 1, {100, 100, 100, 100}).bgr.empty()) << "beyond the image";
  EXPECT_TRUE(masker_.Mask(cv::Mat(120, 160, CV_8UC1), 1, whole_).bgr.empty()) << "grey";
  EXPECT_TRUE(masker_.Mask(cv::Mat(), 1, whole_).bgr.empty()) << "no image";
  EXPECT_EQ(masker_.counters().withheld, 4u);
  EXPECT_EQ(masker_.counters().masked_regions, 0u);
  EXPECT_FALSE(masker_.Mask(image_, 1, whole_).bgr.empty()) << "the next one may be masked again";
}

TEST_F(PictureMaskerTest, AMaskIsKeptForImagesOfWhichNoPictureIsWanted) {
  PrivacyMask::Config config;
  config.keep_frames = 2;
  bool finds_nothing = false;
  class Fleeting final : public PrivateRegionFinder {
   public:
    explicit Fleeting(const bool& finds_nothing) : finds_nothing_(finds_nothing) {}
    std::vector<PrivateRegion> Find(const cv::Mat&, const cv::Rect&) override {
      if (finds_nothing_) return {};
      return {{kFace, /*is_sure=*/false}};
    }

   private:
    const bool& finds_nothing_;
  };
  PictureMasker masker(
      std::make_unique<PrivacyMask>(config, std::make_unique<Fleeting>(finds_nothing)));
  const auto mask_newest = [&] { return masker.Mask(image_, masker.CountFrame(), whole_).bgr; };
  EXPECT_GT(DifferenceIn(mask_newest(), before_, kFace), 0);
  finds_nothing = true;
  masker.CountFrame();
  EXPECT_GT(DifferenceIn(mask_newest(), before_, kFace), 0) << "two images on";
  EXPECT_EQ(DifferenceIn(mask_newest(), before_, kFace), 0) << "three";
}

TEST_F(PictureMaskerTest, AMaskIsKeptByTheNumberOfTheImageHoweverLateItsPictureIsMade) {
  const std::uint64_t number = masker_.CountFrame();
  for (int i = 0; i < 1000; ++i) masker_.CountFrame();
  masker_.Mask(image_, number, whole_);
  finds_ = false;
  EXPECT_GT(DifferenceIn(masker_.Mask(image_, number + 1, whole_).bgr, before_, kFace), 0)
      << "the image after it, a thousand images later";
}

TEST_F(PictureMaskerTest, TheCountersAreThereWhileAPictureIsMasked) {
  std::promise<void> begun;
  std::promise<void> end;
  class Slow final : public PrivateRegionFinder {
   public:
    Slow(std::promise<void>& begun, std::future<void> end) : begun_(begun), end_(std::move(end)) {}
    std::vector<PrivateRegion> Find(const cv::Mat&, const cv::Rect&) override {
      begun_.set_value();
      end_.wait();
      return {};
    }

   private:
    std::promise<void>& begun_;
    std::future<void> end_;
  };
  PictureMasker masker(std::make_unique<PrivacyMask>(
      PrivacyMask::Config{}, std::make_unique<Slow>(begun, end.get_future())));
  std::thread masking([&] { masker.Mask(image_, 1, whole_); });
  begun.get_future().wait();
  std::future<PictureMasker::Counters> counters =
      std::async(std::launch::async, [&] { return masker.counters(); });
  EXPECT_EQ(counters.wait_for(std::chrono::seconds(20)), std::future_status::ready);
  end.set_value();
  masking.join();
}

TEST_F(PictureMaskerTest, WithoutPrivacyTheImageItselfLeaves) {
  PictureMasker::Config config;
  config.privacy = false;
  PictureMasker masker(config);
  const PictureMasker::Masked masked = masker.Mask(image_, 1, {0, 0, 10, 10});
  EXPECT_EQ(masked.bgr.data, image_.data);
  EXPECT_TRUE(IsUnchanged());
}

TEST_F(PictureMaskerTest, WithoutDetectorsOrMaskThereIsNone) {
  PictureMasker::Config config;
  config.mask.regions.cascades = "/nowhere";
  EXPECT_THROW(PictureMasker{config}, Error);
  EXPECT_THROW(PictureMasker{std::unique_ptr<PrivacyMask>()}, Error);
}

}  // namespace
}  // namespace livemap::perception
