#pragma once

#include <livemap/HazardAlert.h>
#include <ros/time.h>

#include "vehicle/alerts/driver_alerts.h"

namespace livemap::ros_io {

/// `stamp` is that of the position, or of the notice, that led to the alert.
HazardAlert ToMessage(const vehicle::HazardAlert& alert, const ros::Time& stamp);

}  // namespace livemap::ros_io
