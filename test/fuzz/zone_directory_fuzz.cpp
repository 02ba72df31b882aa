// What a vehicle gets as the directory of zones: the text of one, which somebody may have signed
// who should not, and a signed document that nobody did. The first byte chooses.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>

#include "common/error.h"
#include "directory/signed_document.h"
#include "directory/zone_directory.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzText(const std::string& text) {
  const auto directory = directory::ZoneDirectory::Parse(text, "input");
  Require(!directory.zones().empty());
  Require(directory.expires_ns() > directory.issued_ns());
  for (const directory::ZoneEntry& zone : directory.zones()) {
    Require(!zone.id.empty() && zone.id.size() <= 64 && !zone.brokers.empty());
    const geo::GeoPoint corner = zone.area.rings().front().front();
    const geo::GeoPoint place{corner.latitude_deg, std::remainder(corner.longitude_deg, 360.0)};
    // Corners lie on the border.
    Require(std::abs(zone.area.DepthM(place)) < 0.01);
    Require(zone.area.IsNear(place, 1));
    Require(directory.Find(place, 1).has_value());
  }
}

void FuzzDocument(const std::string& bytes) {
  static const auto authority =
      directory::TrustedAuthority::Read(LIVEMAP_SOURCE_DIR "/test/directory/authority.pem");
  // The corpus has a document that this authority signed; its key is gone.
  const std::string text = directory::OpenSignedDocument(
      bytes, authority, directory::kDirectorySigner, std::nullopt, 1 << 20, "input");
  Require(text == "signed\n");
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] % 2 == 0) {
      livemap::fuzz::FuzzText(text);
    } else {
      livemap::fuzz::FuzzDocument(text);
    }
  } catch (const livemap::Error&) {
  }
  return 0;
}
