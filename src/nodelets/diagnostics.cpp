#include "nodelets/diagnostics.h"

#include <utility>

namespace livemap::nodelets {

Diagnostics::Diagnostics(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
                         const Config& config, Describe describe)
    : updater_(node, private_node, config.nodelet_name) {
  updater_.setHardwareID(config.hardware_id);
  updater_.add(config.line, std::move(describe));
  timer_ =
      node.createSteadyTimer(ros::WallDuration(config.period_s),
                             [this](const ros::SteadyTimerEvent&) { updater_.force_update(); });
}

Diagnostics::~Diagnostics() { timer_.stop(); }

}  // namespace livemap::nodelets
