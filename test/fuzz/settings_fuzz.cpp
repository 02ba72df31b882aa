// Files that an operator or researcher writes: the catalogue of hazards, the officials' tokens,
// label files of data sets, and the camera's mounting, which the vehicle writes itself. The first
// byte chooses.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "common/error.h"
#include "evaluation/detection/labelled_folder.h"
#include "odometry/mounting/mounting_file.h"
#include "protocol/hazard_catalogue.h"
#include "web/access/official_authenticator.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzCatalogue(const std::string& text) {
  const protocol::HazardCatalogue catalogue = protocol::HazardCatalogue::Parse(text, "input");
  for (const auto& [name, hazard_class] : catalogue.classes()) {
    Require(!name.empty() && name.size() <= 64);
    Require(std::isfinite(hazard_class.duplicate_radius_m) && hazard_class.duplicate_radius_m > 0);
    Require(hazard_class.duplicate_radius_m <= catalogue.MaxDuplicateRadiusM());
    Require(std::isfinite(hazard_class.expected_life_s) && hazard_class.expected_life_s > 0);
    Require(hazard_class.colour.size() == 7 && hazard_class.colour[0] == '#');
  }
}

void FuzzTokens(const std::string& text) {
  const auto officials = web::ParseTokenFile(text, "input");
  Require(!officials.empty());
  for (const web::Official& official : officials) {
    Require(!official.name.empty() && official.token_sha256.size() == 64);
  }
  // The file itself is no token of it.
  web::OfficialAuthenticator gate(officials);
  Require(gate.Check("Bearer " + text, "client", 0).verdict !=
          web::OfficialAuthenticator::Verdict::kClosed);
}

void FuzzLabels(const std::string& text) {
  for (const auto& label : evaluation::ParseYoloLabels(text, {"pothole", "deer"}, "input")) {
    Require(label.box.width >= 0 && label.box.height >= 0);
    Require(label.box.x >= 0 && label.box.x + label.box.width <= 1 + 1e-9);
    Require(label.box.y >= 0 && label.box.y + label.box.height <= 1 + 1e-9);
  }
}

void FuzzMounting(const std::string& text) {
  const odometry::MountingRecord record = odometry::ParseMountingFile(text, "input");
  const odometry::Mounting& mounting = record.estimate.mounting;
  Require(std::abs(mounting.yaw_rad) < 1.1 && std::abs(mounting.pitch_rad) < 1.1);
  Require(!record.estimate.height_known || (mounting.height_m > 0 && mounting.height_m <= 10));
  Require(record.estimate.sigma.yaw_rad > 0 && record.camera.fx > 0);
  // What was read is written so that it is read again.
  odometry::ParseMountingFile(odometry::FormatMountingFile(record), "output");
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 4) {
      case 0:
        livemap::fuzz::FuzzCatalogue(text);
        break;
      case 1:
        livemap::fuzz::FuzzTokens(text);
        break;
      case 3:
        livemap::fuzz::FuzzMounting(text);
        break;
      default:
        livemap::fuzz::FuzzLabels(text);
    }
  } catch (const livemap::Error& error) {
    livemap::fuzz::Require(error.what()[0] != '\0');
  }
  return 0;
}
