#pragma once

#include <vector>

#include "tools/command_line.h"

namespace livemap {

/// Flags of `livemap simulate --room` alone.
std::vector<Flag> RoomFlags();

/// Renders a hand-held camera in a furnished room into a TUM RGB-D folder; returns the exit status.
/// Throws Error naming the flag or the path.
int SimulateRoom(const CommandLine& line);

/// Throws Error when a flag of RoomFlags() is given without --room.
void RefuseRoomFlags(const CommandLine& line);

}  // namespace livemap
