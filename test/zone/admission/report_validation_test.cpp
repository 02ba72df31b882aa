#include "zone/admission/report_validation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

std::string Why(const std::function<void(protocol::Report&)>& change,
                const ReportLimits& limits = {}) {
  protocol::Report report = MakeReport();
  change(report);
  const auto refusal = WhyRefused(report, limits, kNowNs);
  return refusal ? refusal->sentence : "";
}

constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(ReportValidation, AcceptsAnOrdinaryReportWithAndWithoutPicture) {
  EXPECT_EQ(Why([](protocol::Report&) {}), "");
  EXPECT_EQ(Why([](protocol::Report& r) { r.image = MakeJpeg(640, 480); }), "");
  EXPECT_EQ(Why([](protocol::Report& r) { r.drive_id.clear(); }), "");
}

TEST(ReportValidation, AcceptsMarkupAndForeignScriptsAsClassNames) {
  EXPECT_EQ(Why([](protocol::Report& r) { r.class_name = "<img src=x onerror=alert(1)>"; }), "");
  EXPECT_EQ(Why([](protocol::Report& r) {
              r.class_name = "trou \xc3\xa9norme \xe7\xa9\xb4 \xf0\x9f\x9a\xa7";
            }),
            "");
}

TEST(ReportValidation, RefusesTextThatIsEmptyLongHiddenOrNoUtf8) {
  for (const std::string& text :
       {std::string(), std::string(65, 'x'), std::string("a\nb"), std::string("a\0b", 3),
        std::string("\x7f"), std::string("\xc2\x85"),
        std::string("\xe2\x80\xae"
                    "abc"),
        std::string("\xe2\x80\x8b"),
        std::string("\xef\xbb\xbf"
                    "a"),
        std::string("\xff"), std::string("\xc0\xaf"), std::string("\xe0\x80\xaf"),
        std::string("\xed\xa0\x80"), std::string("\xf4\x90\x80\x80"), std::string("\xe2\x82"),
        std::string("a\x80")}) {
    EXPECT_THAT(Why([&](protocol::Report& r) { r.class_name = text; }), HasSubstr("class name"));
    EXPECT_THAT(Why([&](protocol::Report& r) { r.vehicle_id = text; }), HasSubstr("vehicle_id"));
  }
  EXPECT_THAT(Why([](protocol::Report& r) { r.drive_id = "a\nb"; }), HasSubstr("drive_id"));
}

TEST(ReportValidation, TheReasonDoesNotRepeatHostileText) {
  const std::string why =
      Why([](protocol::Report& r) { r.class_name = std::string(1000000, 'x'); });
  EXPECT_LT(why.size(), 200U);
}

TEST(ReportValidation, RefusesAReportWithoutUuid) {
  EXPECT_THAT(Why([](protocol::Report& r) { r.uuid = Uuid{}; }), HasSubstr("uuid"));
}

TEST(ReportValidation, RefusesNumbersThatAreNoneOrOutOfRange) {
  EXPECT_THAT(Why([](protocol::Report& r) { r.confidence = kNanF; }), HasSubstr("confidence"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.confidence = 1.01F; }), HasSubstr("confidence"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.confidence = -0.01F; }), HasSubstr("confidence"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.position.latitude_deg = kNan; }),
              HasSubstr("position"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.position.longitude_deg = kInfinity; }),
              HasSubstr("position"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.position.latitude_deg = 91; }),
              HasSubstr("position"));
}

TEST(ReportValidation, RefusesCovariancesThatDescribeNoUncertainty) {
  const auto why = [](double ee, double en, double ne, double nn) {
    return Why([=](protocol::Report& r) { r.covariance_m2 << ee, en, ne, nn; });
  };
  EXPECT_THAT(why(kNan, 0, 0, 1), HasSubstr("finite"));
  EXPECT_THAT(why(1, 0.5, -0.5, 1), HasSubstr("symmetric"));
  EXPECT_THAT(why(1, 2, 2, 1), HasSubstr("positive definite"));
  EXPECT_THAT(why(0, 0, 0, 0), HasSubstr("positive definite"));
  EXPECT_THAT(why(-1, 0, 0, 1), HasSubstr("positive definite"));
  EXPECT_THAT(why(1e9, 0, 0, 1), HasSubstr("exceeds"));
  EXPECT_THAT(why(1e308, 1e308, 1e308, 1e308), HasSubstr("exceeds"));
}

