#include "zone/admission/map_change_validation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "test/zone/map_change_fixture.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

std::string Why(const std::function<void(protocol::MapChangeReport&)>& change,
                const ReportLimits& limits = {}) {
  protocol::MapChangeReport report = MakeMapChange();
  change(report);
  const auto refusal = WhyMapChangeRefused(report, limits, kChangeNowNs);
  return refusal ? refusal->sentence : "";
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(MapChangeValidation, AcceptsEveryClassButNoChange) {
  for (const char* name : {"barrier", "bin", "construction", "other_objects", "person_cycle",
                           "rubbish", "sign", "traffic_cone", "vehicle"}) {
    EXPECT_EQ(Why([&](protocol::MapChangeReport& r) { r.class_name = name; }), "");
  }
  for (const char* name : {"no_change", "pothole", "Barrier"}) {
    EXPECT_THAT(Why([&](protocol::MapChangeReport& r) { r.class_name = name; }),
                HasSubstr("accepted is barrier, bin"));
  }
}

TEST(MapChangeValidation, RefusesHostileTextAndDoesNotRepeatIt) {
  for (const std::string& text : {std::string(), std::string(100000, 'x'), std::string("a\nb"),
                                  std::string("\xff"), std::string("\xe2\x80\xae")}) {
    EXPECT_THAT(Why([&](protocol::MapChangeReport& r) { r.class_name = text; }),
                HasSubstr("class name"));
    EXPECT_THAT(Why([&](protocol::MapChangeReport& r) { r.vehicle_id = text; }),
                HasSubstr("vehicle_id"));
    EXPECT_LT(Why([&](protocol::MapChangeReport& r) { r.class_name = text; }).size(), 200U);
  }
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.drive_id = "a\nb"; }),
              HasSubstr("drive_id"));
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.uuid = Uuid(); }), HasSubstr("uuid"));
}

TEST(MapChangeValidation, RefusesNumbersThatAreNone) {
  for (const double number : {kNan, std::numeric_limits<double>::infinity(), 91.0}) {
    EXPECT_THAT(Why([&](protocol::MapChangeReport& r) { r.position.latitude_deg = number; }),
                HasSubstr("position"));
    EXPECT_THAT(
        Why([&](protocol::MapChangeReport& r) { r.confidence = static_cast<float>(number); }),
        HasSubstr("confidence"));
  }
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.covariance_m2(0, 0) = kNan; }),
              HasSubstr("covariance"));
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.covariance_m2(0, 0) = -1; }),
              HasSubstr("covariance"));
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.seen = 1; }), HasSubstr("at least 2"));
}

TEST(MapChangeValidation, KeepsToTheLimitsOfReports) {
  ReportLimits limits;
  limits.zone = geo::GeoBox{{50, 0}, {51, 1}};
  EXPECT_THAT(Why([](protocol::MapChangeReport&) {}, limits), HasSubstr("outside the zone"));
  EXPECT_THAT(
      Why([](protocol::MapChangeReport& r) { r.stamp_ns = kChangeNowNs + 301 * kSecondNs; }),
      HasSubstr("future"));
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) {
                r.stamp_ns = kChangeNowNs - 31 * 86400 * kSecondNs;
                r.earlier_stamp_ns = r.stamp_ns - 1;
              }),
              HasSubstr("past"));
}

TEST(MapChangeValidation, TheEarlierPictureIsEarlier) {
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.earlier_stamp_ns = r.stamp_ns; }),
              HasSubstr("earlier_stamp"));
  EXPECT_THAT(Why([](protocol::MapChangeReport& r) { r.earlier_stamp_ns = -1; }),
              HasSubstr("earlier_stamp"));
  EXPECT_EQ(Why([](protocol::MapChangeReport& r) { r.earlier_stamp_ns = 0; }), "");
}

}  // namespace
}  // namespace livemap::zone
