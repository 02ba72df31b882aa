#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include "common/mutex.h"
#include "zone/admission/report_validation.h"
#include "zone/admission/speed_rule.h"
#include "zone/model/store_damage.h"
#include "zone/model/vehicle_state.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// Where every vehicle was, by all that it told and that was accepted: reports, map changes and
/// answers, which are stored, and positions, which are not. One rule of speed holds for all of
/// them. Bounded: beyond the number of vehicles the longest silent one is forgotten; what is stored
/// of it is read again when something of it is to be stored.
///
/// What a batch tries stays a draft, in the book, until Keep: positions that come meanwhile count
/// in the draft and without it, so that neither a commit nor a failed one loses any of them.
///
/// The functions about drafts, Load, SaveCounts, ForgetOld and HasHeardOf are for the writer, who
/// holds the writer's lock; Save runs in a transaction. ChallengePosition may be called by any
/// thread.
class PlaceBook {
 public:
  struct Config {
    SpeedRule speed;
    ReportLimits limits;  ///< What is older than max_age_s is neither accepted nor remembered.
    std::size_t max_vehicles = 10000;
  };

  /// As long as it lives its batch has drafts; those that were not kept by then are forgotten, so
  /// that a failed commit leaves no trace. One at a time; the book outlives it.
  class Drafts {
   public:
    explicit Drafts(PlaceBook& book) : book_(book) {}
    ~Drafts() { book_.ForgetDrafts(); }
    Drafts(const Drafts&) = delete;
    Drafts& operator=(const Drafts&) = delete;

   private:
    PlaceBook& book_;
  };

  /// The store outlives it.
  PlaceBook(const Config& config, ZoneStore& store) : config_(config), store_(store) {}

  /// Takes in the places that the store has. Throws StoreError.
  StoreDamage Load();

  /// Why the vehicle cannot have been there then; none when it can, and then it was, in its draft.
  /// Throws StoreError.
  std::optional<Refusal> Challenge(const std::string& vehicle_id, const ReportedFix& fix);
  /// Writes what the drafts changed, but for what SaveCounts writes. `now_ns` is the zone's clock.
  /// Throws StoreError.
  void Save(std::int64_t now_ns);
  /// The drafts hold: after the commit, or where nothing was to be committed.
  void Keep(std::int64_t now_ns);

  /// Writes for how many messages places stand that have not changed otherwise, so that the reports
  /// of a vehicle that stands do not write its place each. A crash loses the counts of a second, no
  /// place. To be called about once a second, in no transaction. Throws StoreError: then it is
  /// tried again.
  void SaveCounts();

  /// Drops what is too old from the store, a few vehicles at each call, every vehicle about once an
  /// hour, and then from memory; the newest place of each vehicle stays. To be called about once a
  /// second, in no transaction. Throws StoreError: then it is tried again.
  void ForgetOld(std::int64_t now_ns);

  /// Forgets what memory has of the vehicle; the store's rows go by ZoneStore::EraseStep. For the
  /// writer.
  void Forget(const std::string& vehicle_id);

  /// Why the zone does not believe a position; none when it does, and then it is remembered.
  /// `vehicle.heard_ns` is the zone's clock.
  std::optional<Refusal> ChallengePosition(const VehicleState& vehicle);

  /// Whether anything of the vehicle was ever accepted, or refused for its speed. Throws
  /// StoreError.
  bool HasHeardOf(const std::string& vehicle_id) const;

 private:
  struct Entry {
    ReportTrack track;
    bool is_read = false;                    ///< What is stored of the vehicle is in the track.
    std::int64_t heard_ns = 0;               ///< Zone clock.
    std::int64_t challenged_ns = INT64_MIN;  ///< Of the last position that counted, zone clock.
  };

  ReportTrack Read(const std::string& vehicle_id);
  Entry& EntryOf(const std::string& vehicle_id) REQUIRES(mutex_);
  ReportTrack* DraftOf(const std::string& vehicle_id, const std::optional<ReportTrack>& stored)
      REQUIRES(mutex_);
  void ForgetDrafts();
  std::int64_t OldestNs(std::int64_t now_ns) const;

  const Config config_;
  ZoneStore& store_;
  mutable Mutex mutex_;
  std::unordered_map<std::string, Entry> entries_ GUARDED_BY(mutex_);
  std::map<std::string, ReportTrack> drafts_ GUARDED_BY(mutex_);  ///< By vehicle.

  std::set<std::string> uncounted_;  ///< The writer's: vehicles that SaveCounts must look at.

  // The writer's, for ForgetOld.
  std::string pruned_up_to_;    ///< The last vehicle of this walk over all; empty between walks.
  std::int64_t walked_ns_ = 0;  ///< End of the last walk, zone clock.
};

}  // namespace livemap::zone
