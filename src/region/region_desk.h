#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "protocol/hazard_catalogue.h"
#include "region/region.h"
#include "region/zone_calls.h"
#include "region/zone_reply.h"
#include "web/access/access.h"
#include "web/api/hazard_api.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"
#include "web/http/site.h"
#include "web/http/web_config.h"
#include "web/officials/official_decision.h"

namespace livemap::region {

/// What those who have logged in at a region read and decide beyond its map. The region keeps none
/// of it: each request goes to the zone that holds the hazard, with the zone's token and the name
/// of who asks, and the zone's answer comes back with the region's ids. Lists are asked of all
/// zones that are up; of those that are down or late the answer has the names (`missing`).
///
/// Thread-safe. Answers come from other threads.
class RegionDesk {
 public:
  using Done = web::Site::Done;

  /// So many hazards that have left the map are remembered because an answer named them, so that
  /// decisions about them can be taken back.
  static constexpr std::size_t kMaxNamed = 20'000;

  /// Keeps the references.
  RegionDesk(web::Access& access, Region& region, const protocol::HazardCatalogue& catalogue);

  /// Whether the path is answered here: decisions, one hazard and what stands below it, pictures,
  /// and the lists over all zones.
  static bool IsAddress(const std::string& path);

  /// Answers a request to such an address, now or later; calls `done` once, unless Stop comes
  /// first. Throws BadRequest before it has called `done`.
  void Answer(const web::RequestTarget& target, const web::HttpRequest& question, const Done& done);
  /// As ZoneCalls::Stop.
  void Stop() { calls_.Stop(); }

 private:
  /// A hazard, and which of the region's zones holds it.
  struct Place {
    std::size_t zone;
    Uuid id;  ///< The region's.
    HazardOrigin origin;
  };
  using Parts = std::vector<ZonePart>;

  void Decide(const web::DecisionTarget& target, const std::string& path,
              const web::HttpRequest& question, const Done& done);
  void ReadHazard(const web::RequestTarget& target, const Done& done);
  void ReadDecisions(const web::RequestTarget& target, const Done& done);
  void ReadPicture(const web::RequestTarget& target, const web::HttpRequest& question,
                   const Done& done);
  /// Asks all zones, and answers what `merge` makes of those that answered.
  void ReadAll(const std::string& url, const std::function<web::Json(const Parts& parts)>& merge,
               const Done& done);
  /// Asks one zone, and answers as it does.
  void AskOne(std::size_t zone, const orders::HttpCall& call,
              const std::function<web::HttpResponse(const orders::HttpAnswer& answer)>& relay,
              const Done& done);
  web::HttpResponse Relay(std::size_t zone, const orders::HttpAnswer& answer, bool is_post) const;
  /// None for a hazard that the region does not know. Throws BadRequest for no UUID.
  std::optional<Place> Find(const std::string& id) const;
  std::size_t ZoneOfName(const std::string& name) const;
  void Remember(const std::vector<NamedHazard>& named);
  /// Puts what the zone knows in place of what the region knows into a decision's body. None, or
  /// the refusal.
  std::optional<web::HttpResponse> Translate(const Place& place, web::Decision decision,
                                             std::string& body) const;
  std::string NameOf(std::size_t zone) const { return "zone '" + region_.zone(zone).id + "'"; }

  web::Access& access_;
  Region& region_;
  const web::HazardApi hazards_;
  std::map<std::string, std::size_t> zones_;  ///< By id.
  mutable Mutex mutex_;
  std::unordered_map<Uuid, HazardOrigin> named_ GUARDED_BY(mutex_);  ///< By the region's id.
  std::deque<Uuid> named_order_ GUARDED_BY(mutex_);                  ///< The oldest first.
  ZoneCalls calls_;  ///< Last: what it does uses all above it.
};

}  // namespace livemap::region
