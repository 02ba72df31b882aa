#include "tools/common/share_path.h"

#include <ros/package.h>

namespace livemap::tools {

std::string SharePath(const std::string& path) {
  const std::string package = ros::package::getPath("livemap");
  return package.empty() ? path : package + "/" + path;
}

}  // namespace livemap::tools
