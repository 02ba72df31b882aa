#include "zone/zone_service.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "zone/zone_service_state.h"

namespace livemap {
namespace {

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

}  // namespace

ZoneService::Implementation::Implementation(Config config, Clock now_ns, std::uint64_t uuid_seed)
    : config_(std::move(config)),
      now_ns_(std::move(now_ns)),
      directory_(config_.directory),
      store_(directory_.path() + "/zone.sqlite3"),
      images_(directory_.path() + "/images", static_cast<std::uint64_t>(config_.image_cap_bytes)),
      vehicles_(config_.vehicle_retention_s, config_.max_vehicles),
      sequence_(store_.LastSequence()),
      announced_(0),
      generator_(MakeGenerator(uuid_seed, sequence_)),
      registry_(config_.catalogue, generator_()) {
  store_.LoadHazards([this](Hazard hazard) {
    if (IsOnMap(hazard.state)) images_.Retain(hazard.image_sha256);
    announced_ = std::max(announced_, hazard.announced_sequence);
    registry_.Restore(std::move(hazard));
  });
}

std::mt19937_64 ZoneService::Implementation::MakeGenerator(std::uint64_t seed,
                                                           std::uint64_t sequence) {
  std::seed_seq sequence_of_seeds{seed & 0xffffffffU, seed >> 32, sequence & 0xffffffffU,
                                  sequence >> 32};
  return std::mt19937_64(sequence_of_seeds);
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
  statistics.store_errors = store_errors_;
  statistics.active_hazards = registry_.on_map_count();
  statistics.hazards_by_state = registry_.counts();
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
  std::vector<Receipt> receipts = implementation_->HandleBatch({report});
  if (receipts.empty()) throw Error("too many reports of this vehicle within an hour");
  return std::move(receipts.front());
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

std::vector<Hazard> ZoneService::ChangedAround(const GeoPoint& centre, double radius_m,
                                               std::uint64_t since_sequence,
                                               std::size_t limit) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.ChangedAround(centre, radius_m, since_sequence, limit);
}

std::vector<StoredEvent> ZoneService::Events(const Uuid& hazard, std::size_t limit) const {
  return implementation_->Events(hazard, limit);
}

bool ZoneService::Reject(const Uuid& hazard, const std::string& official,
                         const std::string& reason) {
  return implementation_->Reject(hazard, official, reason);
}

bool ZoneService::Confirm(const Uuid& hazard, const std::string& official) {
  return implementation_->Confirm(hazard, official);
}

bool ZoneService::Remove(const Uuid& hazard, const std::string& reason) {
  return implementation_->Remove(hazard, reason);
}

std::vector<PollOrder> ZoneService::TakeDuePolls() { return implementation_->TakeDuePolls(); }

bool ZoneService::HandleAnswer(const PollAnswer& answer) {
  return implementation_->HandleAnswer(answer);
}

void ZoneService::Advance() { implementation_->Advance(); }

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

std::uint64_t ZoneService::AnnouncedSequence() const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->announced_;
}

ZoneStatistics ZoneService::Statistics() const { return implementation_->Statistics(); }

}  // namespace livemap
