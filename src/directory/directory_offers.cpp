#include "directory/directory_offers.h"

#include "directory/directory_keeper.h"

namespace livemap::directory {

std::optional<std::string> DirectoryOffers::Put(const std::string& zone,
                                                transport::ByteView payload) {
  if (payload.size > DirectoryKeeper::kMaxBytes) {
    return "the offered zone directory has " + std::to_string(payload.size) +
           " bytes, accepted are at most " + std::to_string(DirectoryKeeper::kMaxBytes);
  }
  std::string bytes(payload.data, payload.data + payload.size);
  const MutexLock lock(mutex_);
  offers_.insert_or_assign(zone, std::move(bytes));
  return std::nullopt;
}

std::map<std::string, std::string> DirectoryOffers::Take() {
  std::map<std::string, std::string> taken;
  const MutexLock lock(mutex_);
  taken.swap(offers_);
  return taken;
}

}  // namespace livemap::directory
