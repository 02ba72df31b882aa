#pragma once

#include <livemap/CandidateFrame.h>

#include "protocol/offloaded_frame.h"

namespace livemap::ros_io {

CandidateFrame ToMessage(const protocol::OffloadedFrame& candidate);
/// Throws Error, with one sentence that says why, for a schema version that this program does not
/// know, an image side beyond what an int holds, or a mounting that is no rotation and translation;
/// other ranges of values are the receiver's business (WhyOffloadRefused).
protocol::OffloadedFrame FromMessage(const CandidateFrame& message);

}  // namespace livemap::ros_io
