#include "zone/belief/map_change_witnesses.h"

#include <algorithm>

#include "common/number_text.h"

namespace livemap::zone {
namespace {

bool WitnessHasDrive(const MapChangeWitness& witness, std::uint64_t drive) {
  return std::find(witness.newest.begin(), witness.newest.end(), drive) != witness.newest.end();
}

void AddWitnessDrive(MapChangeWitness& witness, std::uint64_t drive) {
  std::rotate(witness.newest.begin(), witness.newest.end() - 1, witness.newest.end());
  witness.newest.front() = drive;
  ++witness.drives;
}

std::size_t CountWitnessesOfSide(const std::vector<MapChangeWitness>& witnesses, bool against) {
  return static_cast<std::size_t>(
      std::count_if(witnesses.begin(), witnesses.end(),
                    [against](const MapChangeWitness& one) { return one.against == against; }));
}

std::optional<MapChangeWitness> ReadWitness(NumberReader& reader) {
  MapChangeWitness witness;
  unsigned against = 2;
  unsigned drives = 0;
  reader.Read(witness.vehicle);
  reader.Read(against);
  reader.Read(witness.drives);
  reader.Read(drives);
  if (!reader.good() || witness.vehicle == 0 || against > 1 || drives == 0 ||
      drives > kMaxWitnessDrives || drives > witness.drives) {
    return std::nullopt;
  }
  witness.against = against == 1;
  for (unsigned i = 0; i < drives; ++i) {
    reader.Read(witness.newest[i]);
    if (!reader.good() || witness.newest[i] == 0) return std::nullopt;
  }
  return witness;
}

}  // namespace

WitnessUpdate RecordWitness(std::vector<MapChangeWitness>& witnesses, std::uint64_t vehicle,
                            std::uint64_t drive, bool against) {
  const auto known =
      std::find_if(witnesses.begin(), witnesses.end(), [&](const MapChangeWitness& one) {
        return one.vehicle == vehicle && one.against == against;
      });
  if (known != witnesses.end()) {
    if (WitnessHasDrive(*known, drive)) return WitnessUpdate::kSameDrive;
    AddWitnessDrive(*known, drive);
    return WitnessUpdate::kNewDrive;
  }
  if (CountWitnessesOfSide(witnesses, against) >= kMaxWitnesses) return WitnessUpdate::kTooMany;
  MapChangeWitness witness;
  witness.vehicle = vehicle;
  witness.against = against;
  AddWitnessDrive(witness, drive);
  witnesses.push_back(witness);
  return WitnessUpdate::kNewVehicle;
}

std::string PackWitnesses(const std::vector<MapChangeWitness>& witnesses) {
  std::string line;
  for (const MapChangeWitness& witness : witnesses) {
    AppendNumber(line, witness.vehicle);
    AppendNumber(line, witness.against ? 1U : 0U);
    AppendNumber(line, witness.drives);
    const auto end = std::find(witness.newest.begin(), witness.newest.end(), 0U);
    AppendNumber(line, end - witness.newest.begin());
    for (auto drive = witness.newest.begin(); drive != end; ++drive) AppendNumber(line, *drive);
  }
  return line;
}

std::optional<std::vector<MapChangeWitness>> UnpackWitnesses(const std::string& text) {
  if (text.size() > kMaxPackedWitnessBytes) return std::nullopt;
  NumberReader reader(text);
  std::vector<MapChangeWitness> witnesses;
  while (!reader.done()) {
    const auto witness = ReadWitness(reader);
    if (!witness || CountWitnessesOfSide(witnesses, witness->against) >= kMaxWitnesses)
      return std::nullopt;
    const bool twice = std::any_of(witnesses.begin(), witnesses.end(), [&](const auto& other) {
      return other.vehicle == witness->vehicle && other.against == witness->against;
    });
    if (twice) return std::nullopt;
    witnesses.push_back(*witness);
  }
  return witnesses;
}

}  // namespace livemap::zone
