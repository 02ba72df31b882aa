#pragma once

#include "protocol/poll.h"

namespace livemap::protocol {

// What came from outside is a poll, or an answer to one. Both throw Error with one sentence that
// names the value and what is accepted: no nil ids, no numbers that are not finite or out of range,
// no overlong text.

/// For the vehicle: what says it is the zone's.
void CheckPoll(const Poll& poll);
/// For the zone: what a vehicle answers. Its picture and what it claims are judged later, see
/// ZoneService::HandleAnswer.
void CheckAnswer(const PollAnswer& answer);

}  // namespace livemap::protocol
