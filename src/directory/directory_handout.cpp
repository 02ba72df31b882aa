#include "directory/directory_handout.h"

#include <utility>

#include "common/time.h"

namespace livemap::directory {

DirectoryHandout::DirectoryHandout(DirectoryFile file, const Config& config)
    : config_(config), file_(std::move(file)), budget_({config.bytes_per_s, 1.0}) {}

bool DirectoryHandout::ReadIfChanged() {
  const MutexLock lock(mutex_);
  if (!file_.ReadIfChanged()) return false;
  if (!bytes_ || *bytes_ != file_.bytes()) {
    bytes_ = std::make_shared<const std::string>(file_.bytes());
    given_ns_.clear();
  }
  return true;
}

std::string DirectoryHandout::damage() const {
  const MutexLock lock(mutex_);
  return file_.damage();
}

std::uint64_t DirectoryHandout::version() const {
  const MutexLock lock(mutex_);
  const auto directory = file_.directory();
  return directory ? directory->version() : 0;
}

void DirectoryHandout::Hear(const std::string& vehicle) {
  const MutexLock lock(mutex_);
  if (heard_.size() < config_.max_vehicles) heard_.insert(vehicle);
}

std::vector<DirectoryHandout::Gift> DirectoryHandout::Next(std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  std::vector<Gift> gifts;
  const bool has_any = file_.directory() != nullptr;  // And it has not expired.
  budget_.Refill(now_ns);
  // Those for whom nothing is left wait for the next call.
  for (auto vehicle = heard_.begin(); vehicle != heard_.end() && budget_.tokens() > 0;
       vehicle = heard_.erase(vehicle)) {
    const auto given = given_ns_.find(*vehicle);
    const bool is_given =
        given != given_ns_.end() && now_ns - given->second < Nanoseconds(config_.repeat_s);
    if (!has_any || is_given) continue;
    budget_.Spend(static_cast<double>(bytes_->size()));
    if (given_ns_.size() >= config_.max_vehicles) given_ns_.clear();
    given_ns_[*vehicle] = now_ns;
    gifts.push_back({*vehicle, bytes_});
  }
  return gifts;
}

void DirectoryHandout::TakeBack(const std::string& vehicle) {
  const MutexLock lock(mutex_);
  given_ns_.erase(vehicle);
}

void DirectoryHandout::TakeBackAll() {
  const MutexLock lock(mutex_);
  given_ns_.clear();
}

}  // namespace livemap::directory
