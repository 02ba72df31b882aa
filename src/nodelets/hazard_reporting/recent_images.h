#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "common/stamp_gate.h"

namespace livemap::nodelets {

/// The newest images by stamp, of which a picture may be wanted, and older ones that are still
/// wanted. `Image` is cheap to copy: a pointer and what goes with it. Not thread-safe.
template <typename Image>
class RecentImages {
 public:
  /// At most `capacity` images are kept because they are new, and as many because they are wanted.
  explicit RecentImages(std::size_t capacity) : capacity_(capacity) {}

  /// The images that are wanted from now on, however old they are; others that are over the
  /// capacity go with the next Add.
  void Want(std::set<std::int64_t> stamps_ns) { wanted_ = std::move(stamps_ns); }

  /// Keeps `image`, also one that comes late; forgets the oldest ones over the capacity, of those
  /// that are wanted last. A stamp by which time was set back (IsSetBack) forgets all.
  void Add(std::int64_t stamp_ns, Image image) {
    if (!images_.empty() && IsSetBack(stamp_ns, images_.rbegin()->first)) Clear();
    images_.insert_or_assign(stamp_ns, std::move(image));
    auto oldest = images_.begin();
    for (std::size_t over = images_.size() > capacity_ ? images_.size() - capacity_ : 0; over > 0;
         --over) {
      oldest = wanted_.count(oldest->first) != 0 ? std::next(oldest) : images_.erase(oldest);
    }
    if (images_.size() > 2 * capacity_) images_.erase(images_.begin());
  }

  /// Forgets the image of this stamp, unless it is wanted.
  void Release(std::int64_t stamp_ns) {
    if (wanted_.count(stamp_ns) == 0) images_.erase(stamp_ns);
  }

  /// Forgets all images, and which ones are wanted: time was set back.
  void Clear() {
    images_.clear();
    wanted_.clear();
  }

  /// Null where the image is not kept.
  Image* Find(std::int64_t stamp_ns) {
    const auto found = images_.find(stamp_ns);
    return found == images_.end() ? nullptr : &found->second;
  }
  std::size_t size() const { return images_.size(); }

 private:
  std::size_t capacity_;
  std::set<std::int64_t> wanted_;
  std::map<std::int64_t, Image> images_;
};

}  // namespace livemap::nodelets
