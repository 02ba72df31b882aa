#include "zone/zone_service.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <random>
#include <shared_mutex>
#include <unordered_map>
#include <utility>

#include "base/image_header.h"
#include "zone/event_stream.h"
#include "zone/hazard_registry.h"
#include "zone/image_store.h"
#include "zone/owned_directory.h"
#include "zone/vehicle_table.h"
#include "zone/zone_store.h"

namespace livemap {
namespace {

constexpr std::size_t kMaxReasonBytes = 200;

void CheckSettings(const ZoneService::Config& config) {
  if (!(config.image_cap_bytes >= 0 && config.image_cap_bytes <= 1e15)) {
    throw Error("image_cap_bytes is " + std::to_string(config.image_cap_bytes) +
                ", accepted is 0 to 1e15");
  }
  if (!(config.vehicle_retention_s > 0 && config.vehicle_retention_s <= 1e6)) {
    throw Error("vehicle_retention_s is " + std::to_string(config.vehicle_retention_s) +
                ", accepted is above 0 to 1e6");
  }
  if (config.max_vehicles == 0) throw Error("max_vehicles is 0, accepted is at least 1");
}

Receipt Committed(const Report& report, const Uuid& hazard_uuid) {
  return {Receipt::Status::kCommitted, report.uuid, hazard_uuid, report.vehicle_id, ""};
}

Receipt Refused(const Report& report, const std::string& reason) {
  return {Receipt::Status::kRefused, report.uuid, Uuid{}, report.vehicle_id, reason};
}

}  // namespace

class ZoneService::Implementation {
 public:
  Implementation(Config config, Clock now_ns, std::uint64_t uuid_seed)
      : config_(std::move(config)),
        now_ns_(std::move(now_ns)),
        directory_(config_.directory),
        store_(directory_.path() + "/zone.sqlite3"),
        images_(directory_.path() + "/images", static_cast<std::uint64_t>(config_.image_cap_bytes)),
        vehicles_(config_.vehicle_retention_s, config_.max_vehicles),
        sequence_(store_.LastSequence()),
        generator_(MakeGenerator(uuid_seed, sequence_)),
        registry_(config_.catalogue, generator_()) {
    store_.LoadHazards([this](Hazard hazard) {
      if (hazard.active) images_.Retain(hazard.image_sha256);
      registry_.Restore(std::move(hazard));
    });
  }

  std::vector<Receipt> HandleBatch(const std::vector<Report>& reports);
  bool Remove(const Uuid& uuid, const std::string& reason);
  bool UpdateVehicle(const VehicleState& told);
  ZoneStatistics Statistics() const;

  const Config config_;
  const Clock now_ns_;
  const OwnedDirectory directory_;

  /// One writer at a time: owns store_, generator_ and the right to change what data_mutex_ guards.
  std::mutex writer_mutex_;
  ZoneStore store_;
  ImageStore images_;
  VehicleTable vehicles_;
  EventStream stream_;

  /// Held exclusively from the first change to the end of its commit, so that no reader ever sees
  /// what is not on disk: guards sequence_, registry_ and statistics_.
  mutable std::shared_mutex data_mutex_;
  std::uint64_t sequence_;
  std::mt19937_64 generator_;
  HazardRegistry registry_;
  ZoneStatistics statistics_;
  std::atomic<std::uint64_t> vehicle_positions_{0};
  std::atomic<std::uint64_t> vehicle_positions_refused_{0};

 private:
  /// A report that may change the map.
  struct Candidate {
    std::size_t index = 0;  ///< In the batch.
    PictureName picture;
  };
  /// What a batch did so far, thrown away when its commit fails.
  struct Work {
    std::vector<Receipt> receipts;
    std::vector<Candidate> candidates;
    std::vector<HazardEvent> events;
    std::vector<std::pair<std::string, std::string>> picture_changes;  ///< Before and after.
    std::unordered_map<Uuid, Uuid> hazard_of_report;
    ZoneStatistics counted;
    std::uint64_t sequence = 0;
  };

  /// The same seed gives other ids after a restart: the ids of before are taken.
  static std::mt19937_64 MakeGenerator(std::uint64_t seed, std::uint64_t sequence) {
    std::seed_seq sequence_of_seeds{seed & 0xffffffffU, seed >> 32, sequence & 0xffffffffU,
                                    sequence >> 32};
    return std::mt19937_64(sequence_of_seeds);
  }

