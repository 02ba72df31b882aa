#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <string>

#include "nodelets/stamp_gates.h"

namespace livemap::nodelets {

/// Fills a tf buffer from /tf and /tf_static on a thread of its own, as tf2_ros::TransformListener
/// does, but believes no stamp that StampGate refuses: one transform of the future would make tf
/// take all later ones for old. When time is set back, what tf knows of the moving frames is
/// forgotten once for all of them; static transforms stay.
class BoundedTfListener {
 public:
  /// `buffer` outlives this. `max_ahead_s`: see StampGate::Config.
  BoundedTfListener(tf2::BufferCore& buffer, const ros::NodeHandle& node, double max_ahead_s);
  ~BoundedTfListener();
  BoundedTfListener(const BoundedTfListener&) = delete;
  BoundedTfListener& operator=(const BoundedTfListener&) = delete;

 private:
  void OnTransforms(const ros::MessageEvent<tf2_msgs::TFMessage const>& event);
  void OnStaticTransforms(const ros::MessageEvent<tf2_msgs::TFMessage const>& event);
  void Set(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
           bool is_static);

  tf2::BufferCore& buffer_;
  StampGates gates_;  ///< By child frame; the thread's.
  ros::CallbackQueue queue_;
  ros::Subscriber transforms_, static_transforms_;
  ros::AsyncSpinner spinner_;
};

}  // namespace livemap::nodelets
