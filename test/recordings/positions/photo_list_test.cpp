#include "recordings/positions/photo_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"
#include "common/utc_text.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string PhotoRefusal(const std::string& json) {
  try {
    ParsePhotoList(json, std::nullopt, "photos");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string PhotoEntry(const std::string& name, const std::string& more) {
  return "{\"SourceFile\":\"" + name + "\",\"GPSLatitude\":48.25,\"GPSLongitude\":-9.5" + more +
         "}";
}

TEST(PhotoList, PhotosAreInTheOrderOfTheirCameraTimes) {
  const PhotoList list = ParsePhotoList(
      "[" + PhotoEntry("b.jpg", ",\"SubSecDateTimeOriginal\":\"2026:01:31 14:34:57.5+02:00\"") +
          "," +
          PhotoEntry("a.jpg",
                     ",\"DateTimeOriginal\":\"2026:01:31 14:34:56\","
                     "\"OffsetTimeOriginal\":\"+02:00\",\"GPSSpeed\":36,"
                     "\"GPSSpeedRef\":\"K\"") +
          "]",
      std::nullopt, "photos");
  ASSERT_THAT(list.photos, SizeIs(2));
  EXPECT_EQ(list.photos[0].path, "a.jpg");
  EXPECT_NEAR(*list.photos[0].position.speed_mps, 10, 1e-9);
  EXPECT_EQ(Rfc3339(list.photos[1].position.stamp_ns), "2026-01-31T12:34:57.500Z");
}

TEST(PhotoList, TheZoneOfTheCamerasClockComesFromTheReceiver) {
  const PhotoList list = ParsePhotoList(
      "[" +
          PhotoEntry("a.jpg",
                     ",\"DateTimeOriginal\":\"2026:01:31 14:34:58\","
                     "\"GPSDateTime\":\"2026:01:31 12:34:56Z\"") +
          "," + PhotoEntry("b.jpg", ",\"DateTimeOriginal\":\"2026:01:31 14:35:00\"") + "]",
      std::nullopt, "photos");
  EXPECT_EQ(Rfc3339(list.photos[1].position.stamp_ns), "2026-01-31T12:35:00.000Z");
  EXPECT_THAT(list.notes, Contains(HasSubstr("120 minutes ahead of UTC")));
}

TEST(PhotoList, WhatCannotBePlacedIsRefusedByItsName) {
  const std::string timed = ",\"DateTimeOriginal\":\"2026:01:31 14:34:58\"";
  EXPECT_THAT(
      PhotoRefusal("[" + PhotoEntry("a.jpg", timed) + "," + PhotoEntry("b.jpg", timed) + "]"),
      HasSubstr("the photo 'a.jpg' has a time without a zone: --time-zone"));
  EXPECT_THAT(PhotoRefusal("[" + PhotoEntry("a.jpg", ",\"DateTimeOriginal\":\"soon\"") + "]"),
              HasSubstr("the photo 'a.jpg' has the time 'soon'"));
  EXPECT_THAT(PhotoRefusal("[{\"SourceFile\":\"a.jpg\",\"GPSLatitude\":99,\"GPSLongitude\":1}]"),
              HasSubstr("the photo 'a.jpg' has the position '99, 1'"));
  EXPECT_THAT(PhotoRefusal("[{\"SourceFile\":\"a.jpg\"}]"), HasSubstr("'photos' has 0 photos"));
  EXPECT_THAT(PhotoRefusal("{}"), HasSubstr("no list of photos"));
  EXPECT_THAT(PhotoRefusal("[3]"), HasSubstr("entry 1"));
}

}  // namespace
}  // namespace livemap::recordings
