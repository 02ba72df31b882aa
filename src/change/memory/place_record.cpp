#include "change/memory/place_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <utility>

#include "common/error.h"
#include "imaging/image_header.h"

namespace livemap::change {
namespace {

constexpr char kMark[] = "LMPLACE1";
constexpr std::size_t kMarkBytes = 8;
constexpr std::size_t kFooterBytes = kMarkBytes + 4;
constexpr std::size_t kDescriptorColumns = 128;
constexpr std::size_t kMaxDriveIdBytes = 64;
constexpr int kMaxPictureSide = 16384;
constexpr double kTwoPi = 6.283185307179586;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records are written in little endian");

class PlaceRecordWriter {
 public:
  explicit PlaceRecordWriter(std::string& bytes) : bytes_(bytes) {}
  template <typename T>
  void Put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  void PutBytes(const void* data, std::size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
  }

 private:
  std::string& bytes_;
};

/// Reads within what is there; Error beyond.
class PlaceRecordReader {
 public:
  PlaceRecordReader(const char* data, std::size_t size, const std::string& name)
      : data_(data), size_(size), name_(name) {}
  template <typename T>
  T Take() {
    T value;
    std::memcpy(&value, TakeBytes(sizeof(value)), sizeof(value));
    return value;
  }
  const char* TakeBytes(std::size_t size) {
    if (size > size_ - at_) throw Error("place record '" + name_ + "' is cut off");
    at_ += size;
    return data_ + at_ - size;
  }
  std::size_t left() const { return size_ - at_; }

