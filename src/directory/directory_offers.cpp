#include "directory/directory_offers.h"

#include <algorithm>

#include "directory/directory_keeper.h"

namespace livemap::directory {

std::optional<std::string> DirectoryOffers::Put(const std::string& zone,
                                                transport::ByteView payload) {
  if (payload.size > DirectoryKeeper::kMaxBytes) {
    return "the offered zone directory has " + std::to_string(payload.size) +
           " bytes, accepted are at most " + std::to_string(DirectoryKeeper::kMaxBytes);
  }
  const MutexLock lock(mutex_);
  const auto waiting = std::count_if(offers_.begin(), offers_.end(),
                                     [&zone](const auto& offer) { return offer.first == zone; });
  if (static_cast<std::size_t>(waiting) >= kMostOfAZone) {
    return "the offered zone directory comes while " + std::to_string(waiting) +
           " of its zone wait, accepted are at most " + std::to_string(kMostOfAZone);
  }
  offers_.emplace_back(zone, std::string(payload.data, payload.data + payload.size));
  return std::nullopt;
}

std::vector<std::pair<std::string, std::string>> DirectoryOffers::Take() {
  std::vector<std::pair<std::string, std::string>> taken;
  const MutexLock lock(mutex_);
  taken.swap(offers_);
  return taken;
}

}  // namespace livemap::directory
