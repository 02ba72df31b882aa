#include "nodelets/hazard_detection/recent_pictures.h"

#include <gtest/gtest.h>

namespace livemap::nodelets {
namespace {

TEST(RecentPictures, TheNewestAreKept) {
  RecentPictures<int> pictures(2);
  for (const int stamp : {10, 20, 30}) pictures.Add(stamp, stamp * 10, {});
  EXPECT_EQ(pictures.size(), 2U);
  EXPECT_EQ(pictures.Find(10), std::nullopt);
  EXPECT_EQ(pictures.Find(20), 200);
  EXPECT_EQ(pictures.Find(30), 300);
  EXPECT_EQ(pictures.Find(25), std::nullopt);
}

TEST(RecentPictures, OnesThatAreWantedStayUntilTheyAreNot) {
  RecentPictures<int> pictures(2);
  for (const int stamp : {10, 20, 30, 40}) pictures.Add(stamp, stamp * 10, {10});
  EXPECT_EQ(pictures.Find(10), 100) << "wanted";
  EXPECT_EQ(pictures.Find(20), std::nullopt);
  EXPECT_EQ(pictures.Find(40), 400);
  pictures.Add(50, 500, {});
  EXPECT_EQ(pictures.Find(10), std::nullopt) << "wanted no longer";
  EXPECT_EQ(pictures.size(), 2U);
}

TEST(RecentPictures, AStampThatGoesBackForgetsAll) {
  RecentPictures<int> pictures(3);
  pictures.Add(10, 100, {});
  pictures.Add(20, 200, {});
  pictures.Add(5, 50, {20});
  EXPECT_EQ(pictures.size(), 1U);
  EXPECT_EQ(pictures.Find(5), 50);
}

TEST(RecentPictures, OneStampIsOnePicture) {
  RecentPictures<int> pictures(3);
  pictures.Add(10, 100, {});
  pictures.Add(10, 101, {});
  EXPECT_EQ(pictures.size(), 1U);
  EXPECT_EQ(pictures.Find(10), 101);
}

}  // namespace
}  // namespace livemap::nodelets
