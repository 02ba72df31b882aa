#include "recordings/positions/photo_list.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/error.h"
#include "common/median.h"
#include "common/time.h"
#include "recordings/positions/position_fields.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kPhotoSecondNs = 1'000'000'000;
/// Zones are whole quarters of an hour.
constexpr std::int64_t kQuarterNs = 900 * kPhotoSecondNs;
constexpr std::size_t kMaxPhotos = 1'000'000;

/// A photo before the zone of its camera's clock is known.
struct TaggedPhoto {
  Photo photo;
  bool has_zone = false;
  std::optional<std::int64_t> receiver_ns;  ///< When its receiver had the place.
};

/// The tag as text; empty where it is none. Numbers are given as they stand in the answer.
std::string TagText(const nlohmann::json& object, const char* tag) {
  const auto found = object.find(tag);
  if (found == object.end()) return "";
  if (found->is_string()) return found->get<std::string>();
  return found->is_number() ? found->dump() : "";
}

double MpsPerUnit(const std::string& reference) {
  if (reference == "M") return 0.44704;
  if (reference == "N") return 1852.0 / 3600;
  return 1 / 3.6;
}

class PhotoReader {
 public:
  PhotoReader(std::optional<int> zone_s, std::string name)
      : zone_s_(zone_s), name_(std::move(name)) {}

  void Read(const nlohmann::json& object) {
    ++number_;
    const std::string path = object.is_object() ? TagText(object, "SourceFile") : "";
    if (path.empty()) {
      throw Error("entry " + std::to_string(number_) + " of '" + name_ +
                  "' names no file, accepted is what exiftool -json answers");
    }
    const std::string where = "the photo '" + path + "'";
    const std::string latitude = TagText(object, "GPSLatitude");
    const std::string longitude = TagText(object, "GPSLongitude");
    if (latitude.empty() || longitude.empty()) return placeless_.Count(number_);
    TaggedPhoto tagged;
    tagged.photo.path = path;
    RecordedPosition& position = tagged.photo.position;
    position.line = number_;
    position.position = ReadPosition(latitude, longitude, where);
    if (const std::string text = TagText(object, "GPSDateTime"); !text.empty()) {
      tagged.receiver_ns = Time(text, where).stamp_ns;
    }
    if (!TakeTime(object, where, tagged)) return timeless_.Count(number_);
    if (const std::string text = TagText(object, "GPSSpeed"); !text.empty()) {
      position.speed_mps = ReadSpeed(text, MpsPerUnit(TagText(object, "GPSSpeedRef")), where);
    }
    if (const std::string text = TagText(object, "GPSTrack"); !text.empty()) {
      position.course_deg = ReadCourse(text, where);
    }
    photos_.push_back(std::move(tagged));
  }

  PhotoList Finish() {
    PhotoList list;
    placeless_.Tell(name_, list.notes);
    timeless_.Tell(name_, list.notes);
    PlaceInZone(list.notes);
    std::stable_sort(photos_.begin(), photos_.end(),
                     [](const TaggedPhoto& a, const TaggedPhoto& b) {
                       return a.photo.position.stamp_ns < b.photo.position.stamp_ns;
                     });
    LeftOut repeated("photos of a time that another has, left out");
    for (TaggedPhoto& tagged : photos_) {
      if (!list.photos.empty() &&
          tagged.photo.position.stamp_ns == list.photos.back().position.stamp_ns) {
        repeated.Count(tagged.photo.position.line);
        continue;
      }
      list.photos.push_back(std::move(tagged.photo));
    }
    repeated.Tell(name_, list.notes);
    if (list.photos.size() < 2) {
      throw Error("'" + name_ + "' has " + std::to_string(list.photos.size()) +
                  " photos with a place and a time, accepted are two or more");
    }
    return list;
  }

 private:
  static TimeText Time(const std::string& text, const std::string& where) {
    const std::optional<TimeText> time = ParseTimeText(text);
    if (time) return *time;
    throw Error(where + " has the time '" + text.substr(0, 40) +
                "', accepted is 2026:01:31 12:34:56 with or without a zone");
  }

