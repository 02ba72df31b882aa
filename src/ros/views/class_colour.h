#pragma once

#include <std_msgs/ColorRGBA.h>

#include "protocol/hazard_catalogue.h"

namespace livemap {

/// The colour that the catalogue gives a class, for rviz. `alpha` from 0 (clear) to 1.
std_msgs::ColorRGBA ClassColour(const HazardClass& entry, float alpha);

}  // namespace livemap
