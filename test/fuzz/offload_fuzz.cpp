// Whatever a small vehicle puts into a candidate frame, and whatever a detector says about it: up
// to the reports.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "test/fuzz/fuzz_bytes.h"
#include "zone/offload/offload_intake.h"

namespace livemap::fuzz {
namespace {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// Numbers in the order of the message; an honest one where the first byte's bit is not set, so
/// that the rest is reached.
protocol::OffloadedFrame Read(FuzzBytes& bytes) {
  const auto broken = bytes.Any<std::uint8_t>();
  protocol::OffloadedFrame candidate;
  candidate.vehicle_id = (broken & 1U) != 0 ? bytes.Text(80) : "car-1";
  candidate.drive_id = bytes.Text(80);
  candidate.image_frame_id = bytes.Text(80);
  candidate.stamp_ns = (broken & 2U) != 0 ? bytes.Any<std::int64_t>() : kNowNs;
  candidate.score = (broken & 2U) != 0 ? bytes.Any<float>() : 0.5F;
  candidate.base.position = {40, -80};
  candidate.base.covariance_m2.setIdentity();
  candidate.base.course_variance_rad2 = 1e-4;
  if ((broken & 4U) != 0) {
    candidate.base.position = {bytes.Any<double>(), bytes.Any<double>()};
    for (int i = 0; i < 4; ++i) candidate.base.covariance_m2(i / 2, i % 2) = bytes.Any<double>();
    candidate.base.course_rad = bytes.Any<double>();
    candidate.base.course_variance_rad2 = bytes.Any<double>();
    candidate.base.position_course = {bytes.Any<double>(), bytes.Any<double>()};
  }
  candidate.intrinsics = {
      500, 500, 319.5, 199.5, bytes.Any<std::int16_t>(), bytes.Any<std::int16_t>()};
  candidate.base_from_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  candidate.base_from_optical.translation() << 1.5, 0, 1.6;
  if ((broken & 8U) != 0) {
    candidate.intrinsics.fx = bytes.Any<double>();
    candidate.intrinsics.fy = bytes.Any<double>();
    candidate.intrinsics.cx = bytes.Any<double>();
    candidate.intrinsics.cy = bytes.Any<double>();
    for (int i = 0; i < 12; ++i) {
      candidate.base_from_optical.matrix()(i / 4, i % 4) = bytes.Any<double>();
    }
  }
  return candidate;
}

void FuzzCandidate(const std::uint8_t* data, std::size_t size) {
  FuzzBytes bytes(data, size);
  protocol::OffloadedFrame candidate = Read(bytes);
  placement::Sighting sighting;
  sighting.class_name = bytes.Text(80);
  sighting.confidence = bytes.Any<float>();
  sighting.box = {bytes.Any<float>(), bytes.Any<float>(), bytes.Any<float>(), bytes.Any<float>()};
  candidate.image = bytes.Rest();
  zone::OffloadIntake intake{zone::OffloadIntake::Config(), {}};
  const std::string why = intake.Add(candidate, kNowNs);
  const zone::OffloadIntake::Job* job = intake.Next(kNowNs, 0);
  Require(why.empty() == (job != nullptr));
  Require(why.size() < 400);
  if (job == nullptr) return;
  Require(std::isfinite(candidate.base.course_rad) && candidate.base.covariance_m2.allFinite());
  Require(candidate.intrinsics.width > 0 && candidate.intrinsics.height > 0);
  const std::int64_t stamp_ns = job->internal_ns;
  placement::SightingFrame answer;
  answer.stamp_ns = stamp_ns;
  answer.sightings = {sighting};
  for (const protocol::Report& report : intake.Finish(stamp_ns, answer)) {
    Require(!report.uuid.IsNil() && report.vehicle_id == candidate.vehicle_id);
    Require(std::isfinite(report.position.latitude_deg));
    Require(std::isfinite(report.position.longitude_deg));
    Require(report.covariance_m2.allFinite());
  }
  Require(intake.in_flight() == 0 && intake.waiting() == 0);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzCandidate(data, size);
  return 0;
}
