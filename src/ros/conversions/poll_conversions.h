#pragma once

#include <livemap/ChangedObjects.h>
#include <livemap/HazardPoll.h>
#include <livemap/HazardPollAnswer.h>

#include <vector>

#include "protocol/poll.h"
#include "vehicle/polls/change_evidence.h"

namespace livemap::ros_io {

// What crosses between the core and the messages of polls, in both directions. FromMessage throws
// Error, with one sentence that names the value and what is accepted, for an unknown schema version
// or enumeration value, nil ids, numbers that are not finite or out of range, and overlong text.

HazardPoll ToMessage(const protocol::Poll& poll);
protocol::Poll FromMessage(const HazardPoll& message);

/// What change detection tells of things that surely went or came; those of unknown direction are
/// left out.
std::vector<vehicle::ChangeEvidence> ToEvidence(const ChangedObjects& message);

HazardPollAnswer ToMessage(const protocol::PollAnswer& answer);
protocol::PollAnswer FromMessage(const HazardPollAnswer& message);

}  // namespace livemap::ros_io
