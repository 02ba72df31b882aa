#pragma once

#include <string>
#include <vector>

namespace livemap::tools {

/// What the program exiftool (Debian's libimage-exiftool-perl) prints when it is called with these
/// arguments; no shell reads them. Its warnings are left aside, and so is its exit status, by which
/// it also tells of single files that it cannot read. Throws Error where it cannot be started or
/// prints more than 256 MiB.
std::string AskExiftool(const std::vector<std::string>& arguments);

}  // namespace livemap::tools
