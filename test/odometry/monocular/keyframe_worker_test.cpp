#include "odometry/monocular/keyframe_worker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <opencv2/imgproc.hpp>
#include <thread>

namespace livemap::odometry {
namespace {

const geo::CameraIntrinsics kWorkerCamera = {250, 250, 159.5, 119.5, 320, 240};

/// Blobs of a random wall, as seen from `x_m` beside its middle, 2 m away.
cv::Mat WorkerWall(double x_m) {
  cv::Mat wall(240, 640, CV_8UC1);
  cv::RNG random(1);
  random.fill(wall, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(wall, wall, {0, 0}, 4);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  const int shift = static_cast<int>(x_m * kWorkerCamera.fx / 2);
  return wall(cv::Rect(160 + shift, 0, 320, 240)).clone();
}

KeyframeWorker::Order WorkerOrder(double x_m, std::int64_t stamp_ns) {
  KeyframeWorker::Order order;
  order.stamp_ns = stamp_ns;
  order.grey = WorkerWall(x_m);
  order.smooth = order.grey.clone();
  order.result.world_from_camera.translation().x() = x_m;
  return order;
}

DepthLearner WorkerLearner() {
  DepthLearner learner({}, kWorkerCamera);
  learner.Restart(WorkerWall(0), Eigen::Isometry3d::Identity());
  return learner;
}

TEST(KeyframeWorker, LearnsOnItsThreadWhatTheFramesThreadWouldLearn) {
  DepthLearner beside = WorkerLearner(), within = WorkerLearner();
  KeyframeWorker worker(beside, 0);
  EXPECT_FALSE(worker.Take()) << "nothing was given";
  for (int i = 1; i <= 5; ++i) {
    const double x_m = 0.08 * i;
    worker.Give(WorkerOrder(x_m, i));
    EXPECT_TRUE(worker.busy());
    std::optional<KeyframeWorker::Made> made;
    while (!(made = worker.Take())) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_FALSE(worker.busy());
    EXPECT_EQ(made->order.stamp_ns, i);
    const KeyframeWorker::Order order = WorkerOrder(x_m, i);
    const LearntDepths learnt = within.Learn({order.smooth, order.result.world_from_camera}, 1, {});
    EXPECT_EQ(cv::norm(made->learnt.depth, learnt.depth, cv::NORM_INF), 0);
    EXPECT_GT(cv::countNonZero(learnt.depth > 0), 100);
  }
}

TEST(KeyframeWorker, HandsOverAFixedNumberOfFramesLaterWhereThatIsWanted) {
  DepthLearner learner = WorkerLearner();
  KeyframeWorker worker(learner, 3);
  worker.Give(WorkerOrder(0.08, 1));
  EXPECT_FALSE(worker.Take());
  EXPECT_FALSE(worker.Take());
  EXPECT_TRUE(worker.Take());
  EXPECT_FALSE(worker.busy());
}

TEST(KeyframeWorker, WaitsForALateKeyframeNoLongerThanItMay) {
  DepthLearner learner = WorkerLearner();
  KeyframeWorker worker(learner, 0);
  EXPECT_FALSE(worker.WaitAndTake(10)) << "nothing was given";
  worker.Give(WorkerOrder(0.08, 1));
  // Learning takes longer than nothing, unless this thread is kept waiting itself.
  const bool is_ready = worker.WaitAndTake(0).has_value();
  EXPECT_NE(worker.busy(), is_ready) << "what is not ready is still to come";
  EXPECT_NE(worker.WaitAndTake(60).has_value(), is_ready);
  EXPECT_FALSE(worker.busy());
}

TEST(KeyframeWorker, WhatIsCancelledOrInWorkAtTheEndIsForgotten) {
  DepthLearner learner = WorkerLearner();
  {
    KeyframeWorker worker(learner, 0);
    worker.Give(WorkerOrder(0.08, 1));
    worker.Cancel();
    EXPECT_FALSE(worker.busy());
    EXPECT_FALSE(worker.Take());
    worker.Give(WorkerOrder(0.16, 2));
  }
  KeyframeWorker delayed(learner, 2);
  delayed.Give(WorkerOrder(0.24, 3));
  delayed.Cancel();
  EXPECT_FALSE(delayed.Take());
}

}  // namespace
}  // namespace livemap::odometry
