#include "nodelets/hazard_reporting/recent_images.h"

#include <gmock/gmock.h>

namespace livemap::nodelets {
namespace {

using ::testing::IsNull;
using ::testing::Pointee;

TEST(RecentImages, TheNewestAreKept) {
  RecentImages<int> images(2);
  for (const int stamp : {10, 20, 30}) images.Add(stamp, stamp * 10);
  EXPECT_EQ(images.size(), 2U);
  EXPECT_THAT(images.Find(10), IsNull());
  EXPECT_THAT(images.Find(20), Pointee(200));
  EXPECT_THAT(images.Find(30), Pointee(300));
  EXPECT_THAT(images.Find(25), IsNull());
}

TEST(RecentImages, OnesThatAreWantedStayUntilTheyAreNot) {
  RecentImages<int> images(2);
  images.Want({10});
  for (const int stamp : {10, 20, 30, 40}) images.Add(stamp, stamp * 10);
  EXPECT_THAT(images.Find(10), Pointee(100)) << "wanted";
  EXPECT_THAT(images.Find(20), IsNull());
  EXPECT_THAT(images.Find(40), Pointee(400));
  images.Want({});
  images.Add(50, 500);
  EXPECT_THAT(images.Find(10), IsNull()) << "wanted no longer";
  EXPECT_EQ(images.size(), 2U);
}

TEST(RecentImages, HoweverManyAreWantedNoMoreThanTwiceTheCapacityAreKept) {
  RecentImages<int> images(4);
  std::set<std::int64_t> all;
  for (int stamp = 0; stamp < 100; ++stamp) all.insert(stamp);
  images.Want(all);
  for (int stamp = 0; stamp < 100; ++stamp) images.Add(stamp, stamp);
  EXPECT_EQ(images.size(), 8U);
  EXPECT_THAT(images.Find(99), Pointee(99));
}

TEST(RecentImages, AReleasedImageGoesUnlessItIsWanted) {
  RecentImages<int> images(4);
  images.Want({10});
  images.Add(10, 100);
  images.Add(20, 200);
  images.Release(10);
  images.Release(20);
  images.Release(30);
  EXPECT_THAT(images.Find(10), Pointee(100));
  EXPECT_THAT(images.Find(20), IsNull());
}

TEST(RecentImages, AnImageThatComesLateIsKeptBesideTheOthers) {
  RecentImages<int> images(3);
  images.Add(10, 100);
  images.Add(30, 300);
  images.Add(20, 200);
  EXPECT_THAT(images.Find(10), Pointee(100));
  EXPECT_THAT(images.Find(20), Pointee(200));
  EXPECT_THAT(images.Find(30), Pointee(300));
}

TEST(RecentImages, AStampBeyondAllLatenessForgetsAllOfBefore) {
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  RecentImages<int> images(3);
  images.Add(kHourNs + 10, 100);
  images.Add(kHourNs + 20, 200);
  images.Want({kHourNs + 20});
  images.Add(5, 50);
  EXPECT_EQ(images.size(), 1U);
  EXPECT_THAT(images.Find(5), Pointee(50));
}

TEST(RecentImages, ClearForgetsTheImagesAndWhichOnesAreWanted) {
  RecentImages<int> images(1);
  images.Want({10});
  images.Add(10, 100);
  images.Clear();
  EXPECT_EQ(images.size(), 0U);
  images.Add(10, 100);
  images.Add(20, 200);
  EXPECT_THAT(images.Find(10), IsNull()) << "that it was wanted is of before";
}

TEST(RecentImages, OneStampIsOneImage) {
  RecentImages<int> images(3);
  images.Add(10, 100);
  images.Add(10, 101);
  EXPECT_EQ(images.size(), 1U);
  EXPECT_THAT(images.Find(10), Pointee(101));
}

}  // namespace
}  // namespace livemap::nodelets
