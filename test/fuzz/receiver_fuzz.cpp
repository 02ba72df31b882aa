// What a receiver says, through a gpsd that lies: reports of any numbers, devices and clocks in any
// order. What is given out can be, and its uncertainty is never 0.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "common/time.h"
#include "geo/fix_covariance.h"
#include "receiver/receiver_watch.h"
#include "test/fuzz/fuzz_bytes.h"

namespace {

using livemap::receiver::ReceiverFix;
using livemap::receiver::ReceiverReport;
using livemap::receiver::ReceiverVelocity;
using livemap::receiver::ReceiverWatch;

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckFix(const ReceiverFix& fix) {
  Require(livemap::IsStamp(fix.stamp_ns) && livemap::geo::IsValid(fix.position));
  if (fix.height_m) Require(std::isfinite(*fix.height_m));
  if (fix.up_sigma_m) Require(*fix.up_sigma_m > 0 && fix.height_m);
  if (!fix.plane_sigma_m) return;
  Require(fix.plane_sigma_m->minCoeff() > 0);
  const Eigen::Matrix2d covariance = fix.plane_sigma_m->cwiseAbs2().asDiagonal();
  Require(livemap::geo::IsFixCovariance(covariance));
}

void CheckVelocity(const ReceiverVelocity& velocity) {
  Require(velocity.plane_mps.allFinite() && velocity.plane_mps.norm() < 101);
  if (velocity.climb_mps) Require(std::abs(*velocity.climb_mps) <= 100);
  if (velocity.climb_sigma_mps) Require(*velocity.climb_sigma_mps > 0 && velocity.climb_mps);
  if (!velocity.plane_covariance) return;
  Require(velocity.plane_covariance->allFinite());
  Require(velocity.plane_covariance->diagonal().minCoeff() > 0);
}

/// A number of any bits, or one of a few sizes that pass more checks.
double TakeNumber(livemap::fuzz::FuzzBytes& bytes) {
  const auto kind = bytes.Any<std::uint8_t>();
  if (kind % 4 == 0) return bytes.Any<double>();
  return static_cast<double>(bytes.Any<std::int16_t>()) / (kind % 4 == 1 ? 1.0 : 100.0);
}

ReceiverReport TakeReport(livemap::fuzz::FuzzBytes& bytes, std::int64_t system_ns) {
  ReceiverReport report;
  report.device = std::string(1, static_cast<char>('a' + bytes.Any<std::uint8_t>() % 3));
  report.mode = bytes.Any<std::int8_t>();
  report.status = bytes.Any<std::int8_t>();
  const bool any_time = bytes.Any<std::uint8_t>() % 8 == 0;
  report.stamp_ns = any_time ? bytes.Any<std::int64_t>()
                             : system_ns - 1'000'000 * std::int64_t{bytes.Any<std::int16_t>()};
  for (double* const number :
       {&report.latitude_deg, &report.longitude_deg, &report.height_m, &report.east_error_m,
        &report.north_error_m, &report.radial_error_m, &report.up_error_m, &report.speed_mps,
        &report.course_deg, &report.climb_mps, &report.speed_error_mps, &report.course_error_deg,
        &report.climb_error_mps}) {
    *number = TakeNumber(bytes);
  }
  return report;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzBytes bytes(data, size);
  ReceiverWatch::Config config;
  if (bytes.Any<std::uint8_t>() % 4 == 0) config.device = "b";
  ReceiverWatch watch(config);
  ReceiverWatch::Now now{1'795'653'934'000'000'000, 1'000'000'000'000};
  while (!bytes.empty()) {
    const std::int64_t step_ns = 1'000'000 * std::int64_t{bytes.Any<std::uint16_t>()};
    now.steady_ns += step_ns;
    now.system_ns += step_ns;
    switch (bytes.Any<std::uint8_t>() % 8) {
      case 0:
        watch.OnConnection(bytes.Any<std::uint8_t>() % 2 == 0, "because", now);
        break;
      case 1:
        watch.OnDevices(
            {{"a", bytes.Any<std::uint8_t>() % 2 == 0}, {"b", bytes.Any<std::uint8_t>() % 2 == 0}});
        break;
      case 2:
        watch.OnSatellites("a", bytes.Any<std::int32_t>(), bytes.Any<std::int32_t>());
        break;
      case 3:  // Somebody sets the clock.
        now.system_ns += 1'000'000 * std::int64_t{bytes.Any<std::int32_t>()};
        break;
      default: {
        const ReceiverReport report = TakeReport(bytes, now.system_ns);
        const ReceiverWatch::Taken taken = watch.OnReport(report, now);
        if (taken.fix) CheckFix(*taken.fix);
        if (taken.velocity) CheckVelocity(*taken.velocity);
        Require(!taken.velocity || taken.fix);
      }
    }
    Require(!watch.Describe(now.steady_ns).empty());
  }
  return 0;
}
