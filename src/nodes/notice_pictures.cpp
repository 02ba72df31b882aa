#include "nodes/notice_pictures.h"

#include <utility>

#include "common/error.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::nodes {

bool NoticePictures::IsReady(const std::string& sha256) const {
  if (max_bytes_ == 0 || sha256.empty()) return true;
  const std::lock_guard<std::mutex> lock(mutex_);
  return kept_.count(sha256) != 0;
}

std::vector<std::uint8_t> NoticePictures::Get(const std::string& sha256) {
  if (max_bytes_ == 0 || sha256.empty()) return {};
  const std::lock_guard<std::mutex> making(making_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = kept_.find(sha256);
    if (found != kept_.end()) return found->second;
  }
  auto picture = Make(sha256);
  if (!picture) return {};
  const std::lock_guard<std::mutex> lock(mutex_);
  kept_[sha256] = *picture;
  order_.push_back(sha256);
  if (order_.size() > kMaxKept) {
    kept_.erase(order_.front());
    order_.pop_front();
  }
  return *std::move(picture);
}

/// None: the file is gone, and may come back. Empty: a vehicle's picture that is none, which is
/// remembered; the notice counts without it.
std::optional<std::vector<std::uint8_t>> NoticePictures::Make(const std::string& sha256) {
  const auto path = zone_.ImagePath(sha256);
  if (!path) return std::nullopt;
  zone::SmallPictureLimits limits;
  limits.max_bytes = max_bytes_;
  std::string content;
  try {
    content = ReadFile(*path, limits.picture.max_bytes);
  } catch (const Error&) {
    return std::nullopt;
  }
  try {
    return zone::SmallPicture({content.begin(), content.end()}, limits);
  } catch (const Error&) {
    ++failed_;
    return std::vector<std::uint8_t>{};
  }
}

}  // namespace livemap::nodes
