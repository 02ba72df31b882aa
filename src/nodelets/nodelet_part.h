#pragma once

#include <nodelet/nodelet.h>
#include <ros/node_handle.h>

#include <memory>
#include <string>
#include <utility>

#include "nodelets/guarded_queue.h"
#include "nodelets/nodelet_support.h"

namespace livemap::nodelets {

/// All that one nodelet does and holds: topics, services, timers, threads, state. It lives apart
/// from the nodelet that the manager loads, so that it can be taken down as a whole when its start
/// fails (see PartNodelet). A subclass starts in Initialize; its destructor stops what it started,
/// whatever of it stands.
///
/// Typical usage: `class EdgeVoPart : public NodeletPart`, then
/// `using EdgeVoNodelet = PartNodelet<EdgeVoPart>;` which is exported to pluginlib.
class NodeletPart {
 public:
  /// What the manager gives a nodelet: its name, and handles whose callbacks come one at a time
  /// (`node`, `private_node`) or at the same time (`mt_node`).
  struct Handles {
    std::string name;
    ros::NodeHandle node;
    ros::NodeHandle private_node;
    ros::NodeHandle mt_node;
  };

  NodeletPart() = default;
  virtual ~NodeletPart() = default;
  NodeletPart(const NodeletPart&) = delete;
  NodeletPart& operator=(const NodeletPart&) = delete;

  /// Called once, before Initialize.
  void Bind(const Handles& handles) {
    handles_ = std::make_unique<Handles>(handles);
    queue_ = Guard(handles_->node);
    handles_->private_node.setCallbackQueue(queue_.get());
    mt_queue_ = Guard(handles_->mt_node);
  }
  /// Starts everything. Throws Error with one sentence that names what is wrong.
  virtual void Initialize() = 0;

 protected:
  // As nodelet::Nodelet has them, whose macros (NODELET_WARN and others) ask for getName.
  const std::string& getName() const { return handles_->name; }
  ros::NodeHandle& getNodeHandle() const { return handles_->node; }
  ros::NodeHandle& getPrivateNodeHandle() const { return handles_->private_node; }
  ros::NodeHandle& getMTNodeHandle() const { return handles_->mt_node; }

 private:
  std::unique_ptr<GuardedQueue> Guard(ros::NodeHandle& node) const {
    auto* const queue = static_cast<ros::CallbackQueueInterface*>(node.getCallbackQueue());
    auto guarded = std::make_unique<GuardedQueue>(handles_->name, *queue);
    node.setCallbackQueue(guarded.get());
    return guarded;
  }

  // Destroyed after all that a subclass has made with the handles.
  std::unique_ptr<GuardedQueue> queue_, mt_queue_;
  std::unique_ptr<Handles> handles_;
};

/// The nodelet of a NodeletPart. A part that cannot start is destroyed before onInit leaves:
/// nodelet's loader frees the callback queues of a nodelet whose onInit throws before it frees the
/// nodelet itself, so that a subscriber, service or timer that outlived onInit would reach into a
/// queue that is gone and take the whole manager down.
template <typename Part>
class PartNodelet final : public nodelet::Nodelet {
 private:
  void onInit() override {
    InitializeOrExplain(getName(), [this] {
      auto part = std::make_unique<Part>();
      static_cast<NodeletPart&>(*part).Bind(
          {getName(), getNodeHandle(), getPrivateNodeHandle(), getMTNodeHandle()});
      static_cast<NodeletPart&>(*part).Initialize();
      part_ = std::move(part);
    });
  }

  std::unique_ptr<Part> part_;
};

}  // namespace livemap::nodelets
