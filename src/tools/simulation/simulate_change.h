#pragma once

#include <vector>

#include "tools/common/command_line.h"

namespace livemap::tools {

/// Flags of `livemap simulate --change DIR` alone.
std::vector<Flag> ChangeFlags();

/// Renders two passes of one street and writes the pairs with the truth about what changed; returns
/// the exit status. Throws Error naming the flag or the path.
int SimulateChange(const CommandLine& line);

/// Throws Error when a flag of ChangeFlags() is given without --change.
void RefuseChangeFlags(const CommandLine& line);

}  // namespace livemap::tools
