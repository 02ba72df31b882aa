#pragma once

#include <string>

namespace livemap::tools {

/// A file that the package brings: from its install or source tree as rospack finds it, else `path`
/// as it stands.
std::string SharePath(const std::string& path);

}  // namespace livemap::tools
