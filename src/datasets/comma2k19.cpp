#include "datasets/comma2k19.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <optional>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxTimeS = 4e9;       // In nanoseconds still far from the end of 64 bits.
constexpr double kMaxSpeedMps = 150;    // Of a car.
constexpr double kMinRadiusM = 6.30e6;  // Of places on roads, from the centre of the earth.
constexpr double kMaxRadiusM = 6.40e6;

/// Reads a table line by line; hands the numbers of each line on.
class Table {
 public:
  Table(const std::string& text, std::string name, std::string head)
      : lines_(Lines(text)), name_(std::move(name)), head_(std::move(head)) {
    columns_ = Split(head_, ',').size();
    if (lines_.empty() || (lines_[0] + ",").compare(0, head_.size() + 1, head_ + ",") != 0) {
      throw Error("line 1 of '" + name_ + "' is '" +
                  (lines_.empty() ? "" : lines_[0].substr(0, 80)) + "', it must begin with '" +
                  head_ + "'");
    }
    if (lines_.size() < 2) throw Error("'" + name_ + "' has no row");
  }

  std::size_t rows() const { return lines_.size() - 1; }

  /// The first columns of a row as numbers, the time as nanoseconds in `stamp_ns`.
  std::vector<double> Row(std::size_t row, std::int64_t& stamp_ns) const {
    const std::vector<std::string> parts = Split(lines_[row + 1], ',');
    std::vector<double> values;
    for (std::size_t i = 0; i < columns_ && i < parts.size(); ++i) {
      const std::optional<double> value = ParseFinite(parts[i]);
      if (!value) break;
      values.push_back(*value);
    }
    if (values.size() != columns_) Refuse(row, "finite numbers '" + head_ + "'");
    if (values[0] < 0 || values[0] > kMaxTimeS) {
      Refuse(row, "a time from 0 to 4e9 s" + StampHint(parts[0]));
    }
    const auto stamp = static_cast<std::int64_t>(std::llround(values[0] * 1e9));
    if (row > 0 && stamp <= stamp_ns) Refuse(row, "a time after the line before");
    stamp_ns = stamp;
    return values;
  }

  [[noreturn]] void Refuse(std::size_t row, const std::string& accepted) const {
    throw Error("line " + std::to_string(row + 2) + " of '" + name_ + "' is '" +
                lines_[row + 1].substr(0, 80) + "', accepted are " + accepted);
  }

 private:
  const std::vector<std::string> lines_;
  const std::string name_;
  const std::string head_;
  std::size_t columns_ = 0;
};

}  // namespace

std::vector<RecordedFix> ParseRecordedFixes(const std::string& text, const std::string& name) {
  const Table table(text, name, "t_s,lat_deg,lon_deg");
  std::vector<RecordedFix> fixes(table.rows());
  std::int64_t stamp_ns = 0;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const std::vector<double> row = table.Row(i, stamp_ns);
    fixes[i] = {stamp_ns, {row[1], row[2]}};
    if (!geo::IsValid(fixes[i].position)) {
      table.Refuse(i, "latitudes from -90 to 90 and longitudes from -180 to 180");
    }
  }
  return fixes;
}

std::vector<RecordedPose> ParseRecordedPoses(const std::string& text, const std::string& name) {
  const Table table(text, name, "t_s,ecef_x_m,ecef_y_m,ecef_z_m,q_w,q_x,q_y,q_z");
  std::vector<RecordedPose> poses(table.rows());
  std::int64_t stamp_ns = 0;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const std::vector<double> row = table.Row(i, stamp_ns);
    poses[i].stamp_ns = stamp_ns;
    poses[i].earth_m = {row[1], row[2], row[3]};
    const double radius_m = poses[i].earth_m.norm();
    if (!(radius_m >= kMinRadiusM && radius_m <= kMaxRadiusM)) {
      table.Refuse(i, "places at 6300 to 6400 km from the centre of the earth");
    }
    const Eigen::Quaterniond rotation(row[4], row[5], row[6], row[7]);
    if (!(std::abs(rotation.norm() - 1) < 1e-3)) table.Refuse(i, "quaternions of length 1");
    poses[i].earth_from_vehicle = rotation.normalized();
  }
  return poses;
}

std::vector<RecordedSpeed> ParseRecordedSpeeds(const std::string& text, const std::string& name) {
  const Table table(text, name, "t_s,speed_mps");
  std::vector<RecordedSpeed> speeds(table.rows());
  std::int64_t stamp_ns = 0;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const std::vector<double> row = table.Row(i, stamp_ns);
    if (std::abs(row[1]) > kMaxSpeedMps) table.Refuse(i, "speeds from -150 to 150 m/s");
    speeds[i] = {stamp_ns, row[1]};
  }
  return speeds;
}

PositionDrive ReadComma2k19(const std::string& directory) {
  const fs::path root(directory);
  if (!fs::exists(root)) throw Error("the folder '" + directory + "' does not exist");
  if (!fs::is_directory(root)) throw Error("'" + directory + "' is no folder");
  const auto path = [&](const char* file) { return (root / file).string(); };
  const auto read = [&](const char* file) { return ReadTextFile(path(file), kMaxTableBytes); };
  PositionDrive drive;
  drive.fixes = ParseRecordedFixes(read("gnss_ublox.csv"), path("gnss_ublox.csv"));
  drive.poses = ParseRecordedPoses(read("pose.csv"), path("pose.csv"));
  drive.speeds = ParseRecordedSpeeds(read("can_speed.csv"), path("can_speed.csv"));
  return drive;
}

}  // namespace livemap::datasets
