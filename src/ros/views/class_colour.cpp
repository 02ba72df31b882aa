#include "ros/views/class_colour.h"

#include <cstdlib>

namespace livemap::ros_io {

std_msgs::ColorRGBA ClassColour(const protocol::HazardClass& entry, float alpha) {
  const long rgb = std::strtol(entry.colour.c_str() + 1, nullptr, 16);  // "#rrggbb"
  std_msgs::ColorRGBA colour;
  colour.r = static_cast<float>((rgb >> 16) & 0xff) / 255.0F;
  colour.g = static_cast<float>((rgb >> 8) & 0xff) / 255.0F;
  colour.b = static_cast<float>(rgb & 0xff) / 255.0F;
  colour.a = alpha;
  return colour;
}

}  // namespace livemap::ros_io
