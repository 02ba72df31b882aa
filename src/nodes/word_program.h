#pragma once

#include <functional>
#include <string>
#include <vector>

namespace livemap::nodes {

/// main() of a program that people start by hand, such as `livemap zone user`: its exit status.
/// Prints `help` where any of the words is --help or -h, and gives 0; else hands the words behind
/// the program's name to `body`. What that throws is printed as "NAME: ..." and gives 2; output
/// that cannot be written, as on a full disk, gives 1.
int RunWordProgram(const char* name, const char* help, int argc, char** argv,
                   const std::function<void(const std::vector<std::string>&)>& body);

}  // namespace livemap::nodes
