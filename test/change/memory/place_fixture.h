#pragma once

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <vector>

#include "change/memory/place_record.h"

namespace livemap::change {

constexpr std::int64_t kDayNs = 86400LL * 1000000000LL;
constexpr std::int64_t kFirstStampNs = 1760000000LL * 1000000000LL;

/// A small frame whose picture and features depend on `number` alone.
inline PlaceRecord MakePlace(const geo::GeoPoint& position, int number, double heading_rad = 1.0,
                             const std::string& drive = "monday") {
  PlaceRecord record;
  record.frame.drive_id = drive;
  record.frame.stamp_ns = kFirstStampNs + number * 1000000000LL;
  record.frame.position = position;
  record.frame.heading_rad = heading_rad;
  record.frame.camera = {50, 50, 31.5, 23.5, 64, 48};
  cv::Mat image(48, 64, CV_8UC3);
  cv::RNG random(static_cast<std::uint64_t>(number) + 1);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::imencode(".jpg", image, record.picture);
  constexpr int kFeatures = 24;
  record.features.descriptors = cv::Mat(kFeatures, 128, CV_8UC1);
  random.fill(record.features.descriptors, cv::RNG::UNIFORM, 0, 100);
  for (int i = 0; i < kFeatures; ++i) {
    record.features.points.emplace_back(random.uniform(0.0F, 63.0F), random.uniform(0.0F, 47.0F));
  }
  return record;
}

}  // namespace livemap::change
