#include "recordings/video/clip_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

std::string Refusal(std::vector<Clip> clips) {
  try {
    OrderClips(std::move(clips));
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ClipSequence, PiecesFollowOneAnotherWithoutTheGapsOfWholeSeconds) {
  const ClipSequence sequence =
      OrderClips({{"b", 161 * kSecondNs, 60 * kSecondNs}, {"a", 100 * kSecondNs, 60'500'000'000}});
  ASSERT_EQ(sequence.clips.size(), 2U);
  EXPECT_EQ(sequence.clips[0].path, "a");
  EXPECT_EQ(*sequence.clips[1].start_ns, 160'500'000'000);
  EXPECT_TRUE(sequence.notes.empty());
}

TEST(ClipSequence, APauseStays) {
  const ClipSequence sequence =
      OrderClips({{"a", 100 * kSecondNs, 60 * kSecondNs}, {"b", 200 * kSecondNs, 60 * kSecondNs}});
  EXPECT_EQ(*sequence.clips[1].start_ns, 200 * kSecondNs);
  EXPECT_THAT(sequence.notes, ::testing::ElementsAre("nothing was recorded for 40 s before 'b'"));
}

TEST(ClipSequence, PiecesWithoutTimesFollowAsTheyAreGiven) {
  const ClipSequence sequence =
      OrderClips({{"b", 100 * kSecondNs, 60 * kSecondNs}, {"a", std::nullopt, 60 * kSecondNs}});
  EXPECT_EQ(sequence.clips[1].path, "a");
  EXPECT_EQ(*sequence.clips[1].start_ns, 160 * kSecondNs);
}

TEST(ClipSequence, WhatIsNoSequenceIsRefusedByItsFiles) {
  EXPECT_THAT(
      Refusal({{"a", 100 * kSecondNs, 60 * kSecondNs}, {"b", 130 * kSecondNs, 60 * kSecondNs}}),
      ::testing::HasSubstr("the videos 'a' and 'b' overlap by 30 s"));
  EXPECT_THAT(Refusal({{"a", std::nullopt, 60 * kSecondNs}}),
              ::testing::HasSubstr("'a' does not state when it was recorded: --start-time"));
  EXPECT_THAT(Refusal({{"a", kSecondNs, kSecondNs}, {"b", std::nullopt, 1}, {"c", kSecondNs, 1}}),
              ::testing::HasSubstr("'b' does not state when"));
  EXPECT_THAT(Refusal({}), ::testing::HasSubstr("no video"));
}

}  // namespace
}  // namespace livemap::recordings
