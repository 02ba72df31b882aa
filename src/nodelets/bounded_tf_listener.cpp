#include "nodelets/bounded_tf_listener.h"

#include <ros/console.h>
#include <tf2/exceptions.h>

#include "nodelets/nodelet_support.h"

namespace livemap::nodelets {
namespace {

constexpr std::size_t kMaxFrames = 1000;  // A publisher that makes up frames must not fill memory.

StampGates::Config TransformGates(double max_ahead_s) {
  StampGates::Config config;
  config.gate.max_ahead_s = max_ahead_s;
  // tf itself sorts what comes late.
  config.gate.set_back_s = 10;
  // One transform of before makes tf refuse those that come: it has to be forgotten, too.
  config.together_s = 0;
  return config;
}

}  // namespace

BoundedTfListener::BoundedTfListener(tf2::BufferCore& buffer, const ros::NodeHandle& node,
                                     double max_ahead_s)
    : buffer_(buffer), gates_(TransformGates(max_ahead_s)), spinner_(1, &queue_) {
  ros::NodeHandle own(node);
  own.setCallbackQueue(&queue_);
  transforms_ = own.subscribe("/tf", 100, &BoundedTfListener::OnTransforms, this);
  static_transforms_ =
      own.subscribe("/tf_static", 100, &BoundedTfListener::OnStaticTransforms, this);
  buffer_.setUsingDedicatedThread(true);
  spinner_.start();
}

BoundedTfListener::~BoundedTfListener() {
  transforms_.shutdown();
  static_transforms_.shutdown();
  spinner_.stop();
}

void BoundedTfListener::OnTransforms(const ros::MessageEvent<tf2_msgs::TFMessage const>& event) {
  const std::int64_t now_ns = RosNowNs();
  const double steady_s = SteadyS();
  for (const geometry_msgs::TransformStamped& transform : event.getConstMessage()->transforms) {
    const std::string& frame = transform.child_frame_id;
    if (gates_.size() >= kMaxFrames && !gates_.Knows(frame)) continue;
    const auto stamp_ns = static_cast<std::int64_t>(transform.header.stamp.toNSec());
    const StampGates::Judgement judgement = gates_.Judge(frame, stamp_ns, now_ns, steady_s);
    // tf's own clear leaves static transforms as they are.
    if (judgement.begins_anew) buffer_.clear();
    if (StampGate::IsUsable(judgement.verdict)) {
      Set(transform, event.getPublisherName(), false);
      continue;
    }
    ROS_WARN_THROTTLE(kSayAgainS, "dropped a transform to '%s' of '%s': its stamp is %.3f",
                      frame.c_str(), event.getPublisherName().c_str(),
                      transform.header.stamp.toSec());
  }
}

void BoundedTfListener::OnStaticTransforms(
    const ros::MessageEvent<tf2_msgs::TFMessage const>& event) {
  for (const geometry_msgs::TransformStamped& transform : event.getConstMessage()->transforms) {
    Set(transform, event.getPublisherName(), true);
  }
}

void BoundedTfListener::Set(const geometry_msgs::TransformStamped& transform,
                            const std::string& publisher, bool is_static) {
  try {
    buffer_.setTransform(transform, publisher, is_static);
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "dropped a transform of '%s': %s", publisher.c_str(),
                      error.what());
  }
}

}  // namespace livemap::nodelets
