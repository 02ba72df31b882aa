#include "recordings/video/clip_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

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
      OrderClips({{"b", 161 * kSecond, 60 * kSecond}, {"a", 100 * kSecond, 60'500'000'000}});
  ASSERT_EQ(sequence.clips.size(), 2U);
  EXPECT_EQ(sequence.clips[0].path, "a");
  EXPECT_EQ(*sequence.clips[1].start_ns, 160'500'000'000);
  EXPECT_TRUE(sequence.notes.empty());
}

TEST(ClipSequence, APauseStays) {
  const ClipSequence sequence =
      OrderClips({{"a", 100 * kSecond, 60 * kSecond}, {"b", 200 * kSecond, 60 * kSecond}});
  EXPECT_EQ(*sequence.clips[1].start_ns, 200 * kSecond);
  EXPECT_THAT(sequence.notes, ::testing::ElementsAre("nothing was recorded for 40 s before 'b'"));
}

TEST(ClipSequence, PiecesWithoutTimesFollowAsTheyAreGiven) {
  const ClipSequence sequence =
      OrderClips({{"b", 100 * kSecond, 60 * kSecond}, {"a", std::nullopt, 60 * kSecond}});
  EXPECT_EQ(sequence.clips[1].path, "a");
  EXPECT_EQ(*sequence.clips[1].start_ns, 160 * kSecond);
}

TEST(ClipSequence, WhatIsNoSequenceIsRefusedByItsFiles) {
  EXPECT_THAT(Refusal({{"a", 100 * kSecond, 60 * kSecond}, {"b", 130 * kSecond, 60 * kSecond}}),
              ::testing::HasSubstr("the videos 'a' and 'b' overlap by 30 s"));
  EXPECT_THAT(Refusal({{"a", std::nullopt, 60 * kSecond}}),
              ::testing::HasSubstr("'a' does not state when it was recorded: --start-time"));
  EXPECT_THAT(Refusal({{"a", kSecond, kSecond}, {"b", std::nullopt, 1}, {"c", kSecond, 1}}),
              ::testing::HasSubstr("'b' does not state when"));
  EXPECT_THAT(Refusal({}), ::testing::HasSubstr("no video"));
}

}  // namespace
}  // namespace livemap::recordings
