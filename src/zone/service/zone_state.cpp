#include "zone/service/zone_state.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "common/error.h"

namespace livemap::zone {
namespace {

std::mt19937_64 MakeGenerator(std::uint64_t seed, std::uint64_t sequence) {
  std::seed_seq sequence_of_seeds{seed & 0xffffffffU, seed >> 32, sequence & 0xffffffffU,
                                  sequence >> 32};
  return std::mt19937_64(sequence_of_seeds);
}

}  // namespace

ZoneState::ZoneState(const ZoneConfig& config, const std::string& directory,
                     std::uint64_t uuid_seed)
    : store(config.store_url.empty() ? directory + "/zone.sqlite3" : config.store_url,
            config.lease ? config.lease->epoch() : 0),
      survival(config.catalogue, config.survival),
      trust(config.trust),
      sequence(store.LastSequence()),
      generator(MakeGenerator(uuid_seed, sequence)),
      hazards(config.catalogue, generator()),
      map_changes(config.map_changes, generator()) {
  Load();
}

void ZoneState::Load() {
  damage += store.LoadLives([this](const std::string& class_name, LearnedLifetime learned) {
    survival.Restore(class_name, learned);
  });
  damage += store.LoadTrust([this](std::uint64_t vehicle, const TrustRecord& record) {
    if (!trust.Restore(vehicle, record)) throw Error("a vehicle's trust is no such record");
  });
  std::unordered_map<std::uint64_t, double> courses;
  damage += store.LoadCourses(
      [&](std::uint64_t id, double course_rad) { courses.emplace(id, course_rad); });
  std::unordered_map<std::uint64_t, std::vector<protocol::Trail>> trails;
  damage += store.LoadTrails([&](std::uint64_t id, std::vector<protocol::Trail> known) {
    trails.emplace(id, std::move(known));
  });
  damage += store.LoadHazards([&](const ZoneStore::HazardRow& row) {
    Hazard hazard = row.hazard;
    const auto course = courses.find(row.id);
    if (course != courses.end()) hazard.course_rad = course->second;
    const auto known = trails.find(row.id);
    if (known != trails.end())
      hazard.trails = protocol::ValidTrails(known->second, hazard.position);
    // A store of before the catalogue ruled may hold any names.
    hazard.class_name = hazards.HeadingOf(hazard.class_name);
    hazards.Restore(hazard, row.life, static_cast<std::uint32_t>(row.id));
    announced = std::max(announced, row.hazard.announced_sequence);
    sequence = std::max(sequence, row.hazard.sequence);
  });
  hazards.SkipIdsTo(static_cast<std::uint32_t>(store.LastHazardId()));
  damage += store.LoadMapChanges([this](const ZoneStore::MapChangeRow& row) {
    map_changes.Restore(static_cast<std::uint32_t>(row.id), row.feature);
    sequence = std::max(sequence, row.feature.sequence);
  });
  map_changes.SkipIdsTo(static_cast<std::uint32_t>(store.LastMapChangeId()));
  damage += store.LoadRedirects([this](Redirect redirect) { redirects.Add(std::move(redirect)); });
  damage += store.CheckWithdrawals();
}

}  // namespace livemap::zone
