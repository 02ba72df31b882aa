// Whatever a vehicle puts into a report: its texts and its picture, up to the zone's decision.
#include <cstdint>
#include <cstdlib>
#include <string>

#include "base/image_header.h"
#include "zone/report_validation.h"

namespace livemap {
namespace {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzPicture(const std::uint8_t* data, std::size_t size) {
  const auto header = ReadImageHeader(data, size);
  if (header) Require(header->width > 0 && header->height > 0);
}

/// The class name is the first half, the picture the second.
void FuzzReport(const std::uint8_t* data, std::size_t size) {
  Report report;
  report.uuid.bytes[0] = 1;
  report.vehicle_id = "car-1";
  report.stamp_ns = kNowNs;
  report.class_name.assign(data, data + size / 2);
  report.confidence = 0.5F;
  report.box = {1, 1, 2, 2};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 10;
  report.image.assign(data + size / 2, data + size);
  const auto why = WhyRefused(report, ReportLimits(), kNowNs);
  if (why) {
    Require(!why->sentence.empty() && why->sentence.size() < 300);
    return;
  }
  Require(!report.class_name.empty() && report.class_name.size() <= ReportLimits().max_text_bytes);
  for (const char c : report.class_name) Require(static_cast<unsigned char>(c) >= 0x20);
}

}  // namespace
}  // namespace livemap

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::FuzzPicture(data, size);
  livemap::FuzzReport(data, size);
  return 0;
}
