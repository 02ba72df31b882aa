#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recordings/recorded_track.h"

namespace livemap::recordings {

/// The tags that ParsePhotoList reads, as exiftool names them.
const std::vector<std::string>& PhotoTags();

/// One geotagged photo.
struct Photo {
  std::string path;
  RecordedPosition position;  ///< Its stamp is that of the exposure; `line` counts photos from 1.
};

/// Geotagged photos in the order of their stamps.
struct PhotoList {
  std::vector<Photo> photos;       ///< At least two; the stamps increase.
  std::vector<std::string> notes;  ///< What was left out or assumed, a sentence each.
};

/// What `exiftool -json -n` answers about photos (tags of PhotoTags): an array of an object each.
/// A photo's time is that of its camera, to the fraction of a second where it has one, with the
/// zone that it states; without a zone, `zone_s` ahead of UTC; and where that is none, the whole
/// quarter hour that brings most cameras' times next to the receiver's times of the photos
/// themselves. Photos without a place or time are left out with a note, repeated stamps too.
/// Throws Error naming `name`, the photo and the value: no such answer, a coordinate or time that
/// is none, no zone to be had, fewer than two photos.
PhotoList ParsePhotoList(const std::string& json, std::optional<int> zone_s,
                         const std::string& name);

}  // namespace livemap::recordings
