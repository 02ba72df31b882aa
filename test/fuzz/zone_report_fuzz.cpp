// Whatever a vehicle puts into a report: its texts and its picture, up to the zone's decision.
#include <cstdint>
#include <cstdlib>
#include <string>

#include "imaging/image_header.h"
#include "zone/admission/report_validation.h"

namespace livemap::fuzz {
namespace {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzPicture(const std::uint8_t* data, std::size_t size) {
  const auto header = imaging::ReadImageHeader(data, size);
  if (header) Require(header->width > 0 && header->height > 0);
}

/// What a picture shows must lie within the image: edges and sides of 16 bits each.
void FuzzRegion(const std::uint8_t* data, std::size_t size) {
  if (size < 8) return;
  const auto number = [data](std::size_t i) {
    const std::uint32_t small = data[2 * i] | static_cast<std::uint32_t>(data[2 * i + 1]) << 8;
    return small < 0xfff0 ? small : 0xffff0000 | small;  // And what overflows when added up.
  };
  protocol::Report report;
  report.uuid.bytes[0] = 1;
  report.vehicle_id = "car-1";
  report.class_name = "pothole";
  report.stamp_ns = kNowNs;
  report.box = {1, 1, 2, 2};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 1000;
  report.shown = {number(0), number(1), number(2), number(3)};
  if (zone::WhyRefused(report, zone::ReportLimits(), kNowNs) || report.shown.IsWholeImage()) return;
  const imaging::PixelRegion& shown = report.shown;
  Require(shown.width > 0 && shown.height > 0);
  Require(std::uint64_t{shown.x} + shown.width <= 1000);
  Require(std::uint64_t{shown.y} + shown.height <= 1000);
}

/// The class name is the first half, the picture the second.
void FuzzReport(const std::uint8_t* data, std::size_t size) {
  protocol::Report report;
  report.uuid.bytes[0] = 1;
  report.vehicle_id = "car-1";
  report.stamp_ns = kNowNs;
  report.class_name.assign(data, data + size / 2);
  report.confidence = 0.5F;
  report.box = {1, 1, 2, 2};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 10;
  report.image.assign(data + size / 2, data + size);
  const auto why = zone::WhyRefused(report, zone::ReportLimits(), kNowNs);
  if (why) {
    Require(!why->sentence.empty() && why->sentence.size() < 300);
    return;
  }
  Require(!report.class_name.empty() &&
          report.class_name.size() <= zone::ReportLimits().max_text_bytes);
  for (const char c : report.class_name) Require(static_cast<unsigned char>(c) >= 0x20);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzPicture(data, size);
  livemap::fuzz::FuzzReport(data, size);
  livemap::fuzz::FuzzRegion(data, size);
  return 0;
}
