#include "recordings/video/video_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "common/error.h"
#include "common/utc_text.h"
#include "test/support/temporary_directory.h"

namespace livemap::recordings {
namespace {

/// Films of three frames of 64x48 pixels, 5 per second; `turned.mov` is shown standing.
std::string Film(const std::string& name) {
  return std::string(LIVEMAP_SOURCE_DIR) + "/test/fuzz/corpus/video_file_fuzz/" + name;
}

std::string Refusal(const std::string& path) {
  try {
    VideoFile(path, {});
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(VideoFile, FramesHaveTheTimesThatTheFileStates) {
  VideoFile video(Film("film.mp4"), {});
  EXPECT_EQ(video.size(), cv::Size(64, 48));
  EXPECT_EQ(Rfc3339(video.creation_ns().value_or(0)), "2026-01-31T12:34:56.000Z");
  EXPECT_EQ(video.duration_ns(), 600'000'000);
  std::vector<std::int64_t> times_ns;
  while (const auto frame = video.Next()) {
    times_ns.push_back(frame->time_ns);
    EXPECT_EQ(frame->image.size(), cv::Size(64, 48));
    EXPECT_EQ(frame->image.type(), CV_8UC3);
  }
  EXPECT_THAT(times_ns, ::testing::ElementsAre(0, 200'000'000, 400'000'000));
}

TEST(VideoFile, AFilmThatLiesIsTurnedUpright) {
  VideoFile video(Film("turned.mov"), {24, true});
  EXPECT_EQ(video.size(), cv::Size(48, 64));
  const auto frame = video.Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.size(), cv::Size(24, 32));
  EXPECT_EQ(frame->image.type(), CV_8UC1);
}

TEST(VideoFile, WhatIsNoVideoIsRefusedByItsName) {
  EXPECT_THAT(Refusal("/nowhere.mp4"), ::testing::HasSubstr("'/nowhere.mp4' does not exist"));
  const test::TemporaryDirectory folder;
  const std::string text = folder.path() + "/text.mp4";
  std::ofstream(text) << "#EXTM3U\n/etc/passwd\n";
  EXPECT_THAT(Refusal(text), ::testing::HasSubstr("text.mp4' is no whole video file"));
  const std::string half = folder.path() + "/half.mp4";
  std::filesystem::copy_file(Film("film.mp4"), half);
  std::filesystem::resize_file(half, 400);
  EXPECT_THAT(Refusal(half), ::testing::HasSubstr("half.mp4'"));
}

}  // namespace
}  // namespace livemap::recordings
