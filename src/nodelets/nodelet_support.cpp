#include "nodelets/nodelet_support.h"

#include <XmlRpcException.h>
#include <ros/console.h>
#include <ros/time.h>

#include <exception>

#include "common/error.h"

namespace livemap::nodelets {

double SteadyS() { return ros::SteadyTime::now().toSec(); }

std::int64_t RosNowNs() { return static_cast<std::int64_t>(ros::Time::now().toNSec()); }

void InitializeOrExplain(const std::string& nodelet_name, const std::function<void()>& initialize) {
  try {
    initialize();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(nodelet_name << ": " << error.what());
    throw;
  } catch (const XmlRpc::XmlRpcException& error) {
    ROS_FATAL_STREAM(nodelet_name << ": a parameter has a wrong type: " << error.getMessage());
    throw Error(error.getMessage());
  }
}

}  // namespace livemap::nodelets