 private:
  const char* data_;
  std::size_t size_;
  const std::string& name_;
  std::size_t at_ = 0;
};

void RequireOfRecord(bool holds, const char* field, double value, const char* accepted) {
  if (holds) return;
  throw Error("a remembered frame's " + std::string(field) + " is " + std::to_string(value) +
              ", accepted is " + accepted);
}

void CheckRecordPicture(const PlaceRecord& record) {
  const auto header = imaging::ReadImageHeader(record.picture.data(), record.picture.size());
  if (!header || header->format == imaging::ImageHeader::Format::kWebp ||
      !imaging::HasImageEnd(record.picture.data(), record.picture.size(), header->format)) {
    throw Error("a remembered frame's picture is no whole JPEG or PNG");
  }
  const geo::CameraIntrinsics& camera = record.frame.camera;
  if (header->width == camera.width && header->height == camera.height) return;
  throw Error("a remembered frame's picture is " + std::to_string(header->width) + "x" +
              std::to_string(header->height) + ", accepted is the camera's size, " +
              std::to_string(camera.width) + "x" + std::to_string(camera.height));
}

void CheckRecordFeatures(const ImageFeatures& features) {
  const std::size_t count = features.points.size();
  const cv::Mat& descriptors = features.descriptors;
  if (count > kMaxRecordFeatures || static_cast<std::size_t>(descriptors.rows) != count ||
      (count > 0 && (descriptors.type() != CV_8UC1 || descriptors.cols != int{kDescriptorColumns} ||
                     !descriptors.isContinuous()))) {
    throw Error("a remembered frame has " + std::to_string(count) + " features with " +
                std::to_string(descriptors.rows) + " descriptors, accepted are up to " +
                std::to_string(kMaxRecordFeatures) + " with one of 128 bytes each");
  }
  for (const cv::Point2f& point : features.points) {
    if (std::isfinite(point.x) && std::isfinite(point.y)) continue;
    throw Error("a remembered frame's feature has no finite place");
  }
}

}  // namespace

void CheckPlaceFrame(const PlaceFrame& frame) {
  if (frame.drive_id.empty() || frame.drive_id.size() > kMaxDriveIdBytes) {
    throw Error("a remembered frame's drive id has " + std::to_string(frame.drive_id.size()) +
                " bytes, accepted are 1 to 64");
  }
  if (!geo::IsValid(frame.position))
    throw Error("a remembered frame's position is no place on earth");
  RequireOfRecord(frame.position_sigma_m >= 0 && frame.position_sigma_m <= 1e6, "position_sigma_m",
                  frame.position_sigma_m, "0 to 1e6");
  RequireOfRecord(frame.heading_rad >= 0 && frame.heading_rad < kTwoPi, "heading_rad",
                  frame.heading_rad, "0 to 2 pi");
  RequireOfRecord(frame.stamp_ns > 0, "stamp_ns", static_cast<double>(frame.stamp_ns), "positive");
  const geo::CameraIntrinsics& camera = frame.camera;
  RequireOfRecord(camera.width >= 1 && camera.width <= kMaxPictureSide, "width", camera.width,
                  "1 to 16384");
  RequireOfRecord(camera.height >= 1 && camera.height <= kMaxPictureSide, "height", camera.height,
                  "1 to 16384");
  for (const auto& [name, value] : {std::pair("fx", camera.fx), {"fy", camera.fy}}) {
    RequireOfRecord(value > 0 && value <= 1e6, name, value, "above 0, up to 1e6");
  }
  for (const auto& [name, value] : {std::pair("cx", camera.cx), {"cy", camera.cy}}) {
    RequireOfRecord(std::abs(value) <= 1e6, name, value, "-1e6 to 1e6");
  }
}

std::string SerialisePlaceRecord(const PlaceRecord& record) {
  CheckPlaceFrame(record.frame);
  CheckRecordPicture(record);
  CheckRecordFeatures(record.features);
  std::string bytes(record.picture.begin(), record.picture.end());
  const std::size_t begin = bytes.size();
  PlaceRecordWriter writer(bytes);
  const PlaceFrame& frame = record.frame;
  writer.Put(static_cast<std::uint16_t>(frame.drive_id.size()));
  writer.PutBytes(frame.drive_id.data(), frame.drive_id.size());
  writer.Put(frame.stamp_ns);
  for (const double value :
       {frame.position.latitude_deg, frame.position.longitude_deg, frame.position_sigma_m,
        frame.heading_rad, frame.camera.fx, frame.camera.fy, frame.camera.cx, frame.camera.cy}) {
    writer.Put(value);
  }
  writer.Put(static_cast<std::int32_t>(frame.camera.width));
  writer.Put(static_cast<std::int32_t>(frame.camera.height));
  writer.Put(static_cast<std::uint32_t>(record.features.points.size()));
  for (const cv::Point2f& point : record.features.points) {
    writer.Put(point.x);
    writer.Put(point.y);
  }
  writer.PutBytes(record.features.descriptors.data,
                  record.features.points.size() * kDescriptorColumns);
  writer.Put(static_cast<std::uint32_t>(bytes.size() - begin));
  writer.PutBytes(kMark, kMarkBytes);
  if (bytes.size() > kMaxRecordBytes) {
    throw Error("a remembered frame has " + std::to_string(bytes.size()) +
                " bytes, accepted are up to " + std::to_string(kMaxRecordBytes));
  }
  return bytes;
}

PlaceRecord ParsePlaceRecord(const std::string& bytes, const std::string& name) {
  if (bytes.size() < kFooterBytes || bytes.size() > kMaxRecordBytes ||
      bytes.compare(bytes.size() - kMarkBytes, kMarkBytes, kMark) != 0) {
    throw Error("'" + name + "' is no place record");
  }
  std::uint32_t body = 0;
  std::memcpy(&body, bytes.data() + bytes.size() - kFooterBytes, sizeof(body));
  if (body > bytes.size() - kFooterBytes) throw Error("place record '" + name + "' is cut off");
  const std::size_t begin = bytes.size() - kFooterBytes - body;
  PlaceRecordReader reader(bytes.data() + begin, body, name);
  PlaceRecord record;
  PlaceFrame& frame = record.frame;
  const auto drive_bytes = reader.Take<std::uint16_t>();
  frame.drive_id.assign(reader.TakeBytes(drive_bytes), drive_bytes);
  frame.stamp_ns = reader.Take<std::int64_t>();
  for (double* value : {&frame.position.latitude_deg, &frame.position.longitude_deg,
                        &frame.position_sigma_m, &frame.heading_rad, &frame.camera.fx,
                        &frame.camera.fy, &frame.camera.cx, &frame.camera.cy}) {
    *value = reader.Take<double>();
  }
  frame.camera.width = reader.Take<std::int32_t>();
  frame.camera.height = reader.Take<std::int32_t>();
  const auto count = reader.Take<std::uint32_t>();
  if (count > kMaxRecordFeatures ||
      reader.left() != count * (kDescriptorColumns + 2 * sizeof(float))) {
    throw Error("place record '" + name + "' has " + std::to_string(reader.left()) +
                " bytes for its " + std::to_string(count) + " features");
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto x = reader.Take<float>();
    record.features.points.emplace_back(x, reader.Take<float>());
  }
  record.features.descriptors = cv::Mat(static_cast<int>(count), int{kDescriptorColumns}, CV_8UC1);
  std::memcpy(record.features.descriptors.data, reader.TakeBytes(count * kDescriptorColumns),
              count * kDescriptorColumns);
  record.picture.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(begin));
  CheckPlaceFrame(frame);
  CheckRecordPicture(record);
  CheckRecordFeatures(record.features);
  return record;
}

double PlaceQuality(const PlaceFrame& frame, const ImageFeatures& features) {
  constexpr int kColumns = 8;
  constexpr int kRows = 6;
  constexpr double kHalfAtSigmaM = 3;
  std::set<int> covered;
  for (const cv::Point2f& point : features.points) {
    // Clamped before it is an integer: a damaged file has points anywhere.
    const float column = std::clamp(point.x * kColumns / static_cast<float>(frame.camera.width),
                                    0.0F, kColumns - 1.0F);
    const float row =
        std::clamp(point.y * kRows / static_cast<float>(frame.camera.height), 0.0F, kRows - 1.0F);
    covered.insert(static_cast<int>(row) * kColumns + static_cast<int>(column));
  }
  const double share = static_cast<double>(covered.size()) / (kColumns * kRows);
  return share / (1 + frame.position_sigma_m / kHalfAtSigmaM);
}

}  // namespace livemap::change
