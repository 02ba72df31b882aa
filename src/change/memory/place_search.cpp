// What a place memory answers, and the features it keeps at hand for it.
#include <algorithm>
#include <utility>

#include "change/memory/place_memory.h"
#include "common/error.h"

namespace livemap::change {
std::vector<PlaceMemory::Ranked> PlaceMemory::Rank(const ImageFeatures& features,
                                                   const std::vector<PlaceMatch>& candidates) {
  std::vector<Ranked> ranked;
  for (const PlaceMatch& candidate : candidates) {
    const auto remembered = Features(candidate.id);
    if (remembered == nullptr) continue;
    ranked.push_back({candidate, MatchFeatures(*remembered, features, config_.match_ratio).size()});
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Ranked& a, const Ranked& b) { return a.matches > b.matches; });
  return ranked;
}

std::optional<PlaceRecord> PlaceMemory::Load(std::int64_t id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return std::nullopt;
  try {
    const std::string& sha256 = found->second.sha256;
    return ParsePlaceRecord(files_.Read(sha256), sha256);
  } catch (const Error&) {
    DropDamaged(id);
    return std::nullopt;
  }
}

void PlaceMemory::DropDamaged(std::int64_t id) {
  database_->Transaction([&] { DeleteRows({id}); });
  files_.SetAside(entries_.at(id).sha256);
  Hide(id);
  ++damaged_;
}

std::shared_ptr<const ImageFeatures> PlaceMemory::Features(std::int64_t id) {
  const auto cached = cached_.find(id);
  if (cached != cached_.end()) {
    cache_.splice(cache_.begin(), cache_, cached->second);
    return cached->second->features;
  }
  std::optional<PlaceRecord> record = Load(id);
  if (!record) return nullptr;
  auto features = std::make_shared<const ImageFeatures>(std::move(record->features));
  Cache(id, features);
  return features;
}

void PlaceMemory::Cache(std::int64_t id, std::shared_ptr<const ImageFeatures> features) {
  cached_bytes_ += static_cast<double>(features->Bytes());
  cache_.push_front({id, std::move(features)});
  cached_[id] = cache_.begin();
  while (cached_bytes_ > config_.max_cached_bytes && !cache_.empty()) Uncache(cache_.back().id);
}

void PlaceMemory::Uncache(std::int64_t id) {
  const auto found = cached_.find(id);
  if (found == cached_.end()) return;
  cached_bytes_ -= static_cast<double>(found->second->features->Bytes());
  cache_.erase(found->second);
  cached_.erase(found);
}

}  // namespace livemap::change
