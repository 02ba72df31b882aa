#include "odometry/mounting/mounting_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

#include "common/error.h"
#include "common/text_file.h"
#include "geo/wgs84.h"

namespace livemap::odometry {
namespace {

constexpr int kMountingFileVersion = 1;

struct MountingKey {
  const char* name;
  double min, max;
  bool needed;
};

constexpr MountingKey kMountingKeys[] = {{"version", 0, 1e6, true},
                                         {"image_width", 16, 16384, true},
                                         {"image_height", 16, 16384, true},
                                         {"fx", 1, 1e6, true},
                                         {"fy", 1, 1e6, true},
                                         {"cx", -1e5, 1e5, true},
                                         {"cy", -1e5, 1e5, true},
                                         {"yaw_deg", -60, 60, true},
                                         {"yaw_sigma_deg", 1e-3, 90, true},
                                         {"pitch_deg", -60, 60, true},
                                         {"pitch_sigma_deg", 1e-3, 90, true},
                                         {"roll_deg", -60, 60, false},
                                         {"roll_sigma_deg", 1e-3, 90, false},
                                         {"height_m", 0.1, 10, false},
                                         {"height_sigma_m", 1e-4, 10, false}};

const MountingKey* FindMountingKey(std::string_view name) {
  for (const MountingKey& key : kMountingKeys) {
    if (name == key.name) return &key;
  }
  return nullptr;
}

std::string AcceptedMountingKeys() {
  std::string names;
  for (const MountingKey& key : kMountingKeys) names += std::string(key.name) + ", ";
  return names + "end";
}

std::string_view TrimmedMounting(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// Finite, and nothing behind it.
std::optional<double> MountingNumber(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::string ShortNumber(double value) {
  char digits[64];
  const auto end = std::to_chars(std::begin(digits), std::end(digits), value).ptr;
  return {digits, end};
}

/// Reads line by line; what it has read stands in `values`.
class MountingFileReader {
 public:
  explicit MountingFileReader(const std::string& name) : name_(name) {}

  void ReadLine(std::string_view raw) {
    ++line_;
    const std::string_view line = TrimmedMounting(raw);
    if (line.empty() || line.front() == '#') return;
    const std::size_t colon = line.find(':');
    const std::string_view key = TrimmedMounting(line.substr(0, colon));
    const std::string_view value =
        colon == std::string_view::npos ? "" : TrimmedMounting(line.substr(colon + 1));
    if (ended_) Refuse(key, value, "nothing after 'end: true'");
    if (key == "end" && value == "true") {
      ended_ = true;
      return;
    }
    const MountingKey* known = FindMountingKey(key);
    if (known == nullptr) Refuse(key, value, "one of the keys " + AcceptedMountingKeys());
    const std::optional<double> number = MountingNumber(value);
    if (!number || *number < known->min || *number > known->max) {
      Refuse(key, value,
             "a number from " + ShortNumber(known->min) + " to " + ShortNumber(known->max));
    }
    if (values.empty() && key != "version") Refuse(key, value, "'version' as the first key");
    if (key == "version" && *number != kMountingFileVersion) {
      Refuse(key, value, std::to_string(kMountingFileVersion));
    }
    if (!values.emplace(known->name, *number).second) Refuse(key, value, "each key once");
  }

  void Finish() const {
    if (!ended_) {
      throw Error("the mounting file '" + name_ + "' ends after line " + std::to_string(line_) +
                  " without 'end: true': it was not written to its end");
    }
    for (const MountingKey& key : kMountingKeys) {
      if (key.needed && values.count(key.name) == 0) RefuseMissing(key.name);
    }
    for (const char* pair : {"roll", "height"}) {
      const bool roll = std::string_view(pair) == "roll";
      const char *value = roll ? "roll_deg" : "height_m",
                 *sigma = roll ? "roll_sigma_deg" : "height_sigma_m";
      if (values.count(value) != values.count(sigma)) {
        RefuseMissing(values.count(value) == 0 ? value : sigma);
      }
    }
  }

  std::map<std::string, double> values;

 private:
  [[noreturn]] void Refuse(std::string_view key, std::string_view value,
                           const std::string& accepted) const {
    constexpr std::size_t kShown = 60;
    throw Error("line " + std::to_string(line_) + " of the mounting file '" + name_ + "': '" +
                std::string(key.substr(0, kShown)) + "' is '" +
                std::string(value.substr(0, kShown)) + "', accepted is " + accepted);
  }

  [[noreturn]] void RefuseMissing(const std::string& key) const {
    throw Error("the mounting file '" + name_ + "' has no '" + key + "'");
  }

  std::string name_;
  std::size_t line_ = 0;
  bool ended_ = false;
};

}  // namespace

std::string FormatMountingFile(const MountingRecord& record) {
  const geo::CameraIntrinsics& camera = record.camera;
  const Mounting &mounting = record.estimate.mounting, &sigma = record.estimate.sigma;
  std::string text =
      "# How the camera is mounted, as it found out while driving, with standard deviations.\n"
      "# Delete this file to make it start anew.\n";
  const auto add = [&text](const char* key, double value) {
    text += std::string(key) + ": " + ShortNumber(value) + "\n";
  };
  const auto add_deg = [&add](const char* key, double rad) {
    add(key, std::round(rad / geo::kRadiansPerDegree * 1e6) / 1e6);
  };
  add("version", kMountingFileVersion);
  add("image_width", camera.width);
  add("image_height", camera.height);
  add("fx", camera.fx);
  add("fy", camera.fy);
  add("cx", camera.cx);
  add("cy", camera.cy);
  add_deg("yaw_deg", mounting.yaw_rad);
  add_deg("yaw_sigma_deg", sigma.yaw_rad);
  add_deg("pitch_deg", mounting.pitch_rad);
  add_deg("pitch_sigma_deg", sigma.pitch_rad);
  if (record.estimate.roll_known) {
    add_deg("roll_deg", mounting.roll_rad);
    add_deg("roll_sigma_deg", sigma.roll_rad);
  }
  if (record.estimate.height_known) {
    add("height_m", mounting.height_m);
    add("height_sigma_m", sigma.height_m);
  }
  return text + "end: true\n";
}

MountingRecord ParseMountingFile(const std::string& text, const std::string& name) {
  MountingFileReader reader(name);
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    reader.ReadLine(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
  }
  reader.Finish();
  const auto number = [&reader](const char* key) { return reader.values.at(key); };
  const auto rad = [&number](const char* key) { return number(key) * geo::kRadiansPerDegree; };
  MountingRecord record;
  record.camera = {number("fx"),
                   number("fy"),
                   number("cx"),
                   number("cy"),
                   static_cast<int>(number("image_width")),
                   static_cast<int>(number("image_height"))};
  MountingEstimate& estimate = record.estimate;
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  estimate.mounting.yaw_rad = rad("yaw_deg");
  estimate.mounting.pitch_rad = rad("pitch_deg");
  estimate.sigma = {rad("yaw_sigma_deg"), rad("pitch_sigma_deg"), kUnknown, kUnknown};
  estimate.roll_known = reader.values.count("roll_deg") > 0;
  estimate.height_known = reader.values.count("height_m") > 0;
  if (estimate.roll_known) {
    estimate.mounting.roll_rad = rad("roll_deg");
    estimate.sigma.roll_rad = rad("roll_sigma_deg");
  }
  if (estimate.height_known) {
    estimate.mounting.height_m = number("height_m");
    estimate.sigma.height_m = number("height_sigma_m");
  }
  return record;
}

MountingRecord ReadMountingFile(const std::string& path) {
  return ParseMountingFile(ReadTextFile(path, kMaxMountingFileBytes), path);
}

}  // namespace livemap::odometry