  void Triage(const std::vector<Report>& reports, Work& work);
  void Apply(const std::vector<Report>& reports, Work& work);
  void ApplyOne(const Report& report, const PictureName& picture,
                std::optional<HazardRegistry::Slot> match, Work& work);
  template <typename Body>
  void InTransaction(const Body& body);
  void Publish(const std::vector<HazardEvent>& events);
  void Settle(const Work& work);
};

/// First pass, without the lock: what needs no change, what is refused, pictures to disk. A picture
/// whose report is never committed is unreferenced and goes first.
void ZoneService::Implementation::Triage(const std::vector<Report>& reports, Work& work) {
  const std::int64_t now_ns = now_ns_();
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const Report& report = reports[i];
    work.receipts.push_back(Refused(report, ""));
    // A report that was committed stays committed, whatever the limits are now.
    if (const auto hazard_uuid = store_.FindReport(report.uuid)) {
      work.receipts.back() = Committed(report, *hazard_uuid);
      ++work.counted.repeated;
      continue;
    }
    if (const auto why = WhyRefused(report, config_.limits, now_ns)) {
      work.receipts.back().reason = *why;
      ++work.counted.refused;
      continue;
    }
    Candidate candidate{i, {}};
    if (!report.image.empty()) {
      candidate.picture.format =
          FormatName(ReadImageHeader(report.image.data(), report.image.size())->format);
      candidate.picture.sha256 = images_.Put(report.image, candidate.picture.format);
    }
    work.candidates.push_back(std::move(candidate));
  }
  images_.Publish();
}

void ZoneService::Implementation::Apply(const std::vector<Report>& reports, Work& work) {
  for (const Candidate& candidate : work.candidates) {
    const Report& report = reports[candidate.index];
    Receipt& receipt = work.receipts[candidate.index];
    const auto earlier = work.hazard_of_report.find(report.uuid);
    if (earlier != work.hazard_of_report.end()) {
      receipt = Committed(report, earlier->second);
      ++work.counted.repeated;
      continue;
    }
    const auto match = registry_.FindMatch(report.class_name, report.position);
    if (!match && registry_.active_count() >= config_.max_hazards) {
      receipt.reason =
          "the zone holds its maximum of " + std::to_string(config_.max_hazards) + " hazards";
      ++work.counted.refused;
      continue;
    }
    ApplyOne(report, candidate.picture, match, work);
    receipt = Committed(report, work.events.back().hazard.uuid);
  }
}

void ZoneService::Implementation::ApplyOne(const Report& report, const PictureName& picture,
                                           std::optional<HazardRegistry::Slot> match, Work& work) {
  const std::int64_t now_ns = now_ns_();
  const std::uint64_t sequence = ++work.sequence;
  HazardEvent event;
  std::string picture_before;
  if (match) {
    picture_before = registry_.Get(*match).image_sha256;
    registry_.Merge(*match, report, picture, sequence, now_ns);
    event = {HazardAction::kUpdated, registry_.Get(*match)};
    ++work.counted.merged;
  } else {
    Uuid uuid = Uuid::Random(generator_);
    while (registry_.Find(uuid)) uuid = Uuid::Random(generator_);
    const auto slot = registry_.Add(report, picture, uuid, sequence, now_ns);
    event = {HazardAction::kAdded, registry_.Get(slot)};
    ++work.counted.added;
  }
  store_.WriteHazard(event.hazard);
  store_.WriteReport(report, event.hazard.uuid, picture.sha256, now_ns);
  store_.WriteEvent(event, match ? "sighting" : "report");
  work.hazard_of_report.emplace(report.uuid, event.hazard.uuid);
  work.picture_changes.emplace_back(std::move(picture_before), event.hazard.image_sha256);
  work.events.push_back(std::move(event));
}

template <typename Body>
void ZoneService::Implementation::InTransaction(const Body& body) {
  store_.Begin();
  registry_.Begin();
  try {
    body();
    store_.Commit();
  } catch (...) {
    store_.Rollback();
    registry_.Rollback();
    throw;
  }
  registry_.Commit();
}

std::vector<Receipt> ZoneService::Implementation::HandleBatch(const std::vector<Report>& reports) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Work work;
  work.receipts.reserve(reports.size());
  Triage(reports, work);
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    if (!work.candidates.empty()) {
      work.sequence = sequence_;
      InTransaction([&] { Apply(reports, work); });
      sequence_ = work.sequence;
    }
    statistics_.added += work.counted.added;
    statistics_.merged += work.counted.merged;
    statistics_.repeated += work.counted.repeated;
    statistics_.refused += work.counted.refused;
  }
  Settle(work);
  Publish(work.events);
  return std::move(work.receipts);
}

