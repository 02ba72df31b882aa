// Addresses as a stranger types them: parsing must refuse with a sentence or give values that keep
// to the documented ranges, and no name may lead out of the served folder.
#include <cmath>
#include <cstdlib>
#include <string>

#include "common/uuid.h"
#include "web/access/official_authenticator.h"
#include "web/api/query.h"
#include "web/feeds/feed_query.h"
#include "web/feeds/feed_text.h"
#include "web/http/cookie.h"
#include "web/http/gzip_stream.h"
#include "web/http/origin.h"
#include "web/http/static_files.h"
#include "web/officials/account_body.h"
#include "web/officials/desk_body.h"
#include "web/officials/official_decision.h"
#include "web/ogc/ogc_query.h"
#include "web/tiles/tile_file.h"

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckHazardQuery(const livemap::web::RequestTarget& target) {
  try {
    const livemap::web::HazardQuery query = livemap::web::ParseHazardQuery(target);
    Require(query.limit >= 1 && query.limit <= livemap::web::kMaxHazardsPerAnswer);
    if (query.box) {
      Require(livemap::geo::IsValid(query.box->south_west) &&
              livemap::geo::IsValid(query.box->north_east));
      Require(query.box->south_west.latitude_deg <= query.box->north_east.latitude_deg);
    }
  } catch (const livemap::web::BadRequest&) {
    // Refused: what a bad address deserves.
  }
  try {
    const livemap::web::MapChangeQuery query = livemap::web::ParseMapChangeQuery(target);
    Require(query.limit >= 1 && query.limit <= livemap::web::kMaxHazardsPerAnswer);
    Require(query.states.size() <= livemap::zone::kMapChangeStates);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  try {
    Require(livemap::web::ParseEventsQuery(target) <= livemap::web::kMaxEventsPerAnswer);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  try {
    Require(livemap::web::ParsePointsQuery(target).states.size() <= livemap::zone::kHazardStates);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  try {
    const livemap::web::StreetQuery query = livemap::web::ParseStreetQuery(target);
    Require(query.zoom >= 0 && query.zoom <= 22);
    Require(query.box.south_west.longitude_deg <= query.box.north_east.longitude_deg);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  if (const auto tile = livemap::web::ParseTilePath(target.path)) {
    Require(tile->zoom >= 0 && tile->zoom <= 22);
    Require(tile->x >> tile->zoom == 0 && tile->y >> tile->zoom == 0);
  }
  try {
    Require(livemap::web::ParseDecisionsQuery(target).limit <= livemap::web::kMaxEventsPerAnswer);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  try {
    livemap::web::ParseStreamQuery(target);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
}

/// What the feeds are asked for.
void CheckFeedQuery(const livemap::web::RequestTarget& target) {
  try {
    const auto query = livemap::web::ParseFeedQuery(target, {true, true});
    Require(query.states.size() <= livemap::zone::kHazardStates);
    for (const std::string& name : query.classes) Require(!name.empty() && name.size() <= 64);
  } catch (const livemap::web::BadRequest&) {
    // Refused.
  }
  try {
    const livemap::web::OgcQuery query = livemap::web::ParseOgcQuery(target);
    Require(query.limit >= 1 && query.limit <= livemap::web::kMaxOgcItems);
    Require(query.cursor <= INT64_MAX);
    if (query.time) Require(query.time->begin_ns <= query.time->end_ns);
    if (query.box) Require(livemap::geo::IsValid(query.box->south_west));
    // A link to the next page asks for the same, but for the cursor.
    const auto next =
        livemap::web::ParseOgcQuery(livemap::web::ParseTarget(livemap::web::NextPage(target, 7)));
    Require(next.cursor == 7 && next.limit == query.limit);
    Require(next.box.has_value() == query.box.has_value());
    Require(next.time.has_value() == query.time.has_value());
  } catch (const livemap::web::BadRequest&) {
    // Refused, or an address that is too long when it is encoded.
  }
}

/// Texts of the database stay texts in the feeds.
void CheckFeedText(const std::string& text) {
  const std::string xml = livemap::web::XmlText(text);
  Require(xml.find_first_of(std::string("<>\"\0", 4)) == std::string::npos);
  const std::string field = livemap::web::CsvText(text);
  const bool is_quoted = !field.empty() && field.front() == '"';
  if (!is_quoted) Require(field.find_first_of("\",\r\n") == std::string::npos);
  if (!is_quoted && !field.empty()) {
    Require(std::string("=+-@").find(field.front()) == std::string::npos);
  }
}

/// What comes with a POST: its address, its cookie, its token, its body.
void CheckDecision(const std::string& text) {
  const std::string cookie = livemap::web::CookieValue(text, "livemap_12345678");
  Require(cookie.find(';') == std::string::npos && cookie.size() <= text.size());
  const auto target = livemap::web::ParseDecisionTarget(text);
  if (target) {
    const auto uuid = livemap::Uuid::Parse(target->id);
    if (uuid) Require(uuid->ToString().size() == target->id.size());
  }
  try {
    const livemap::web::MapChangeDecision decision = livemap::web::ParseMapChangeDecision(text);
    Require(decision.reason.size() <= livemap::web::kMaxDecisionReasonBytes);
    Require(decision.confirms || decision.undoes || !decision.reason.empty());
    Require(decision.undoes || !decision.decision_id);
  } catch (const livemap::web::BadRequest& mistake) {
    Require(std::string(mistake.what()).find("accepted is") != std::string::npos);
  }
  for (const auto decision : {livemap::web::Decision::kComment, livemap::web::Decision::kAssign,
                              livemap::web::Decision::kClass, livemap::web::Decision::kMove,
                              livemap::web::Decision::kMerge, livemap::web::Decision::kFrame}) {
    try {
      const livemap::zone::DeskAction action = livemap::web::ParseDeskAction(decision, text);
      Require(action.text.size() <= livemap::zone::kMaxDecisionTextBytes);
      Require(action.team.size() <= livemap::zone::kMaxTeamBytes);
      Require(livemap::geo::IsValid(action.position));
    } catch (const livemap::web::BadRequest&) {
      // Refused.
    }
  }
  for (const auto action :
       {livemap::accounts::AccountEventKind::kAdd, livemap::accounts::AccountEventKind::kRole,
        livemap::accounts::AccountEventKind::kSetPassword,
        livemap::accounts::AccountEventKind::kRemove}) {
    try {
      const livemap::web::AccountBody body = livemap::web::ParseAccountBody(action, text);
      Require(body.name.size() <= text.size() && body.password.size() <= text.size());
      Require(body.role.has_value() == (action == livemap::accounts::AccountEventKind::kAdd ||
                                        action == livemap::accounts::AccountEventKind::kRole));
    } catch (const livemap::web::BadRequest& mistake) {
      Require(std::string(mistake.what()).find("accepted") != std::string::npos);
    }
  }
  static livemap::web::OfficialAuthenticator gate({{"miller", std::string(64, 'a')}});
  Require(gate.Check(text, "client", 0).verdict !=
          livemap::web::OfficialAuthenticator::Verdict::kAllowed);
  for (const auto decision : {livemap::web::Decision::kConfirm, livemap::web::Decision::kReject}) {
    try {
      const std::string reason = livemap::web::ParseDecisionBody(decision, text).reason;
      Require(reason.size() <= livemap::web::kMaxDecisionReasonBytes);
      Require(!reason.empty() || decision == livemap::web::Decision::kConfirm);
      for (const char c : reason) Require(static_cast<unsigned char>(c) >= 0x20);
    } catch (const livemap::web::BadRequest& mistake) {
      Require(std::string(mistake.what()).find("accepted is") != std::string::npos);
    }
  }
}

/// A header names codings, and content of any kind is compressed so that it comes out again.
void CheckEncoding(const std::string& text) {
  if (text.find_first_of("zZ*") == std::string::npos) {
    Require(!livemap::web::AcceptsGzip(text));
  }
  livemap::web::GzipStream stream;
  const std::size_t half = text.size() / 2;
  std::string compressed = stream.Compress(text.substr(0, half), false);
  compressed += stream.Compress(text.substr(half), true);
  Require(compressed.size() >= 18 && compressed[0] == '\x1f' && compressed[1] == '\x8b');
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  static const livemap::web::StaticFiles files(LIVEMAP_SOURCE_DIR "/web/icons");
  livemap::web::IsAllowedOrigin(text, "map.example", {"https://city.example"});
  CheckDecision(text);
  CheckEncoding(text);
  CheckFeedText(text);
  // The input as a whole, and as what stands behind the address that has parameters.
  for (const std::string& address : {text, "/api/v1/hazards?" + text}) {
    try {
      const livemap::web::RequestTarget target = livemap::web::ParseTarget(address);
      Require(!target.path.empty() && target.path.front() == '/');
      Require(target.path.find('\0') == std::string::npos);
      CheckHazardQuery(target);
      CheckFeedQuery(target);
      if (files.Find(target.path.substr(1))) Require(target.path.find("..") == std::string::npos);
    } catch (const livemap::web::BadRequest&) {
      // Refused.
    }
  }
  return 0;
}
