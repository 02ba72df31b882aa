#include "nodelets/nodelet_support.h"

#include <ros/console.h>
#include <ros/time.h>

#include "common/error.h"

namespace livemap::nodelets {

double SteadyS() { return ros::SteadyTime::now().toSec(); }

void InitializeOrExplain(const std::string& nodelet_name, const std::function<void()>& initialize) {
  try {
    initialize();
  } catch (const Error& error) {
    ROS_FATAL_STREAM(nodelet_name << ": " << error.what());
    throw;
  }
}

}  // namespace livemap::nodelets
