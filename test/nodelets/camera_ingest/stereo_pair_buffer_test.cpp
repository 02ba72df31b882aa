#include "nodelets/camera_ingest/stereo_pair_buffer.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <thread>

namespace livemap::nodelets {
namespace {

/// Stamped `milliseconds` after ten seconds.
ros::Time At(int milliseconds) { return ros::Time(10) + ros::Duration(milliseconds * 1e-3); }

IngestFrame Frame(int milliseconds) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = At(milliseconds);
  return {image, nullptr};
}

/// Stamp of the partner, milliseconds as above; -1 without one.
int Partner(StereoPairBuffer& rights, int milliseconds) {
  const std::optional<IngestFrame> partner = rights.Take(At(milliseconds));
  if (!partner) return -1;
  return static_cast<int>((partner->header().stamp - ros::Time(10)).toNSec() / 1000000);
}

TEST(StereoPairBuffer, PairsEqualStampsOnlyWithoutTolerance) {
  StereoPairBuffer rights(0, 0, 10);
  for (const int stamp : {0, 100, 201, 300}) rights.Put(Frame(stamp));
  EXPECT_EQ(Partner(rights, 100), 100);
  EXPECT_EQ(Partner(rights, 200), -1);
  EXPECT_EQ(Partner(rights, 300), 300);
  EXPECT_EQ(rights.counters().in, 4U);
  EXPECT_EQ(rights.counters().unpaired, 2U) << "0 and 201";
}

TEST(StereoPairBuffer, PairsTheNearestWithinTheTolerance) {
  StereoPairBuffer rights(0.010, 0, 10);
  for (const int stamp : {92, 97, 104, 191, 211}) rights.Put(Frame(stamp));
  EXPECT_EQ(Partner(rights, 100), 97);
  EXPECT_EQ(Partner(rights, 200), 191);
  EXPECT_EQ(Partner(rights, 222), -1);
}

TEST(StereoPairBuffer, KeepsAsManyAsItMay) {
  StereoPairBuffer rights(0, 0, 2);
  for (const int stamp : {0, 100, 200}) rights.Put(Frame(stamp));
  EXPECT_EQ(Partner(rights, 0), -1);
  EXPECT_EQ(Partner(rights, 100), 100);
  EXPECT_EQ(rights.counters().unpaired, 1U);
}

TEST(StereoPairBuffer, AnImageThatComesLateIsPairedAndSoAreTheOthers) {
  StereoPairBuffer rights(0, 0, 10);
  for (const int stamp : {100, 300, 200, 400}) rights.Put(Frame(stamp));
  for (const int stamp : {100, 200, 300, 400}) EXPECT_EQ(Partner(rights, stamp), stamp);
  EXPECT_EQ(rights.counters().unpaired, 0U);
}

TEST(StereoPairBuffer, BeginAnewWhenTimeIsSetBack) {
  StereoPairBuffer rights(0, 0, 10);
  for (const int stamp : {5000, 6000, 0}) rights.Put(Frame(stamp));
  EXPECT_EQ(Partner(rights, 0), 0);
  EXPECT_EQ(rights.counters().unpaired, 2U);
}

TEST(StereoPairBuffer, AreWaitedForAndTheWaitEndsWhenOneIsTooLate) {
  constexpr double kForeverS = 1e6;
  StereoPairBuffer rights(0, kForeverS, 10);
  std::thread camera([&] { rights.Put(Frame(100)); });
  EXPECT_EQ(Partner(rights, 100), 100);
  camera.join();
  std::thread late([&] { rights.Put(Frame(300)); });
  EXPECT_EQ(Partner(rights, 200), -1) << "one after it came: its own does not come any more";
  late.join();
  std::thread end([&] { rights.Close(); });
  EXPECT_EQ(Partner(rights, 400), -1);
  end.join();
}

}  // namespace
}  // namespace livemap::nodelets
