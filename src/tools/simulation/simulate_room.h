#pragma once

#include <vector>

#include "tools/common/command_line.h"

namespace livemap::tools {

/// Flags of `livemap simulate --room` and `--wall` alone.
std::vector<Flag> RoomFlags();

/// Whether one of the two is wanted instead of a street.
bool WantsRoom(const CommandLine& line);

/// Renders a hand-held camera in a furnished room or before a patterned wall into a TUM RGB-D
/// folder; returns the exit status. Throws Error naming the flag or the path.
int SimulateRoom(const CommandLine& line);

/// Throws Error when a flag of RoomFlags() is given without --room or --wall.
void RefuseRoomFlags(const CommandLine& line);

}  // namespace livemap::tools
