#include "change/memory/place_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/error.h"
#include "test/change/memory/place_fixture.h"

namespace livemap::change {
namespace {

template <typename Change>
std::string WhyNotWritten(const Change& change) {
  PlaceRecord record = MakePlace({40, -79}, 1);
  change(record);
  try {
    SerialisePlaceRecord(record);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(PlaceRecord, ComesBackAsItWas) {
  PlaceRecord record = MakePlace({40.4433, -79.9436}, 3);
  record.frame.position_sigma_m = 0.75;
  record.frame.drive_id = "monday's \"drive\"\n";
  const PlaceRecord back = ParsePlaceRecord(SerialisePlaceRecord(record), "it");
  EXPECT_EQ(back.frame.drive_id, record.frame.drive_id);
  EXPECT_EQ(back.frame.stamp_ns, record.frame.stamp_ns);
  EXPECT_EQ(back.frame.position.latitude_deg, record.frame.position.latitude_deg);
  EXPECT_EQ(back.frame.position.longitude_deg, record.frame.position.longitude_deg);
  EXPECT_EQ(back.frame.position_sigma_m, 0.75);
  EXPECT_EQ(back.frame.heading_rad, record.frame.heading_rad);
  EXPECT_EQ(back.frame.camera.fx, record.frame.camera.fx);
  EXPECT_EQ(back.frame.camera.height, record.frame.camera.height);
  EXPECT_EQ(back.picture, record.picture);
  EXPECT_EQ(back.features.points, record.features.points);
  EXPECT_EQ(cv::countNonZero(back.features.descriptors != record.features.descriptors), 0);
}

TEST(PlaceRecord, EveryCutIsRefused) {
  const std::string bytes = SerialisePlaceRecord(MakePlace({40, -79}, 4));
  for (std::size_t size = 0; size < bytes.size(); size += 7) {
    EXPECT_THROW(ParsePlaceRecord(bytes.substr(0, size), "cut"), Error) << size;
    EXPECT_THROW(ParsePlaceRecord(bytes.substr(size + 1), "cut"), Error) << size;
  }
}

TEST(PlaceRecord, NoByteChangedAtRandomBreaksTheReader) {
  const std::string bytes = SerialisePlaceRecord(MakePlace({40, -79}, 4));
  std::mt19937_64 random(7);
  for (int i = 0; i < 3000; ++i) {
    std::string changed = bytes;
    for (int j = 0; j < 3; ++j) changed[random() % changed.size()] = static_cast<char>(random());
    try {
      CheckPlaceFrame(ParsePlaceRecord(changed, "changed").frame);
    } catch (const Error& error) {
      EXPECT_NE(error.what()[0], '\0');
    }
  }
}

TEST(PlaceRecord, FieldsThatCannotBeAreNamed) {
  using testing::HasSubstr;
  EXPECT_EQ(WhyNotWritten([](PlaceRecord&) {}), "");
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.drive_id = ""; }), HasSubstr("drive id"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.drive_id = std::string(65, 'x'); }),
              HasSubstr("65 bytes"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.position.latitude_deg = 91; }),
              HasSubstr("position"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.position.longitude_deg = std::nan(""); }),
              HasSubstr("position"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.heading_rad = 7; }), HasSubstr("heading_rad"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.heading_rad = std::nan(""); }),
              HasSubstr("heading_rad"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.position_sigma_m = -1; }),
              HasSubstr("position_sigma_m"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.stamp_ns = 0; }), HasSubstr("stamp_ns"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.camera.fx = 0; }), HasSubstr("fx"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.frame.camera.width = 63; }), HasSubstr("63x48"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.picture.resize(r.picture.size() / 2); }),
              HasSubstr("no whole JPEG"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.features.points.pop_back(); }), HasSubstr("features"));
  EXPECT_THAT(WhyNotWritten([](auto& r) { r.features.points[0].x = std::nanf(""); }),
              HasSubstr("finite"));
}

TEST(PlaceQuality, FallsWithBareRegionsAndAnUncertainPlace) {
  PlaceFrame frame = MakePlace({40, -79}, 1).frame;
  ImageFeatures all;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 8; ++column) {
      all.points.emplace_back(static_cast<float>(column * 8 + 4), static_cast<float>(row * 8 + 4));
    }
  }
  EXPECT_DOUBLE_EQ(PlaceQuality(frame, all), 1);
  frame.position_sigma_m = 3;
  EXPECT_DOUBLE_EQ(PlaceQuality(frame, all), 0.5);
  frame.position_sigma_m = 0;
  ImageFeatures corner;
  for (int i = 0; i < 100; ++i) corner.points.emplace_back(1.0F, 1.0F);
  EXPECT_DOUBLE_EQ(PlaceQuality(frame, corner), 1.0 / 48);
  EXPECT_DOUBLE_EQ(PlaceQuality(frame, {}), 0);
}

}  // namespace
}  // namespace livemap::change
