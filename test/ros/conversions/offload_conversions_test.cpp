#include "ros/conversions/offload_conversions.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "common/error.h"

namespace livemap::ros_io {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

protocol::OffloadedFrame Example() {
  protocol::OffloadedFrame candidate;
  candidate.vehicle_id = "car-1";
  candidate.drive_id = "drive-1";
  candidate.stamp_ns = 1'700'000'000'123'456'789;
  candidate.score = 0.75F;
  candidate.base.position = {-12.5, 170.25};
  candidate.base.covariance_m2 << 1.5, 0.25, 0.5, 2.5;
  candidate.base.course_rad = 3.5;
  candidate.base.course_variance_rad2 = 0.01;
  candidate.base.position_course << 0.125, -0.25;
  candidate.fused = true;
  candidate.intrinsics = {500, 501, 319.5, 199.5, 640, 400};
  candidate.base_from_optical.linear() =
      (Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(-M_PI / 2 - 0.1, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  candidate.base_from_optical.translation() << 1.5, -0.25, 1.75;
  candidate.image_frame_id = "camera_optical_frame";
  candidate.image = {0xFF, 0xD8, 0xFF};
  return candidate;
}

TEST(CandidateConversions, ACandidateSurvivesTheWayThroughItsMessage) {
  const protocol::OffloadedFrame candidate = Example();
  const CandidateFrame message = ToMessage(candidate);
  EXPECT_EQ(message.image.header.stamp, message.stamp) << "the image's stamp is the frame's";
  EXPECT_EQ(message.covariance[1], 0.25) << "row-major";
  const protocol::OffloadedFrame back = FromMessage(message);
  EXPECT_EQ(back.vehicle_id, candidate.vehicle_id);
  EXPECT_EQ(back.drive_id, candidate.drive_id);
  EXPECT_EQ(back.stamp_ns, candidate.stamp_ns);
  EXPECT_EQ(back.score, candidate.score);
  EXPECT_EQ(back.base.position.latitude_deg, -12.5);
  EXPECT_EQ(back.base.position.longitude_deg, 170.25);
  EXPECT_EQ(back.base.covariance_m2, candidate.base.covariance_m2);
  EXPECT_EQ(back.base.course_rad, 3.5);
  EXPECT_EQ(back.base.course_variance_rad2, 0.01);
  EXPECT_EQ(back.base.position_course, candidate.base.position_course);
  EXPECT_TRUE(back.fused);
  EXPECT_EQ(back.intrinsics.fy, 501);
  EXPECT_EQ(back.intrinsics.cx, 319.5);
  EXPECT_EQ(back.intrinsics.width, 640);
  EXPECT_EQ(back.intrinsics.height, 400);
  EXPECT_TRUE(back.base_from_optical.isApprox(candidate.base_from_optical, 1e-12));
  EXPECT_EQ(back.image_frame_id, candidate.image_frame_id);
  EXPECT_EQ(back.image, candidate.image);
}

TEST(CandidateConversions, AnUnknownVersionIsRefused) {
  CandidateFrame message = ToMessage(Example());
  ++message.schema_version;
  EXPECT_THAT([&] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr("version")));
}

TEST(CandidateConversions, AnImageSideBeyondAnImagesIsRefused) {
  CandidateFrame message = ToMessage(Example());
  message.image_height = std::numeric_limits<std::uint32_t>::max();
  EXPECT_THAT([&] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr("4294967295")));
}

TEST(CandidateConversions, AMountingThatIsNoRotationIsRefused) {
  for (const double w : {0.0, 2.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    CandidateFrame message = ToMessage(Example());
    message.mounting.rotation.w = w;
    message.mounting.rotation.x = message.mounting.rotation.y = message.mounting.rotation.z = 0;
    EXPECT_THAT([&] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr("quaternion"))) << w;
  }
}

}  // namespace
}  // namespace livemap::ros_io
