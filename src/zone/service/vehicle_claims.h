#pragma once

#include <set>
#include <string>
#include <utility>

#include "common/mutex.h"
#include "zone/model/decision.h"

namespace livemap::zone {

/// The vehicles about which a decision is carried out just now, in pieces: those of two decisions
/// about one vehicle would undo each other's. Thread-safe.
class VehicleClaims {
 public:
  /// As long as it lives no other decision about the vehicle is carried out.
  class Claim {
   public:
    /// Throws DecisionConflict while there is another one for the vehicle.
    Claim(VehicleClaims& claims, std::string vehicle_id)
        : claims_(claims), vehicle_id_(std::move(vehicle_id)) {
      const MutexLock lock(claims_.mutex_);
      if (!claims_.vehicles_.insert(vehicle_id_).second) {
        throw DecisionConflict(
            "another decision about this vehicle is being carried out; decide again when it is "
            "done");
      }
    }
    ~Claim() {
      const MutexLock lock(claims_.mutex_);
      claims_.vehicles_.erase(vehicle_id_);
    }
    Claim(const Claim&) = delete;
    Claim& operator=(const Claim&) = delete;

   private:
    VehicleClaims& claims_;
    const std::string vehicle_id_;
  };

 private:
  Mutex mutex_;  ///< Held for moments, with no other lock taken under it.
  std::set<std::string> vehicles_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