  /// False where the photo states no time at all.
  static bool TakeTime(const nlohmann::json& object, const std::string& where,
                       TaggedPhoto& tagged) {
    for (const char* tag : {"SubSecDateTimeOriginal", "DateTimeOriginal"}) {
      const std::string text = TagText(object, tag);
      if (text.empty()) continue;
      TimeText time = Time(text, where);
      const std::string zone = TagText(object, "OffsetTimeOriginal");
      if (!time.has_zone && !zone.empty()) {
        const std::optional<int> zone_s = ParseZone(zone);
        if (!zone_s) throw Error(where + " has the zone '" + zone + "', accepted is +02:00");
        time = {time.stamp_ns - *zone_s * kPhotoSecondNs, true};
      }
      tagged.photo.position.stamp_ns = time.stamp_ns;
      tagged.has_zone = time.has_zone;
      return true;
    }
    if (!tagged.receiver_ns) return false;
    tagged.photo.position.stamp_ns = *tagged.receiver_ns;
    tagged.has_zone = true;
    return true;
  }

  void PlaceInZone(std::vector<std::string>& notes) {
    const auto zoneless = std::find_if(photos_.begin(), photos_.end(),
                                       [](const TaggedPhoto& photo) { return !photo.has_zone; });
    if (zoneless == photos_.end()) return;
    std::int64_t ahead_ns = 0;
    if (zone_s_) {
      ahead_ns = *zone_s_ * kPhotoSecondNs;
    } else {
      ahead_ns = ZoneByReceiver(zoneless->photo.path);
      notes.push_back("the camera's clock is taken to be " +
                      std::to_string(ahead_ns / (60 * kPhotoSecondNs)) +
                      " minutes ahead of UTC, by the receiver's times in its photos");
    }
    for (TaggedPhoto& tagged : photos_) {
      if (!tagged.has_zone) tagged.photo.position.stamp_ns -= ahead_ns;
    }
  }

  std::int64_t ZoneByReceiver(const std::string& first) const {
    std::vector<std::int64_t> ahead;
    for (const TaggedPhoto& tagged : photos_) {
      if (tagged.has_zone || !tagged.receiver_ns) continue;
      ahead.push_back(tagged.photo.position.stamp_ns - *tagged.receiver_ns);
    }
    if (ahead.empty()) {
      throw Error("the photo '" + first +
                  "' has a time without a zone: --time-zone says which, such as +02:00");
    }
    return std::llround(static_cast<double>(TakeMedian(ahead)) / static_cast<double>(kQuarterNs)) *
           kQuarterNs;
  }

  const std::optional<int> zone_s_;
  const std::string name_;
  std::size_t number_ = 0;
  std::vector<TaggedPhoto> photos_;
  LeftOut placeless_{"photos without a place, left out"};
  LeftOut timeless_{"photos without a time, left out"};
};

}  // namespace

const std::vector<std::string>& PhotoTags() {
  static const std::vector<std::string> tags = {"SubSecDateTimeOriginal",
                                                "DateTimeOriginal",
                                                "OffsetTimeOriginal",
                                                "GPSDateTime",
                                                "GPSLatitude",
                                                "GPSLongitude",
                                                "GPSSpeed",
                                                "GPSSpeedRef",
                                                "GPSTrack"};
  return tags;
}

PhotoList ParsePhotoList(const std::string& json, std::optional<int> zone_s,
                         const std::string& name) {
  const nlohmann::json answer = nlohmann::json::parse(json, nullptr, false);
  if (!answer.is_array() || answer.size() > kMaxPhotos) {
    throw Error("what exiftool answers about '" + name + "' is no list of photos");
  }
  PhotoReader reader(zone_s, name);
  for (const nlohmann::json& object : answer) reader.Read(object);
  return reader.Finish();
}

}  // namespace livemap::recordings
