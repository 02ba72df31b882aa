#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace livemap {

/// The parts of a list as people write it, "a, b": what lies between its commas, without the blanks
/// around. A part may be empty, as the second of "a,,b" is. Behind the last comma is one only where
/// there is more than blanks; a list of blanks has none.
inline std::vector<std::string> SplitAtCommas(const std::string& list) {
  constexpr char kBlanks[] = " \t\n";
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (list.find_first_not_of(kBlanks, begin) != std::string::npos) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string part = list.substr(begin, end - begin);
    const std::size_t first = std::min(part.find_first_not_of(kBlanks), part.size());
    parts.push_back(part.substr(first, part.find_last_not_of(kBlanks) + 1 - first));
    begin = std::min(end + 1, list.size());
  }
  return parts;
}

}  // namespace livemap
