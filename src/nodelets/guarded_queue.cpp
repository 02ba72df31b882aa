#include "nodelets/guarded_queue.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>
#include <exception>
#include <utility>

#include "nodelets/nodelet_support.h"

namespace livemap::nodelets {
namespace {

class GuardedCallback : public ros::CallbackInterface {
 public:
  GuardedCallback(std::string nodelet_name, ros::CallbackInterfacePtr callback)
      : nodelet_name_(std::move(nodelet_name)), callback_(std::move(callback)) {}

  CallResult call() override {
    try {
      return callback_->call();
    } catch (const std::exception& error) {
      ROS_ERROR_THROTTLE(kSayAgainS, "%s: a message could not be worked off: %s",
                         nodelet_name_.c_str(), error.what());
    }
    return Success;
  }
  bool ready() override { return callback_->ready(); }

 private:
  const std::string nodelet_name_;
  const ros::CallbackInterfacePtr callback_;
};

}  // namespace

GuardedQueue::GuardedQueue(std::string nodelet_name, ros::CallbackQueueInterface& queue)
    : nodelet_name_(std::move(nodelet_name)), queue_(queue) {}

void GuardedQueue::addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner_id) {
  queue_.addCallback(boost::make_shared<GuardedCallback>(nodelet_name_, callback), owner_id);
}

void GuardedQueue::removeByID(std::uint64_t owner_id) { queue_.removeByID(owner_id); }

}  // namespace livemap::nodelets
