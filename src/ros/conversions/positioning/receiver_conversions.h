#pragma once

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <sensor_msgs/NavSatFix.h>

#include <cstdint>
#include <string>

#include "receiver/receiver_fix.h"

namespace livemap::ros_io {

/// The fix of the antenna, whose frame is `frame`. What is not known is NaN (the altitude) or has a
/// variance of 1e6 m^2; the type of the covariance is "unknown" where the plane's is.
sensor_msgs::NavSatFix ToMessage(const receiver::ReceiverFix& fix, const std::string& frame);

/// That the receiver has no fix: no position, no covariance.
sensor_msgs::NavSatFix NoFixMessage(std::int64_t stamp_ns, const std::string& frame);

/// The velocity of the antenna over ground along east, north and up, whatever the axes of `frame`.
/// What is not known, the rotation among it, is 0 with a variance of 1e6.
geometry_msgs::TwistWithCovarianceStamped ToMessage(const receiver::ReceiverVelocity& velocity,
                                                    const std::string& frame);

}  // namespace livemap::ros_io
