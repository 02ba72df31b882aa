// Addresses as a stranger types them: parsing must refuse with a sentence or give values that keep
// to the documented ranges, and no name may lead out of the served folder.
#include <cmath>
#include <cstdlib>
#include <string>

#include "common/uuid.h"
#include "web/api/official_authenticator.h"
#include "web/api/official_decision.h"
#include "web/api/query.h"
#include "web/http/origin.h"
#include "web/http/static_files.h"

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckHazardQuery(const livemap::RequestTarget& target) {
  try {
    const livemap::HazardQuery query = livemap::ParseHazardQuery(target);
    Require(query.limit >= 1 && query.limit <= livemap::kMaxHazardsPerAnswer);
    if (query.box) {
      Require(livemap::IsValid(query.box->south_west) && livemap::IsValid(query.box->north_east));
      Require(query.box->south_west.latitude_deg <= query.box->north_east.latitude_deg);
    }
  } catch (const livemap::BadRequest&) {
    // Refused: what a bad address deserves.
  }
  try {
    const livemap::MapChangeQuery query = livemap::ParseMapChangeQuery(target);
    Require(query.limit >= 1 && query.limit <= livemap::kMaxHazardsPerAnswer);
    Require(query.states.size() <= livemap::kMapChangeStates);
  } catch (const livemap::BadRequest&) {
    // Refused.
  }
  try {
    Require(livemap::ParseEventsQuery(target) <= livemap::kMaxEventsPerAnswer);
  } catch (const livemap::BadRequest&) {
    // Refused.
  }
  try {
    livemap::ParseStreamQuery(target);
  } catch (const livemap::BadRequest&) {
    // Refused.
  }
}

/// What comes with a POST: its address, its token, its body.
void CheckDecision(const std::string& text) {
  const auto target = livemap::ParseDecisionTarget(text);
  if (target) {
    const auto uuid = livemap::Uuid::Parse(target->id);
    if (uuid) Require(uuid->ToString().size() == target->id.size());
  }
  try {
    const livemap::MapChangeDecision decision = livemap::ParseMapChangeDecision(text);
    Require(decision.reason.size() <= livemap::kMaxDecisionReasonBytes);
    Require(decision.confirms || !decision.reason.empty());
  } catch (const livemap::BadRequest& mistake) {
    Require(std::string(mistake.what()).find("accepted is") != std::string::npos);
  }
  static livemap::OfficialAuthenticator gate({{"miller", std::string(64, 'a')}});
  Require(gate.Check(text, "client", 0).verdict != livemap::OfficialAuthenticator::Verdict::kAllowed);
  for (const auto decision : {livemap::Decision::kConfirm, livemap::Decision::kReject}) {
    try {
      const std::string reason = livemap::ParseDecisionBody(decision, text);
      Require(reason.size() <= livemap::kMaxDecisionReasonBytes);
      Require(!reason.empty() || decision == livemap::Decision::kConfirm);
      for (const char c : reason) Require(static_cast<unsigned char>(c) >= 0x20);
    } catch (const livemap::BadRequest& mistake) {
      Require(std::string(mistake.what()).find("accepted is") != std::string::npos);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  static const livemap::StaticFiles files(LIVEMAP_SOURCE_DIR "/web/icons");
  livemap::IsAllowedOrigin(text, "map.example", {"https://city.example"});
  CheckDecision(text);
  // The input as a whole, and as what stands behind the address that has parameters.
  for (const std::string& address : {text, "/api/v1/hazards?" + text}) {
    try {
      const livemap::RequestTarget target = livemap::ParseTarget(address);
      Require(!target.path.empty() && target.path.front() == '/');
      Require(target.path.find('\0') == std::string::npos);
      CheckHazardQuery(target);
      if (files.Find(target.path.substr(1))) Require(target.path.find("..") == std::string::npos);
    } catch (const livemap::BadRequest&) {
      // Refused.
    }
  }
  return 0;
}
