#include "ros/parameters/zone_cloudlet_parameters.h"

#include <cstdlib>
#include <vector>

#include "common/comma_list.h"
#include "ros/parameters/shared/datum_parameter.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "zone/store/postgresql_url.h"

namespace livemap::ros_io {
namespace {

/// The numbers of "A,B,..."; empty when `text` is anything else.
std::vector<double> ParseZoneNumbers(const std::string& text, std::size_t count) {
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

std::optional<geo::GeoBox> ReadZoneBounds(ParameterReader& parameters) {
  std::string text;
  parameters.Read("zone_bounds", text,
                  "SOUTH,WEST,NORTH,EAST in degrees. Reports from outside are refused. WEST > EAST "
                  "crosses the antimeridian. Empty: the whole Earth.");
  if (text.empty()) return std::nullopt;
  const std::vector<double> numbers = ParseZoneNumbers(text, 4);
  if (!numbers.empty()) {
    const geo::GeoBox box{{numbers[0], numbers[1]}, {numbers[2], numbers[3]}};
    if (geo::IsValid(box.south_west) && geo::IsValid(box.north_east) && numbers[0] < numbers[2])
      return box;
  }
  throw Error("parameter 'zone_bounds' is '" + text +
              "', accepted is SOUTH,WEST,NORTH,EAST in degrees, or nothing for the whole Earth");
}

void ReadZoneKept(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  parameters.Section("What is kept");
  parameters.Read("image_cap_bytes", zone.image_cap_bytes, {0, 1e15},
                  "Size of the pictures on disk. Beyond it pictures that no hazard shows go first, "
                  "then the oldest.",
                  "bytes");
  parameters.Read(
      "picture_days", zone.picture_days, {0, 36500},
      "Pictures are deleted so long after they came, also those that hazards on the map "
      "show. 0: only image_cap_bytes bounds them.",
      "days");
  parameters.Read("vehicle_retention_s", zone.vehicle_retention_s, {1, 1e6},
                  "A vehicle that was not heard of for this long is forgotten.", "s");
  parameters.Read(
      "max_vehicles", zone.max_vehicles, {1, 1e6},
      "Number of vehicles. Beyond it the vehicle that was silent for longest is forgotten.");
  parameters.Read("max_hazards", zone.max_hazards, {1, 1e8},
                  "Number of hazards on the map. Beyond it new ones are refused.");
  parameters.Read(
      "max_hazards_by_one_vehicle", zone.max_hazards_by_one_vehicle, {1, 1e8},
      "Number of hazards on the map that one vehicle alone has seen and no official has "
      "confirmed. Beyond it new ones of this vehicle are refused.");
  parameters.Read(
      "max_map_changes", zone.map_changes.max_features, {1, 1e6},
      "Number of map changes (objects that came or went), undone and dismissed ones too. Beyond it "
      "the oldest of these goes. Where only open ones are left, new ones are refused.");
}

void ReadZoneReportLimits(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  zone::ReportLimits& limits = zone.limits;
  parameters.Section(
      "Limits of a report",
      "A report beyond a limit is refused for good, except beyond the limits per hour.");
  parameters.Read("max_position_sigma_m", limits.max_position_sigma_m, {0.1, 10000},
                  "Largest standard deviation of a reported position along its worst direction.",
                  "m");
  parameters.Read("max_future_s", limits.max_future_s, {0, 1e9},
                  "How far an image's stamp may lie ahead of the zone's clock.", "s");
  parameters.Read("max_age_s", limits.max_age_s, {60, 1e10},
                  "How far an image's stamp may lie behind the zone's clock. A report may wait "
                  "long in a vehicle's outbox.",
                  "s");
  parameters.Read(
      "replay", zone.replay,
      "true: drives are played back. Reports count as of their arrival, and max_age_s does not "
      "hold. Never use it in a zone that drivers rely on: it lets old reports in.");
  parameters.Read(
      "hazard_trails", zone.hazard_trails,
      "true: vehicles are told how the first two vehicles that reported a hazard passed it: 300 m "
      "of their ways before and behind it, without their names. Drivers without a street file are "
      "warned in time in bends by that, and not of other streets.");
  parameters.ReadChoice<zone::UnknownClasses>(
      "unknown_classes", zone.unknown_classes,
      {{"other", zone::UnknownClasses::kOther}, {"refuse", zone::UnknownClasses::kRefuse}},
      "What becomes of reports of a class that the catalogue does not name: other (all are counted "
      "under the one class `other`, and no vehicle is polled about them) or refuse. A catalogue "
      "without any class takes every name.");
  parameters.Read("max_speed_mps", zone.speed.max_speed_mps, {1, 10000},
                  "Largest speed of a vehicle between two places that it told, by reports, map "
                  "changes, answers or positions: between each and those before and after it in "
                  "time.",
                  "m/s");
  parameters.Read("speed_slack_m", zone.speed.slack_m, {0, 100000},
                  "Distance by which two places may be further apart than that: hazards lie "
                  "beside the vehicle.",
                  "m");
  parameters.Read("speed_recovery_reports", zone.speed.recovery_reports, {2, 1000},
                  "Least number of places, refused in a row for their speed, that agree among "
                  "themselves: then they are believed, if they are more than what contradicts "
                  "them.");
  parameters.Read("max_reports_per_hour", zone.allowance.reports_per_hour, {1, 1e9},
                  "Reports of one vehicle per hour. Further ones are not taken now; the vehicle "
                  "sends them again.");
  parameters.Read(
      "max_evidence_per_hour", zone.allowance.evidence_per_hour, {1, 1e9},
      "Evidence of one vehicle per hour: its sightings of known hazards and its answers that "
      "count. Beyond it a sighting is counted but says nothing of the hazard.");
  parameters.Read("max_map_changes_per_hour", zone.map_changes_per_hour, {1, 1e9},
                  "Reports of map changes of one vehicle per hour. Further ones are not taken now; "
                  "the vehicle sends them again.");
  parameters.Read("max_reporting_vehicles", zone.allowance.max_vehicles, {1, 1e7},
                  "Number of vehicles whose reports per hour are counted and whose trust is kept. "
                  "Beyond it new ones wait until another was silent for an hour.");
  parameters.Read("max_image_bytes", limits.max_image_bytes, {0, 64e6}, "Largest picture.",
                  "bytes");
  parameters.Read("max_picture_pixels_per_hour", zone.pictures.pixels_per_hour, {1, 1e15},
                  "Pixels of one vehicle's pictures per hour, by what decoding them costs. Beyond "
                  "it a report counts without its picture.",
                  "px");
  parameters.Read("max_picture_bytes_per_hour", zone.pictures.bytes_per_hour, {1, 1e15},
                  "Bytes of one vehicle's pictures per hour. Beyond it a report counts without its "
                  "picture.",
                  "bytes");
  zone.pictures.max_vehicles = zone.allowance.max_vehicles;
  parameters.Read("max_image_side_px", limits.max_image_side_px, {1, 65535},
                  "Longest side of the original image, and of the picture by its header.", "px");
}

void ReadZoneCommits(ParameterReader& parameters, ZoneCloudletConfig& config) {
  parameters.Section("Group commit");
  parameters.Read("batch_reports", config.batch_reports, {1, 100000},
                  "Most reports of one commit.");
  parameters.Read("queue_reports", config.queue_reports, {1, 1e7},
                  "Number of reports that may wait for a commit. Further ones are not taken, and "
                  "counted; their vehicles send them again.");
  parameters.Read("queue_bytes", config.queue_bytes, {1e6, 1e12}, "The same in bytes of pictures.",
                  "bytes");
}

void ReadZoneCatchUp(ParameterReader& parameters, ZoneCloudletConfig& config) {
  zone::CatchUpPlanner::Config& catch_up = config.catch_up;
  catch_up.cell_wait_s = 5;
  parameters.Section(
      "What one vehicle is told",
      "The zone tells a vehicle everything around it when it is new here, was silent for "
      "join_gap_s or has driven half of join_radius_m; and what it missed when it says so. A "
      "vehicle that asks about cells of the map is told those instead "
      "(docs/explanation/delivery.md).");
  parameters.Read("join_radius_m", catch_up.radius_m, {1, 100000},
                  "Hazards within this distance of the vehicle are told.", "m");
  parameters.Read("join_max_hazards", config.join_max_hazards, {1, 100000},
                  "Most hazards that one vehicle is told at once, the nearest ones.");
  parameters.Read("join_picture_bytes", config.join_picture_bytes, {0, 1e8},
                  "Size of all small pictures of what one vehicle is told at once, the nearest "
                  "hazards first. 0: none.",
                  "bytes");
  parameters.Read("join_gap_s", catch_up.gap_s, {1, 1e6},
                  "A vehicle that was silent for this long joins anew.", "s");
  parameters.Read("catch_up_lag_s", catch_up.lag_s, {0, 3600},
                  "Time that an announcement may be on its way before it counts as missed.", "s");
  parameters.Read(
      "catch_up_retry_s", catch_up.retry_s, {0.1, 3600},
      "Time before a vehicle that still lacks something is told again. It doubles each time.", "s");
  parameters.Read("catch_up_longest_retry_s", catch_up.longest_retry_s, {0.1, 3600},
                  "Longest time before a vehicle is told again.", "s");
  parameters.Read("notices_to_all", config.notices_to_all,
                  "Tell announcements to every vehicle on hazard/notice, too, as vehicles that do "
                  "not ask about cells need it. false: only to the vehicles near the hazard.");
  parameters.Read("cell_wait_s", catch_up.cell_wait_s, {0, 60},
                  "Time in which a new vehicle may ask about cells before it is told everything "
                  "around it.",
                  "s");
  parameters.Read("notice_picture_bytes", config.notice_picture_bytes, {0, 60000},
                  "Size of the small picture in a notice of a new hazard. 0: none.", "bytes");
  parameters.Read("advance_period_s", config.advance_period_s, {0.05, 60},
                  "Time between two looks at which hazards time has changed and whom to ask.", "s");
  catch_up.max_vehicles = config.zone.max_vehicles;
}

/// The ranges are those of HazardLifecycle, which also compares the values with each other.
void ReadZoneLife(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  zone::HazardLifecycle::Config& life = zone.life;
  parameters.Renamed("sure_above", "settled_above");
  parameters.Renamed("surest_presence", "max_presence");
  parameters.Renamed("hostile_share", "malicious_share");
  parameters.Renamed("denials", "denying_vehicles");
  parameters.Section("Lifecycle of a hazard",
                     "Presence, 0..1, is how sure the zone is that a hazard is there: "
                     "docs/explanation/hazard-lifecycle.md.");
  parameters.Read("prior_presence", life.prior_presence, {0.01, 0.99},
                  "Presence before the first vehicle gives evidence.");
  parameters.Read("active_above", life.active_above, {0.01, 0.99},
                  "Least presence to tell drivers, besides the class's `confirmations`.");
  parameters.Read("active_alone_above", life.active_alone_above, {0.01, 0.99},
                  "The same for classes whose `confirmations` are 1, and the least presence at "
                  "which these are not verified.");
  parameters.Read("verify_below", life.verify_below, {0.01, 0.99},
                  "Presence below which vehicles are asked whether the hazard is still there.");
  parameters.Read("settled_above", life.settled_above, {0.01, 0.99},
                  "Presence from which on they no longer are. At least verify_below.");
  parameters.Read("gone_below", life.gone_below, {0.01, 0.5},
                  "Presence below which the hazard leaves the map.");
  parameters.Read("max_presence", life.max_presence, {0.9, 0.9999},
                  "Presence never counts as more certain than this.");
  parameters.Read("malicious_share", life.malicious_share, {0.001, 0.4},
                  "Share of vehicles that may say what they like.");
  parameters.Read("suspect_above", life.suspect_above, {0.01, 1},
                  "A vehicle that is malicious this probably, by what became of its evidence, does "
                  "not count as one.");
  parameters.Read("trust_memory_s", zone.trust.memory_s, {60, 1e10},
                  "Time in which what is held against a vehicle fades to 1/e.", "s");
  parameters.Read("denying_vehicles", life.denying_vehicles, {2, zone::kMaxEvidencePerHazard - 1},
                  "Distinct vehicles that deny a hazard before it is gone.");
  parameters.Read("quarantine_s", life.quarantine_s, {0, 1e9},
                  "Time that a rejected hazard takes no support.", "s");
  parameters.Read("reopen_vehicles", life.reopen_vehicles, {2, zone::kMaxEvidencePerHazard},
                  "Distinct vehicles that reopen it afterwards.");
  parameters.Read("rejected_keep_s", life.rejected_keep_s, {3600, 1e9},
                  "Time without support after which a rejected hazard is forgotten.", "s");
  parameters.Read("life_prior_weight", zone.survival.prior_weight, {0.01, 1e6},
                  "Number of ended lives that `expected_life_s` of the catalogue counts as.");
  parameters.Read("life_memory", zone.survival.memory, {1, 1e6},
                  "Number of ended lives that count at most; older ones fade.");
  zone.trust.malicious_share = life.malicious_share;
  zone.trust.max_vehicles = zone.allowance.max_vehicles;
}

void ReadZonePolls(ParameterReader& parameters, zone::ZoneService::Config& zone) {
  zone::PollScheduler::Config& polls = zone.polls;
  parameters.Section("Polls",
                     "Whom the zone asks, and whose answer counts: docs/explanation/polls.md.");
  parameters.Read("poll_price_s", polls.price_s, {0.01, 1e9},
                  "Price of a poll, as the time that a hazard stands wrongly on the map.", "s");
  parameters.Read("poll_bytes_per_hour", polls.bytes_per_hour, {1, 1e12},
                  "Size of polls, answers and pictures together per hour in the long run; at most "
                  "twice as many in one hour.",
                  "bytes");
  parameters.Read("poll_picture_bytes", polls.picture_bytes, {0, 1e6},
                  "Largest picture of an answer. 0: none is asked for.", "bytes");
  parameters.ReadChoice<protocol::PollPicture>(
      "poll_picture", zone.poll_picture,
      {{"crop", protocol::PollPicture::kCrop}, {"full_frame", protocol::PollPicture::kFullFrame}},
      "What such a picture shows: crop (the place and its surroundings) or full_frame. It becomes "
      "the hazard's picture, which officials see in the hazard's popup above the buttons by which "
      "they decide.");
  parameters.Read("poll_frame_bytes", polls.frame_bytes, {0, 1e6},
                  "Largest whole frame of a hazard for which an official asks the next vehicle. It "
                  "is taken from poll_bytes_per_hour. 0, or more than poll_bytes_per_hour: none is "
                  "asked for.",
                  "bytes");
  parameters.Read("frame_timeout_s", zone.frame_timeout_s, {60, 1e6},
                  "Time that a request for a whole frame is open.", "s");
  parameters.Read("frames_per_hour", zone.frames_per_hour, {1, 10000},
                  "Number of whole frames for which one official may ask in an hour.");
  parameters.Read("poll_picture_share", polls.picture_share, {0, 1},
                  "Pictures are asked for while more than this share of the bytes is left.");
  parameters.Read("poll_picture_age_s", polls.picture_age_s, {0, 1e10},
                  "Age after which a hazard's picture is renewed.", "s");
  parameters.Read("poll_lookahead_s", polls.lookahead_s, {1, 3600},
                  "Most time before it passes the place that a vehicle is asked.", "s");
  parameters.Read("poll_lookahead_m", polls.lookahead_m, {1, 10000},
                  "Most distance ahead of it at which a vehicle is asked.", "m");
  parameters.Read("poll_timeout_s", polls.answer_timeout_s, {1, 3600}, "Time that a poll is open.",
                  "s");
  parameters.Read("poll_same_vehicle_gap_s", polls.same_vehicle_gap_s, {0, 1e7},
                  "Time before the same vehicle is asked about the same hazard again.", "s");
  polls.max_vehicles = zone.max_vehicles;
  parameters.Read("sight_range_m", zone.sight.range_m, {1, 1000},
                  "An answer counts only from a vehicle that was within this distance, by the "
                  "positions that the zone knows.",
                  "m");
  parameters.Read("sight_half_angle_rad", zone.sight.half_angle_rad, {0.01, 3.2},
                  "Half of the camera's horizontal view: the place must lie within it.", "rad");
  parameters.Read("sight_slack_m", zone.sight.position_slack_m, {0, 1000},
                  "Errors of the vehicle's and the hazard's positions together.", "m");
  parameters.Read("sight_window_s", zone.sight.window_s, {0.1, 600},
                  "Time by which an answer's stamp may be off.", "s");
}

void ReadZoneStreets(ParameterReader& parameters, ZoneCloudletConfig& config) {
  parameters.Section("The streets that the zone knows",
                     "docs/how-to/show-streets.md. Made by others, from OpenStreetMap.");
  parameters.Read("streets", config.streets,
                  "Path of an extract of OpenStreetMap with the zone's streets (.osm.pbf or .osm). "
                  "Hazards get the names of their streets, those of the two carriageways of a "
                  "street are kept apart, and the live map draws the streets. Empty: none of "
                  "this. zone.launch sets it by the argument `streets`.");
}

void ReadZoneOrders(ParameterReader& parameters, ZoneCloudletConfig& config) {
  parameters.Section("Work orders", "docs/how-to/send-work-orders.md.");
  parameters.Read("work_orders", config.work_orders,
                  "Path of the file that says which hazards become work orders, and to whom they "
                  "are sent (docs/reference/work-orders.md). Empty: none. zone.launch sets it by "
                  "the argument `work_orders`.");
}

void ReadZoneMarkers(ParameterReader& parameters, ZoneCloudletConfig& config) {
  parameters.Section("rviz");
  parameters.Read("map_frame", config.map_frame, "Frame of hazard/markers: x east, y north.");
  config.map_datum = ReadDatum(parameters, "the first place that others agree with",
                               "LATITUDE,LONGITUDE of the map frame's origin, degrees, and where "
                               "an empty live map looks. Empty: the first place of a hazard or a "
                               "vehicle that others agree with.");
  parameters.Read("marker_period_s", config.marker_period_s, {0.05, 3600},
                  "Time between two pictures of a changing map.", "s");
  parameters.Read("max_markers", config.max_markers, {0, 1e6}, "Number of hazards shown in rviz.");
  parameters.Section("Period of the diagnostics");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
}

void ReadZoneWeb(ParameterReader& parameters, const std::string& package_path,
                 ZoneCloudletConfig& config) {
  web::WebConfig& web = config.web_options;
  parameters.Section("Live map",
                     "Before it faces a public network it needs a certificate, or a proxy that "
                     "speaks TLS (docs/operations.md).");
  parameters.Read("web", config.web, "Serve the live map. false: no web server.");
  parameters.Read("web_address", web.address,
                  "Address to listen on; 0.0.0.0 serves the whole network. zone.launch sets it by "
                  "the argument `web_address`.");
  parameters.Read("web_port", web.port, {0, 65535},
                  "Port to listen on. 0: any free port; the one taken is in the parameter "
                  "/livemap/web_port. zone.launch sets it by the argument `web_port`.");
  parameters.Read("web_certificate", web.certificate_file,
                  "PEM file of the server's certificate, and then of those between it and the "
                  "root: with it the live map is served by HTTPS alone. A newer pair of files is "
                  "taken within seconds. Empty: plain HTTP. zone.launch sets it by the argument "
                  "`web_certificate`.");
  parameters.Read("web_key", web.key_file,
                  "PEM file of its private key without a password, which others than its owner "
                  "and group may not read. zone.launch sets it by the argument `web_key`.");
  parameters.Read("web_http_redirect_port", web.redirect_port, {0, 65535},
                  "Port at which plain HTTP leads to HTTPS. 0: none.");
  parameters.Read("web_hsts_s", web.hsts_s, {0, 1e9},
                  "Time for which a browser that was here by HTTPS asks this host by HTTPS alone, "
                  "at all its ports (Strict-Transport-Security). 0: it is not told so.",
                  "s");
  parameters.Read("web_root", web.web_root, "Folder of the page. Empty: web/ of the package.");
  if (web.web_root.empty()) web.web_root = package_path + "/web";
  parameters.Read("leaflet_root", web.leaflet_root, "Folder that holds Debian's leaflet/.");
  parameters.Read("tile_url", web.tile_url,
                  "Address of map tiles, for example https://tiles.example/{z}/{x}/{y}.png. Empty: "
                  "plain background, offline. zone.launch sets it by the argument `tile_url`.");
  parameters.Read("tile_attribution", web.tile_attribution,
                  "Credit that the tiles' provider asks for. zone.launch sets it by the argument "
                  "`tile_attribution`.");
  parameters.Read("tiles", web.tile_file,
                  "Path of a file of raster map tiles (.mbtiles), in place of tile_url. Empty: "
                  "none. zone.launch sets it by the argument `tiles`.");
  parameters.Read("web_title", web.title, "Title of the page.");
  parameters.Read(
      "web_public_url", web.public_url,
      "Address at which others reach the server, for example https://map.example. Links "
      "in feeds begin with it. Empty: http:// or https:// and the host that the request names.");
  parameters.Read("feed_publisher", web.feed_publisher,
                  "Who publishes the feeds (docs/reference/feeds.md). Empty: web_title.");
  parameters.Read("feed_country", web.feed_country,
                  "Country of who publishes the feeds: two lower-case letters (ISO 3166-1); zz: "
                  "not said.");
  parameters.Read("web_threads", web.threads, {1, 64}, "Number of threads of the web server.");
  parameters.Read("web_max_connections", web.max_connections, {1, 100000},
                  "Number of connections. Whoever comes when all are taken takes the place of one "
                  "that waits, first of the client with the most; else it is answered 503.");
  parameters.Read("web_connections_per_client", web.max_connections_per_client, {1, 100000},
                  "Connections of one client, which is an IPv4 address or an IPv6 /64 network. "
                  "Three quarters of them may be live streams.");
  parameters.Read("web_reserved_connections", web.reserved_connections, {0, 100000},
                  "Connections kept for officials with a valid token, and for /healthz from the "
                  "same machine. At most a quarter of web_max_connections counts.");
  std::string proxies;
  parameters.Read("web_proxies", proxies,
                  "Addresses of proxies, with commas between. Who asks through one is the client "
                  "that it names last in X-Forwarded-For; all shares and limits hold for that "
                  "client. Where it names none, web_connections_per_client does not hold, because "
                  "all its clients have one address.");
  web.proxies = SplitAtCommas(proxies);
  parameters.Read("web_request_timeout_s", web.request_timeout_s, {0.1, 3600},
                  "Time for a request to arrive, also the longest pause between two, and the time "
                  "that a client has to agree on TLS.",
                  "s");
  parameters.Read("web_answer_timeout_s", web.answer_timeout_s, {0.1, 3600},
                  "Time for a client to take each 32 KiB of an answer.", "s");
  parameters.Read("web_picture_timeout_s", web.picture_timeout_s, {0.1, 3600},
                  "Whoever waits for a picture longer is answered 503.", "s");
  parameters.Read("web_token_file", web.token_file,
                  "File of the programs, and of officials without an account, that may confirm, "
                  "reject and distrust, a line NAME TOKEN each (docs/how-to/use-the-map.md). "
                  "Empty: none.");
  web.accounts_file = config.zone.directory + "/accounts.sqlite";
  parameters.Read("web_session_s", web.session_s, {60, 3e6},
                  "Somebody who has logged in (./livemap zone user) must do so again after this "
                  "time.",
                  "s");
  parameters.ReadChoice<web::PublicSees>(
      "web_public_sees", web.public_sees,
      {{"nothing", web::PublicSees::kNothing},
       {"told", web::PublicSees::kTold},
       {"all", web::PublicSees::kAll}},
      "What somebody sees who has not logged in, where the zone has accounts: nothing, told "
      "(hazards that drivers are told of) or all (all hazards and map changes). Vehicles and their "
      "trails are then for those who have logged in, always. Without accounts everybody sees "
      "everything.");
  parameters.Read("web_picture_side_px", web.picture_side_px, {16, 16384},
                  "Longest side of a picture as people see it.", "px");
  parameters.Read("web_picture_cache_bytes", web.picture_cache_bytes, {0, 2e9},
                  "Size of such pictures kept in memory.", "bytes");
  if (config.map_datum) web.centre = *config.map_datum;
}

void ReadZoneNeighbours(ParameterReader& parameters, ZoneCloudletConfig& config) {
  ZoneCloudletConfig::Neighbours& neighbours = config.neighbours;
  parameters.Section("Neighbours",
                     "The live map shows what lies right behind the zone's borders, as the zones "
                     "there tell it: docs/explanation/changing-zones.md.");
  parameters.Read("zone_directory", neighbours.directory,
                  "The authority's signed zone directory (docs/reference/zone-directory.md), which "
                  "names the zones and the addresses of their maps. Empty: no other zone is "
                  "followed. zone.launch sets it, and the next two.");
  parameters.Read("zone", neighbours.zone, "Id of this zone in the directory.");
  parameters.Read("zone_authority", neighbours.authority,
                  "Certificate of the authority that signs the directory, a PEM file.");
  parameters.Read("neighbour_margin_m", neighbours.margin_m, {0, 20000},
                  "Hazards of other zones that lie so far from the own area at most are shown. 0: "
                  "no other zone is followed.",
                  "m");
  parameters.Read("neighbour_ask_every_s", neighbours.ask_every_s, {0.1, 3600},
                  "Time between two questions to a zone that is up.", "s");
  parameters.Read("neighbour_ca_file", neighbours.ca_file,
                  "Certificates that are trusted where a neighbour's map is at https://. Empty: "
                  "the system's.");
  if (neighbours.margin_m == 0) neighbours.directory.clear();
  if (neighbours.directory.empty()) return;
  for (const auto& [name, value] :
       {std::pair("zone", &neighbours.zone), std::pair("zone_authority", &neighbours.authority)}) {
    if (!value->empty()) continue;
    throw Error(std::string("parameter '") + name + "' is empty and 'zone_directory' is '" +
                neighbours.directory + "', accepted are all three or none");
  }
}

/// After the store and the work orders.
void ReadZoneLease(ParameterReader& parameters, ZoneCloudletConfig& config) {
  parameters.Section("Failover",
                     "Two processes of one zone, of which one is active and the other its standby: "
                     "docs/how-to/run-a-standby.md.");
  parameters.Read("lease_s", config.lease_s, {0, 600},
                  "Time for which the lease in the database is valid after it was renewed: a "
                  "standby takes over so long after the last renewal. 0: no lease, this process "
                  "is the only one of the zone. zone.launch sets it by the argument `lease_s`.",
                  "s");
  parameters.Read("lease_renew_s", config.lease_renew_s, {0.05, 60},
                  "Time between two renewals of the lease. At most half of lease_s.", "s");
  if (config.lease_s == 0) return;
  if (config.lease_renew_s > config.lease_s / 2) {
    throw Error("parameter 'lease_renew_s' is " + std::to_string(config.lease_renew_s) +
                " s, accepted is at most half of lease_s, which is " +
                std::to_string(config.lease_s) + " s");
  }
  if (config.zone.store_url.empty()) {
    throw Error(
        "parameter 'lease_s' is set and 'store_url' is empty, accepted is a lease where the store "
        "is in PostgreSQL");
  }
  // What was sent is kept in the folder of one machine: the other one would send it again.
  if (!config.work_orders.empty()) {
    throw Error("parameter 'work_orders' is '" + config.work_orders +
                "' and 'lease_s' is set, accepted is one of them: a standby does not know which "
                "orders were sent");
  }
}

}  // namespace

ZoneCloudletConfig ReadZoneCloudletConfig(ParameterReader& parameters,
                                          const std::string& package_path) {
  ZoneCloudletConfig config;
  parameters.ReadRequired("directory", config.zone.directory, "/var/lib/livemap/zone",
                          "Folder of the store and the pictures; each zone needs its own. "
                          "zone.launch sets it by the argument `directory`.");
  if (config.zone.directory.empty()) {
    throw Error("parameter 'directory' is empty, accepted is the folder of the zone's store");
  }
  parameters.Read("store_url", config.zone.store_url,
                  "Database of PostgreSQL that keeps the store in place of the file zone.sqlite3 "
                  "in `directory`: postgresql://USER@HOST/DATABASE, without a password "
                  "(docs/how-to/use-postgresql.md). Empty: that file. zone.launch sets it by the "
                  "argument `store_url`.");
  if (!config.zone.store_url.empty()) zone::CheckedPostgresqlUrl(config.zone.store_url);
  parameters.Read(
      "hazards", config.hazards,
      "Path of the catalogue of classes: radius, colour, label and more. Empty: "
      "config/hazards.yaml of the package. zone.launch sets it by the argument `hazards`.");
  if (config.hazards.empty()) config.hazards = package_path + "/config/hazards.yaml";
  config.zone.catalogue = protocol::HazardCatalogue::Load(config.hazards);
  config.zone.limits.zone = ReadZoneBounds(parameters);
  parameters.ReadChoice<bool>(
      "log_format", config.json_log, {{"text", false}, {"json", true}},
      "How the node logs on standard output and standard error: text, or json, an object a line "
      "with time, level, message and fields (docs/reference/log.md).");
  ReadZoneKept(parameters, config.zone);
  ReadZoneReportLimits(parameters, config.zone);
  ReadZoneCommits(parameters, config);
  ReadZoneCatchUp(parameters, config);
  ReadZoneLife(parameters, config.zone);
  ReadZonePolls(parameters, config.zone);
  ReadZoneStreets(parameters, config);
  ReadZoneOrders(parameters, config);
  ReadZoneLease(parameters, config);
  ReadZoneMarkers(parameters, config);
  ReadZoneWeb(parameters, package_path, config);
  ReadZoneNeighbours(parameters, config);
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
