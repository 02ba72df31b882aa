#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/queues/token_bucket.h"
#include "common/uuid.h"
#include "protocol/poll.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/desk/frame_request.h"
#include "zone/model/vehicle_state.h"
#include "zone/pictures/image_store.h"
#include "zone/pictures/picture_allowance.h"
#include "zone/places/place_book.h"
#include "zone/polling/poll_scheduler.h"
#include "zone/registry/vehicle_table.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// Asks vehicles about hazards and takes their answers in: who is asked what, which answers are
/// believed, and what follows from them. Open polls are not stored: after a restart the zone asks
/// anew.
///
/// The caller holds the writer's lock, and Apply runs in a transaction; SetVehicle may be called by
/// any thread. A lock of its own guards the scheduler; it is taken last, and no other lock is taken
/// under it.
class PollCoordinator {
 public:
  using Slot = HazardRegistry::Slot;

  /// An answer that counts, before its transaction.
  struct AcceptedAnswer {
    const protocol::PollAnswer* answer = nullptr;
    Slot slot = 0;        ///< The hazard.
    PictureName picture;  ///< On disk already; none unless one was wanted.
    PictureCost picture_cost;
    std::uint64_t frame =
        0;  ///< Decision of the request whose whole frame the picture is; 0: none.
  };

  /// All outlive it. Throws Error for an impossible setting.
  PollCoordinator(const ZoneConfig& config, ZoneState& state, HazardSteps& steps,
                  ImageStore& images, PictureAllowance& pictures, VehicleAllowance& allowance,
                  const VehicleTable& vehicles, PlaceBook& places);

  /// The hazard as it is now: to be called after each change to it.
  void SetHazard(Slot slot, std::int64_t now_ns);
  /// Where a vehicle is now.
  void SetVehicle(const VehicleState& vehicle);

  /// Whether `official` may ask vehicles for a whole frame of the hazard now, which counts against
  /// what one may in an hour. Throws DecisionConflict where it cannot be asked for, or is already,
  /// and DecisionTooOften.
  void CheckFrame(Slot slot, const std::string& official, std::int64_t now_ns);
  /// From now on vehicles are asked, until a frame comes or the request is over.
  void AskForFrame(std::uint64_t decision, Slot slot, const std::string& official,
                   std::int64_t now_ns);
  /// Whether the request of that decision is open.
  bool IsFrameOpen(std::uint64_t decision, std::int64_t now_ns);
  /// Nobody is asked for it any more.
  void CancelFrame(std::uint64_t decision);
  /// After a start: the requests that are open in the store, whose hazards are loaded.
  void RestoreFrames(std::int64_t now_ns);

  /// Polls to be sent now.
  std::vector<protocol::Poll> TakeDue(std::int64_t now_ns);
  /// Checks the answer as far as the zone can by itself, takes its place in the vehicle's
  /// allowance, and brings its picture to disk. None when it does not count. Throws StoreError.
  /// What the vehicle's place contradicts is remembered all the same, so that one wrong fix shuts
  /// no vehicle out.
  std::optional<AcceptedAnswer> Accept(const protocol::PollAnswer& answer, std::int64_t now_ns);
  /// What follows from the answer.
  void Apply(const AcceptedAnswer& accepted, ZoneTransaction& transaction);
  /// After the commit: the poll is closed, where the vehicle was is known, and what its picture
  /// costs is taken from it.
  void Close(const AcceptedAnswer& accepted, std::int64_t now_ns);

 private:
  std::optional<PollScheduler::OpenPoll> FindOpen(const Uuid& poll, std::int64_t now_ns);
  bool IsPictureWanted(const protocol::PollAnswer& answer,
                       const PollScheduler::OpenPoll& poll) const;
  bool IsFrameWanted(const protocol::PollAnswer& answer, const PollScheduler::OpenPoll& poll,
                     std::int64_t now_ns);
  void DropOldFrames(std::int64_t now_ns);
  bool IsAcceptable(const protocol::PollAnswer& answer, const PollScheduler::OpenPoll& poll,
                    std::int64_t now_ns) const;

  const ZoneConfig& config_;
  ZoneState& state_;
  HazardSteps& steps_;
  ImageStore& images_;
  PictureAllowance& pictures_;
  VehicleAllowance& allowance_;
  const VehicleTable& vehicles_;
  PlaceBook& places_;

  std::map<Slot, FrameRequest> frames_;  ///< The open ones; none of them is over for long.
  KeyedTokenBuckets<1> frames_of_;       ///< By official, requests.

  Mutex mutex_;
  PollScheduler scheduler_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