TEST(ReportValidation, RefusesPositionsOutsideTheZoneAlsoAcrossTheAntimeridian) {
  ReportLimits limits;
  limits.zone = geo::GeoBox{{-20, 177}, {-15, -178}};
  const auto why = [&](double latitude, double longitude) {
    return Why([=](protocol::Report& r) { r.position = {latitude, longitude}; }, limits);
  };
  EXPECT_EQ(why(-17, 179), "");
  EXPECT_EQ(why(-17, -179), "");
  EXPECT_THAT(why(-17, 176.9), HasSubstr("outside"));
  EXPECT_THAT(why(-17, 0), HasSubstr("outside"));
  EXPECT_THAT(why(-14, 179), HasSubstr("outside"));
}

TEST(ReportValidation, RefusesStampsOfTheFutureAndOfClocksThatWereNeverSet) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  EXPECT_EQ(Why([](protocol::Report& r) { r.stamp_ns = kNowNs + 299 * kSecond; }), "");
  EXPECT_THAT(Why([](protocol::Report& r) { r.stamp_ns = kNowNs + 301 * kSecond; }),
              HasSubstr("future"));
  EXPECT_THAT(
      Why([](protocol::Report& r) { r.stamp_ns = std::numeric_limits<std::int64_t>::max(); }),
      HasSubstr("future"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.stamp_ns = 0; }), HasSubstr("stamp"));
  EXPECT_THAT(
      Why([](protocol::Report& r) { r.stamp_ns = std::numeric_limits<std::int64_t>::min(); }),
      HasSubstr("stamp"));
}

TEST(ReportValidation, RefusesBoxesThatAreEmptyOrOutsideTheImage) {
  EXPECT_THAT(Why([](protocol::Report& r) { r.image_width = 0; }), HasSubstr("image size"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.image_height = 4000000000U; }),
              HasSubstr("image size"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.box.x_max = r.box.x_min; }), HasSubstr("box"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.box.x_max = 642; }), HasSubstr("box"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.box.y_min = -3; }), HasSubstr("box"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.box.y_max = kNanF; }), HasSubstr("box"));
  EXPECT_EQ(Why([](protocol::Report& r) { r.box = {0, 0, 640, 480}; }), "");
}

TEST(ReportValidation, RefusesShownRegionsThatAreEmptyOrNotWithinTheImage) {
  constexpr std::uint32_t kMost = std::numeric_limits<std::uint32_t>::max();
  for (const imaging::PixelRegion& good :
       {imaging::PixelRegion{}, imaging::PixelRegion{0, 0, 640, 480},
        imaging::PixelRegion{639, 479, 1, 1}, imaging::PixelRegion{100, 50, 240, 160}}) {
    EXPECT_EQ(Why([&](protocol::Report& r) { r.shown = good; }), "");
  }
  for (const imaging::PixelRegion& bad :
       {imaging::PixelRegion{1, 0, 0, 0}, imaging::PixelRegion{0, 0, 10, 0},
        imaging::PixelRegion{0, 0, 641, 480}, imaging::PixelRegion{1, 0, 640, 480},
        imaging::PixelRegion{640, 0, 1, 1}, imaging::PixelRegion{2, 2, kMost, kMost},
        imaging::PixelRegion{kMost, kMost, 2, 2}}) {
    EXPECT_THAT(Why([&](protocol::Report& r) { r.shown = bad; }), HasSubstr("region")) << bad.x;
  }
}

TEST(ReportValidation, RefusesPicturesThatAreLargeForeignOrHuge) {
  ReportLimits limits;
  limits.max_image_bytes = 1000;
  EXPECT_THAT(Why([](protocol::Report& r) { r.image = MakeJpeg(64, 48, 1000); }, limits),
              HasSubstr("bytes"));
  EXPECT_THAT(
      Why([](protocol::Report& r) { r.image = {'G', 'I', 'F', '8', '9', 'a', 1, 0, 1, 0}; }),
      HasSubstr("JPEG"));
  EXPECT_THAT(Why([](protocol::Report& r) { r.image = MakeJpeg(65535, 65535); }),
              HasSubstr("pixels"));
}

}  // namespace
}  // namespace livemap::zone
