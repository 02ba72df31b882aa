#pragma once

#include <std_msgs/ColorRGBA.h>

#include "protocol/hazard_catalogue.h"

namespace livemap::ros_io {

/// The colour that the catalogue gives a class, for rviz. `alpha` from 0 (clear) to 1.
std_msgs::ColorRGBA ClassColour(const protocol::HazardClass& entry, float alpha);

}  // namespace livemap::ros_io
