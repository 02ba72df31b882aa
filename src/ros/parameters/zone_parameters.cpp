#include "ros/parameters/zone_parameters.h"

#include <cstdlib>
#include <vector>

namespace livemap::ros_io {
namespace {

/// The numbers of "A,B,..."; empty when `text` is anything else.
std::vector<double> ParseNumbers(const std::string& text, std::size_t count) {
  std::vector<double> numbers;
  const char* at = text.c_str();
  while (numbers.size() < count) {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    const char expected = numbers.size() == count ? '\0' : ',';
    if (end == at || *end != expected) return {};
    at = end + 1;
  }
  return numbers;
}

std::optional<geo::GeoPoint> ReadDatum(ParameterReader& parameters) {
  std::string text;
  parameters.Read("map_datum", text);
  if (text.empty()) return std::nullopt;
  const std::vector<double> numbers = ParseNumbers(text, 2);
  if (numbers.empty() || !geo::IsValid({numbers[0], numbers[1]})) {
    throw Error("parameter 'map_datum' is '" + text +
                "', accepted is LATITUDE,LONGITUDE in degrees, or nothing for the first hazard or "
                "vehicle");
  }
  return geo::GeoPoint{numbers[0], numbers[1]};
}

std::optional<geo::GeoBox> ReadBounds(ParameterReader& parameters) {
  std::string text;
  parameters.Read("zone_bounds", text);
  if (text.empty()) return std::nullopt;
  const std::vector<double> numbers = ParseNumbers(text, 4);
  if (!numbers.empty()) {
    const geo::GeoBox box{{numbers[0], numbers[1]}, {numbers[2], numbers[3]}};
    if (geo::IsValid(box.south_west) && geo::IsValid(box.north_east) && numbers[0] < numbers[2])
      return box;
  }
  throw Error("parameter 'zone_bounds' is '" + text +
              "', accepted is SOUTH,WEST,NORTH,EAST in degrees, or nothing for the whole Earth");
}

template <typename Integer>
void ReadCount(ParameterReader& parameters, const std::string& name, Integer& value,
               ParameterRange range) {
  int number = static_cast<int>(value);
  parameters.Read(name, number, range);
  value = static_cast<Integer>(number);
}

void ReadZone(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  parameters.Read("directory", zone.directory);
  if (zone.directory.empty()) {
    throw Error("parameter 'directory' is empty, accepted is the folder of the zone's store");
  }
  parameters.Read("image_cap_bytes", zone.image_cap_bytes, {0, 1e15});
  parameters.Read("vehicle_retention_s", zone.vehicle_retention_s, {1, 1e6});
  ReadCount(parameters, "max_vehicles", zone.max_vehicles, {1, 1e6});
  ReadCount(parameters, "max_hazards", zone.max_hazards, {1, 1e8});
  parameters.Read("max_reports_per_hour", zone.allowance.reports_per_hour, {1, 1e9});
  ReadCount(parameters, "max_map_changes", zone.map_changes.max_features, {1, 1e6});
  parameters.Read("max_map_changes_per_hour", zone.map_changes_per_hour, {1, 1e9});
  parameters.Read("max_evidence_per_hour", zone.allowance.evidence_per_hour, {1, 1e9});
  ReadCount(parameters, "max_reporting_vehicles", zone.allowance.max_vehicles, {1, 1e7});
  parameters.Read("max_speed_mps", zone.speed.max_speed_mps, {1, 10000});
  parameters.Read("speed_slack_m", zone.speed.slack_m, {0, 100000});
  ReadCount(parameters, "speed_recovery_reports", zone.speed.recovery_reports, {2, 1000});
  zone::ReportLimits& limits = zone.limits;
  limits.zone = ReadBounds(parameters);
  parameters.Read("max_position_sigma_m", limits.max_position_sigma_m, {0.1, 10000});
  parameters.Read("max_future_s", limits.max_future_s, {0, 1e9});
  parameters.Read("max_age_s", limits.max_age_s, {60, 1e10});
  parameters.Read("replay", zone.replay);
  ReadCount(parameters, "max_image_bytes", limits.max_image_bytes, {0, 64e6});
  ReadCount(parameters, "max_image_side_px", limits.max_image_side_px, {1, 65535});
}

void ReadLife(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  zone::HazardLifecycle::Config& life = zone.life;
  parameters.Read("prior_presence", life.prior_presence, {0.01, 0.99});
  parameters.Read("active_above", life.active_above, {0.01, 0.99});
  parameters.Read("active_alone_above", life.active_alone_above, {0.01, 0.99});
  parameters.Read("verify_below", life.verify_below, {0.01, 0.99});
  parameters.Read("sure_above", life.settled_above, {0.01, 0.99});
  parameters.Read("gone_below", life.gone_below, {0.001, 0.5});
  parameters.Read("surest_presence", life.max_presence, {0.5, 0.9999});
  parameters.Read("hostile_share", life.hostile_share, {0, 0.5});
  parameters.Read("suspect_above", life.suspect_above, {0.01, 1});
  parameters.Read("trust_memory_s", zone.trust.memory_s, {60, 1e10});
  zone.trust.hostile_share = life.hostile_share;
  zone.trust.max_vehicles = zone.allowance.max_vehicles;
  ReadCount(parameters, "denials", life.denials, {1, 100});
  parameters.Read("quarantine_s", life.quarantine_s, {0, 1e9});
  ReadCount(parameters, "reopen_vehicles", life.reopen_vehicles, {1, 100});
  parameters.Read("rejected_keep_s", life.rejected_keep_s, {1, 1e10});
  parameters.Read("life_prior_weight", zone.survival.prior_weight, {0.01, 1e6});
  parameters.Read("life_memory", zone.survival.memory, {1, 1e6});
}

void ReadPolls(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  zone::PollScheduler::Config& polls = zone.polls;
  parameters.Read("poll_price_s", polls.price_s, {0.01, 1e9});
  parameters.Read("poll_bytes_per_hour", polls.bytes_per_hour, {1, 1e12});
  parameters.Read("poll_picture_bytes", polls.picture_bytes, {0, 1e6});
  std::string picture = "crop";
  parameters.ReadChoice("poll_picture", picture, {"crop", "full_frame"});
  zone.poll_picture =
      picture == "crop" ? protocol::PollPicture::kCrop : protocol::PollPicture::kFullFrame;
  parameters.Read("poll_picture_share", polls.picture_share, {0, 1});
  parameters.Read("poll_picture_age_s", polls.picture_age_s, {0, 1e10});
  parameters.Read("poll_lookahead_s", polls.lookahead_s, {1, 3600});
  parameters.Read("poll_lookahead_m", polls.lookahead_m, {1, 10000});
  parameters.Read("poll_timeout_s", polls.answer_timeout_s, {1, 3600});
  parameters.Read("poll_same_vehicle_gap_s", polls.same_vehicle_gap_s, {0, 1e7});
  polls.max_vehicles = zone.max_vehicles;
  parameters.Read("sight_range_m", zone.sight.range_m, {1, 1000});
  parameters.Read("sight_half_angle_rad", zone.sight.half_angle_rad, {0.01, 3.2});
  parameters.Read("sight_slack_m", zone.sight.position_slack_m, {0, 1000});
  parameters.Read("sight_window_s", zone.sight.window_s, {0.1, 600});
}

void ReadWeb(ParameterReader& parameters, const std::string& package_path,
             ZoneCloudletConfig& config) {
  web::WebConfig& web = config.web_options;
  web.web_root = package_path + "/web";
  parameters.Read("web", config.web);
  parameters.Read("web_address", web.address);
  parameters.Read("web_port", web.port, {0, 65535});
  std::string web_root;
  parameters.Read("web_root", web_root);
  if (!web_root.empty()) web.web_root = web_root;
  parameters.Read("leaflet_root", web.leaflet_root);
  parameters.Read("tile_url", web.tile_url);
  parameters.Read("tile_attribution", web.tile_attribution);
  parameters.Read("web_title", web.title);
  parameters.Read("web_threads", web.threads, {1, 64});
  ReadCount(parameters, "web_max_connections", web.max_connections, {1, 100000});
  parameters.Read("web_token_file", web.token_file);
  parameters.Read("web_picture_side_px", web.picture_side_px, {16, 16384});
  ReadCount(parameters, "web_picture_cache_bytes", web.picture_cache_bytes, {0, 2e9});
  if (config.map_datum) web.centre = *config.map_datum;
}

void ReadCatchUp(ParameterReader& parameters, ZoneCloudletConfig& config) {
  zone::CatchUpPlanner::Config& catch_up = config.catch_up;
  parameters.Read("join_radius_m", catch_up.radius_m, {1, 100000});
  parameters.Read("join_max_hazards", config.join_max_hazards, {1, 100000});
  parameters.Read("join_picture_bytes", config.join_picture_bytes, {0, 1e8});
  parameters.Read("join_gap_s", catch_up.gap_s, {1, 1e6});
  parameters.Read("catch_up_lag_s", catch_up.lag_s, {0, 3600});
  parameters.Read("catch_up_retry_s", catch_up.retry_s, {0.1, 3600});
  parameters.Read("catch_up_longest_retry_s", catch_up.longest_retry_s, {0.1, 3600});
  catch_up.max_vehicles = config.zone.max_vehicles;
  parameters.Read("notice_picture_bytes", config.notice_picture_bytes, {0, 60000});
  parameters.Read("advance_period_s", config.advance_period_s, {0.05, 60});
}

}  // namespace

ZoneCloudletConfig ReadZoneCloudletConfig(ParameterReader& parameters,
                                          const std::string& package_path) {
  ZoneCloudletConfig config;
  parameters.Read("hazards", config.hazards);
  if (config.hazards.empty()) config.hazards = package_path + "/config/hazards.yaml";
  config.zone.catalogue = protocol::HazardCatalogue::Load(config.hazards);
  ReadZone(parameters, config.zone);
  ReadLife(parameters, config.zone);
  ReadPolls(parameters, config.zone);
  parameters.Read("batch_reports", config.batch_reports, {1, 100000});
  parameters.Read("queue_reports", config.queue_reports, {1, 1e7});
  parameters.Read("queue_bytes", config.queue_bytes, {1e6, 1e12});
  ReadCatchUp(parameters, config);
  parameters.Read("map_frame", config.map_frame);
  config.map_datum = ReadDatum(parameters);
  parameters.Read("marker_period_s", config.marker_period_s, {0.05, 3600});
  parameters.Read("max_markers", config.max_markers, {0, 1e6});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  ReadWeb(parameters, package_path, config);
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
