#pragma once

#include <livemap/HazardAlert.h>
#include <ros/time.h>

#include "vehicle/alerts/driver_alerts.h"

namespace livemap::ros_io {

/// `stamp` is that of the position, or of the notice, that led to the alert.
HazardAlert ToMessage(const vehicle::HazardAlert& alert, const ros::Time& stamp);

/// Throws Error for a state or side that there is not, and for a distance or time that is no number
/// from 0 on.
vehicle::HazardAlert FromMessage(const HazardAlert& message);

}  // namespace livemap::ros_io