/// Brings the references of pictures up to date with a committed batch.
void ZoneService::Implementation::Settle(const Work& work) {
  for (const auto& [before, after] : work.picture_changes) {
    images_.Retain(after);
    images_.Release(before);
  }
  images_.EvictBeyondCap();
}

void ZoneService::Implementation::Publish(const std::vector<HazardEvent>& events) {
  for (const HazardEvent& event : events) {
    ZoneEvent message;
    message.hazard = event;
    stream_.Publish(message);
  }
}

bool ZoneService::Implementation::Remove(const Uuid& uuid, const std::string& reason) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  HazardEvent event;
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    const auto slot = registry_.Find(uuid);
    if (!slot || !registry_.Get(*slot).active) return false;
    InTransaction([&] {
      registry_.Deactivate(*slot, sequence_ + 1, now_ns_());
      event = {HazardAction::kRemoved, registry_.Get(*slot)};
      store_.WriteHazard(event.hazard);
      store_.WriteEvent(event, reason.substr(0, kMaxReasonBytes));
    });
    ++sequence_;
  }
  images_.Release(event.hazard.image_sha256);
  Publish({event});
  return true;
}

bool ZoneService::Implementation::UpdateVehicle(const VehicleState& told) {
  VehicleState vehicle = told;
  vehicle.heard_ns = now_ns_();
  const std::size_t max_bytes = config_.limits.max_text_bytes;
  const bool acceptable =
      IsPrintableText(vehicle.vehicle_id, max_bytes) &&
      (vehicle.drive_id.empty() || IsPrintableText(vehicle.drive_id, max_bytes)) &&
      IsValid(vehicle.position) && !std::isinf(vehicle.course_rad) &&
      !std::isinf(vehicle.speed_mps) && vehicle.stamp_ns >= 0;
  if (!acceptable) {
    ++vehicle_positions_refused_;
    return false;
  }
  ++vehicle_positions_;
  vehicles_.Update(vehicle);
  ZoneEvent message;
  message.vehicle = std::move(vehicle);
  stream_.Publish(message);
  return true;
}

ZoneStatistics ZoneService::Implementation::Statistics() const {
  const std::shared_lock<std::shared_mutex> lock(data_mutex_);
  ZoneStatistics statistics = statistics_;
  statistics.vehicle_positions = vehicle_positions_;
  statistics.vehicle_positions_refused = vehicle_positions_refused_;
  statistics.active_hazards = registry_.active_count();
  statistics.image_bytes = images_.total_bytes();
  return statistics;
}

ZoneService::ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed) {
  CheckSettings(config);
  implementation_ =
      std::make_unique<Implementation>(std::move(config), std::move(now_ns), uuid_seed);
}

ZoneService::~ZoneService() = default;

Receipt ZoneService::Handle(const Report& report) {
  return implementation_->HandleBatch({report}).front();
}

std::vector<Receipt> ZoneService::HandleBatch(const std::vector<Report>& reports) {
  return implementation_->HandleBatch(reports);
}

std::vector<Hazard> ZoneService::Query(const std::optional<GeoBox>& box,
                                       std::uint64_t since_sequence, std::size_t limit) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.Query(box, since_sequence, limit);
}

std::vector<Hazard> ZoneService::QueryNear(const GeoPoint& centre, double radius_m,
                                           std::size_t limit) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.QueryNear(centre, radius_m, limit);
}

std::optional<Hazard> ZoneService::Find(const Uuid& uuid) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  const auto slot = implementation_->registry_.Find(uuid);
  return slot ? std::optional<Hazard>(implementation_->registry_.Get(*slot)) : std::nullopt;
}

bool ZoneService::Remove(const Uuid& uuid, const std::string& reason) {
  return implementation_->Remove(uuid, reason);
}

std::optional<std::string> ZoneService::ImagePath(const std::string& sha256) const {
  return implementation_->images_.Path(sha256);
}

bool ZoneService::UpdateVehicle(const VehicleState& vehicle) {
  return implementation_->UpdateVehicle(vehicle);
}

std::vector<VehicleState> ZoneService::Vehicles() const {
  return implementation_->vehicles_.List(implementation_->now_ns_());
}

int ZoneService::Subscribe(Subscriber subscriber) {
  return implementation_->stream_.Subscribe(std::move(subscriber));
}

void ZoneService::Unsubscribe(int id) { implementation_->stream_.Unsubscribe(id); }

std::uint64_t ZoneService::Sequence() const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->sequence_;
}

ZoneStatistics ZoneService::Statistics() const { return implementation_->Statistics(); }

}  // namespace livemap
