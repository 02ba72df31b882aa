#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "change/registration/image_features.h"
#include "geo/camera_intrinsics.h"
#include "geo/wgs84.h"

namespace livemap::change {

/// What is known about a picture of an earlier drive.
struct PlaceFrame {
  std::string drive_id;          ///< 1 to 64 bytes.
  std::int64_t stamp_ns = 0;     ///< Since 1970, UTC; the image's stamp.
  geo::GeoPoint position;        ///< Fused, of the camera.
  double position_sigma_m = 0;   ///< Standard deviation per axis, 0 to 1e6.
  double heading_rad = 0;        ///< Of the view, clockwise from true north, [0, 2 pi).
  geo::CameraIntrinsics camera;  ///< Rectified; width and height are those of the picture.
};

/// A remembered frame: everything about it in one, so that a file of it can stand alone.
struct PlaceRecord {
  PlaceFrame frame;
  std::vector<std::uint8_t> picture;  ///< JPEG or PNG, as it came.
  ImageFeatures features;
};

constexpr std::size_t kMaxRecordBytes = 32U << 20U;
constexpr std::size_t kMaxRecordFeatures = 8192;

/// Throws Error naming the field, its value and what is accepted.
void CheckPlaceFrame(const PlaceFrame& frame);

/// The picture, then the features and the frame in little endian, then their length and a mark:
/// whatever shows pictures shows the file. Throws Error when a field is not as it must be or the
/// whole exceeds kMaxRecordBytes.
std::string SerialisePlaceRecord(const PlaceRecord& record);
/// The inverse. Throws Error, with `name` in it, for anything that SerialisePlaceRecord would not
/// write; the picture is looked at up to its header.
PlaceRecord ParsePlaceRecord(const std::string& bytes, const std::string& name);

/// How much a frame is worth, 0 to 1: the share of an 8 x 6 raster over the picture that has a
/// feature, less for a position that is uncertain (half at a sigma of 3 m).
double PlaceQuality(const PlaceFrame& frame, const ImageFeatures& features);

}  // namespace livemap::change
