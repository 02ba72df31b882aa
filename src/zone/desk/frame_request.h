#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/uuid.h"
#include "protocol/poll.h"

namespace livemap::zone {

/// An official's wish to see a hazard in a whole frame: the next vehicles that pass are asked for
/// one until it comes. There is at most one open request per hazard.
struct FrameRequest {
  std::uint64_t decision = 0;  ///< Id of the decision that made it.
  Uuid hazard;
  std::string official;
  std::int64_t asked_ns = 0;  ///< Zone clock.
  std::int64_t until_ns = 0;  ///< Zone clock; it is open up to and including this moment.
};

/// What became of a request.
enum class FrameState {
  kWaiting,    ///< No frame has come yet, and there is time left.
  kTaken,      ///< A frame has come.
  kTimedOut,   ///< No vehicle brought one in time.
  kCancelled,  ///< An official took the request back.
};

/// "waiting", "taken", "timed_out" or "cancelled".
constexpr const char* FrameStateName(FrameState state) {
  switch (state) {
    case FrameState::kWaiting:
      return "waiting";
    case FrameState::kTaken:
      return "taken";
    case FrameState::kTimedOut:
      return "timed_out";
    case FrameState::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

/// A picture that came with an answer to a poll, as the store keeps it; of whom is not told.
struct AnswerPicture {
  std::int64_t stamp_ns = 0;  ///< Of the image.
  protocol::PollAnswer::Answer answer = protocol::PollAnswer::Answer::kCantSee;
  double confidence = 0;       ///< 0..1, of yes and no.
  std::string image_sha256;    ///< 64 hex digits.
  std::uint64_t decision = 0;  ///< Of the request whose whole frame it is; 0: a poll's own picture.
};

/// The newest request about a hazard.
struct FrameStatus {
  FrameRequest request;
  FrameState state = FrameState::kWaiting;
  std::optional<AnswerPicture> picture;  ///< Where it was taken.
};

}  // namespace livemap::zone
