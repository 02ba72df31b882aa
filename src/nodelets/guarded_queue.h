#pragma once

#include <ros/callback_queue_interface.h>

#include <string>

namespace livemap::nodelets {

/// The callback queue of a nodelet as its own handles see it: an exception that leaves a callback
/// is an error in the log, not the end of the manager with all its nodelets. Thread-safe.
class GuardedQueue : public ros::CallbackQueueInterface {
 public:
  /// `queue` outlives this, and this all handles, subscribers and timers that were made with it.
  GuardedQueue(std::string nodelet_name, ros::CallbackQueueInterface& queue);

  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner_id) override;
  void removeByID(std::uint64_t owner_id) override;

 private:
  const std::string nodelet_name_;
  ros::CallbackQueueInterface& queue_;
};

}  // namespace livemap::nodelets
