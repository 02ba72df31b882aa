#include "nodes/notice_pictures.h"

#include "zone/pictures/picture_recoder.h"

namespace livemap::nodes {
namespace {

// So many pictures are kept if all of them take what one may.
constexpr std::size_t kKeptPictures = 4096;
// Some are made by the thread that commits reports: tens of milliseconds at most.
constexpr std::int64_t kMaxWorkPx = 16'000'000;

zone::PictureCache MakeCache(std::size_t max_bytes) {
  zone::SmallPictureLimits limits;
  limits.max_bytes = max_bytes;
  limits.picture.max_work_px = kMaxWorkPx;
  return {
      [limits](const std::vector<std::uint8_t>& file) { return zone::SmallPicture(file, limits); },
      {limits.picture.max_bytes, kKeptPictures * max_bytes}};
}

}  // namespace

NoticePictures::NoticePictures(const zone::ZoneService& zone, std::size_t max_bytes)
    : zone_(zone), max_bytes_(max_bytes), cache_(MakeCache(max_bytes)) {}

bool NoticePictures::IsReady(const std::string& sha256) {
  return max_bytes_ == 0 || sha256.empty() || cache_.Find(sha256).has_value();
}

std::vector<std::uint8_t> NoticePictures::Get(const std::string& sha256) {
  if (max_bytes_ == 0 || sha256.empty()) return {};
  zone::PictureCache::File picture;
  if (const auto kept = cache_.Find(sha256)) {
    picture = *kept;  // Even where the vehicle's file has been evicted since.
  } else if (const auto path = zone_.ImagePath(sha256)) {
    picture = cache_.Get(sha256, *path);
  }
  return picture ? *picture : std::vector<std::uint8_t>();
}

}  // namespace livemap::nodes
