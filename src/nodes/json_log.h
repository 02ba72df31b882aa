#pragma once

#include <string>

namespace livemap::nodes {

/// From now on the program's log on standard output and standard error is lines of JSON
/// (web/json/log_line.h), warnings and worse on standard error. rosout and the log files of ROS
/// stay what they are. To be called once, before other threads log; `node` names the program.
void LogAsJson(const std::string& node);

/// One sentence about why the program ends, on standard error: as JSON after LogAsJson, else after
/// the program's name.
void LogTheEnd(const std::string& node, const std::string& sentence);

}  // namespace livemap::nodes
