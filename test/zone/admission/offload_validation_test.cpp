#include "zone/admission/offload_validation.h"

#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "test/zone/offload/offloaded_frames.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string WhyNot(const protocol::OffloadedFrame& candidate) {
  const auto why = WhyOffloadRefused(candidate, OffloadLimits(), kZoneNowNs);
  return why ? why->sentence : "taken";
}

TEST(CandidateValidation, AnHonestFrameIsTaken) { EXPECT_EQ(WhyNot(CandidateAt(0)), "taken"); }

struct Broken {
  std::string name;
  std::function<void(protocol::OffloadedFrame&)> change;
  std::string said;
};

class BrokenCandidate : public ::testing::TestWithParam<Broken> {};

TEST_P(BrokenCandidate, IsRefusedAndToldWhy) {
  protocol::OffloadedFrame candidate = CandidateAt(0);
  GetParam().change(candidate);
  EXPECT_THAT(WhyNot(candidate), HasSubstr(GetParam().said));
}

INSTANTIATE_TEST_SUITE_P(
    Candidates, BrokenCandidate,
    ::testing::Values(
        Broken{"no_vehicle", [](protocol::OffloadedFrame& c) { c.vehicle_id.clear(); },
               "vehicle_id"},
        Broken{"line_end", [](protocol::OffloadedFrame& c) { c.drive_id = "a\nb"; }, "drive_id"},
        Broken{"score_nan", [](protocol::OffloadedFrame& c) { c.score = std::nanf(""); },
               "confidence"},
        Broken{"latitude_nan",
               [](protocol::OffloadedFrame& c) { c.base.position.latitude_deg = kNan; },
               "position"},
        Broken{"covariance_nan",
               [](protocol::OffloadedFrame& c) { c.base.covariance_m2(0, 0) = kNan; },
               "covariance"},
        Broken{"covariance_none",
               [](protocol::OffloadedFrame& c) { c.base.covariance_m2.setZero(); },
               "positive definite"},
        Broken{"course_nan", [](protocol::OffloadedFrame& c) { c.base.course_rad = kNan; },
               "course"},
        Broken{"course_variance",
               [](protocol::OffloadedFrame& c) { c.base.course_variance_rad2 = -1e-9; },
               "variance of the course"},
        Broken{"correlation", [](protocol::OffloadedFrame& c) { c.base.position_course << 1, 0; },
               "position and course"},
        Broken{"correlation_nan",
               [](protocol::OffloadedFrame& c) { c.base.position_course << kNan, 0; },
               "position and course"},
        Broken{"focal_zero", [](protocol::OffloadedFrame& c) { c.intrinsics.fx = 0; }, "focal"},
        Broken{"focal_nan", [](protocol::OffloadedFrame& c) { c.intrinsics.fy = kNan; }, "focal"},
        Broken{"principal_point", [](protocol::OffloadedFrame& c) { c.intrinsics.cx = kNan; },
               "principal"},
        Broken{"no_width", [](protocol::OffloadedFrame& c) { c.intrinsics.width = -1; },
               "image size"},
        Broken{"other_size", [](protocol::OffloadedFrame& c) { c.intrinsics.width = 641; },
               "intrinsics are of"},
        Broken{"far_camera",
               [](protocol::OffloadedFrame& c) { c.base_from_optical.translation().x() = 1e6; },
               "camera is not"},
        Broken{"camera_nan",
               [](protocol::OffloadedFrame& c) { c.base_from_optical.translation().z() = kNan; },
               "camera is not"},
        Broken{"mirror", [](protocol::OffloadedFrame& c) { c.base_from_optical.linear() *= -1; },
               "rotation"},
        Broken{"rotation_nan",
               [](protocol::OffloadedFrame& c) { c.base_from_optical.linear()(0, 0) = kNan; },
               "rotation"},
        Broken{"future", [](protocol::OffloadedFrame& c) { c.stamp_ns += 3600'000'000'000; },
               "future"},
        Broken{"never_set", [](protocol::OffloadedFrame& c) { c.stamp_ns = -1; }, "stamp"},
        Broken{"frame_id", [](protocol::OffloadedFrame& c) { c.image_frame_id.assign(65, 'x'); },
               "frame_id"},
        Broken{"no_picture", [](protocol::OffloadedFrame& c) { c.image.clear(); }, "no JPEG"},
        Broken{"cut_off", [](protocol::OffloadedFrame& c) { c.image.resize(c.image.size() / 2); },
               "cut off"},
        Broken{"large", [](protocol::OffloadedFrame& c) { c.image.resize(2 << 20); }, "at most"}),
    [](const auto& broken) { return broken.param.name; });

TEST(CandidateValidation, APngIsNoJpeg) {
  protocol::OffloadedFrame candidate = CandidateAt(0);
  candidate.image = {0x89, 'P',  'N', 'G', '\r', '\n', 0x1a, '\n', 0,    0, 0,
                     13,   'I',  'H', 'D', 'R',  0,    0,    2,    0x80, 0, 0,
                     1,    0x90, 8,   2,   0,    0,    0,    0,    0,    0, 0};
  EXPECT_THAT(WhyNot(candidate), HasSubstr("no JPEG"));
}

}  // namespace
}  // namespace livemap::zone
