#include "zone/service/erasure_desk.h"

#include <chrono>
#include <filesystem>
#include <utility>

#include "common/error.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {

bool WorkOffErasure(ErasureRequests& requests, ZoneService& zone, std::int64_t now_ns) {
  const auto request = requests.Next();
  if (!request) return false;
  ErasureRequests::Outcome outcome;
  try {
    outcome.counts = zone.Forget({request->vehicle_id, request->secret}, request->by);
  } catch (const StoreError&) {
    throw;
  } catch (const DecisionConflict&) {
    throw;  // It ends soon.
  } catch (const Error& error) {
    outcome.refusal = error.what();
  }
  requests.Finish(request->id, outcome, now_ns);
  return true;
}

ErasureDesk::ErasureDesk(std::string directory, ZoneService& zone, Clock now_ns, Log log)
    : directory_(std::move(directory)),
      zone_(zone),
      now_ns_(std::move(now_ns)),
      log_(std::move(log)),
      thread_([this] { WorkUntilStopped(); }) {}

ErasureDesk::~ErasureDesk() {
  {
    const MutexLock lock(mutex_);
    closing_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

void ErasureDesk::WorkUntilStopped() {
  constexpr std::chrono::seconds kRest{1};
  for (;;) {
    WorkOff();
    const MutexLock lock(mutex_);
    const auto deadline = std::chrono::steady_clock::now() + kRest;
    while (!closing_ && changed_.WaitUntil(mutex_, deadline)) {
    }
    if (closing_) return;
  }
}

void ErasureDesk::WorkOff() {
  try {
    const std::string path = ErasureRequests::PathIn(directory_);
    std::error_code ignored;
    if (!requests_ && !std::filesystem::exists(path, ignored)) return;
    if (!requests_) requests_ = std::make_unique<ErasureRequests>(path);
    if (WorkOffErasure(*requests_, zone_, now_ns_())) log_("a vehicle was forgotten, as was asked");
    told_.clear();
  } catch (const std::exception& error) {
    // Once: it is tried again every second.
    if (told_ == error.what()) return;
    told_ = error.what();
    log_("a vehicle that is to be forgotten is not yet: " + told_);
  }
}

}  // namespace livemap::zone
