#include "zone/registry/shared_view.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

namespace livemap::zone {
namespace {

/// A view takes 1000 ns of a clock that otherwise stands still.
class SharedViewTest : public testing::Test {
 protected:
  std::optional<geo::GeoBox> Make() {
    ++made_;
    now_ns_ += 1000;
    return geo::GeoBox{{1.0 * made_, 2}, {3, 4}};
  }
  /// Which of the views it is.
  double Get() {
    return view_.Get([this] { return Make(); })->south_west.latitude_deg;
  }

  int made_ = 0;
  std::int64_t now_ns_ = 0;
  SharedView view_{[this] { return now_ns_; }};
};

TEST_F(SharedViewTest, IsMadeForAHundredthOfTheTime) {
  EXPECT_EQ(Get(), 1);
  now_ns_ += 99'999;
  EXPECT_EQ(Get(), 1);
  now_ns_ += 1;
  EXPECT_EQ(Get(), 2);
}

TEST_F(SharedViewTest, WhereThereIsNoneThatIsAskedAgainOnlyInTime) {
  for (int i = 0; i < 2; ++i) {
    EXPECT_FALSE(view_.Get([this]() -> std::optional<geo::GeoBox> {
      Make();
      return std::nullopt;
    }));
  }
  EXPECT_EQ(made_, 1);
}

TEST_F(SharedViewTest, AFailureIsToldAndTheNextOneMakesIt) {
  EXPECT_THROW(view_.Get([]() -> std::optional<geo::GeoBox> { throw std::runtime_error("x"); }),
               std::runtime_error);
  EXPECT_EQ(Get(), 1);
}

TEST_F(SharedViewTest, WhoAsksWhileItIsMadeAnewHasTheOneBefore) {
  Get();
  now_ns_ += 1'000'000;
  double other = 0;
  view_.Get([&] {
    std::thread([&] { other = Get(); }).join();
    return Make();
  });
  EXPECT_EQ(other, 1);
  EXPECT_EQ(Get(), 2);
}

TEST_F(SharedViewTest, WhoAsksBeforeThereIsAnyWaitsForIt) {
  double other = 0;
  std::thread asker;
  view_.Get([&] {
    asker = std::thread([&] { other = Get(); });
    return Make();
  });
  asker.join();
  EXPECT_EQ(other, 1);
}

}  // namespace
}  // namespace livemap::zone
