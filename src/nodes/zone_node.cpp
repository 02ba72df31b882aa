#include "nodes/zone_node.h"

#include <livemap/CellHazards.h>
#include <livemap/HazardNotice.h>
#include <livemap/HazardPoll.h>
#include <livemap/ReportReceipt.h>

#include <chrono>
#include <memory>
#include <random>
#include <utility>

#include "common/clock.h"
#include "common/time.h"
#include "ros/conversions/cell_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/poll_conversions.h"
#include "streets/address_file.h"
#include "streets/street_file.h"

namespace livemap::nodes {
namespace {

constexpr double kSayAgainS = 60.0;
/// Of the store, that say where its map is.
constexpr std::size_t kFirstHazards = 64;
constexpr std::chrono::milliseconds kPatience{500};
/// Between two portions of what a vehicle is told.
constexpr std::chrono::milliseconds kTellPause{50};
/// After a failed commit; the vehicles send the reports again anyway.
constexpr std::chrono::seconds kStorePause{1};
constexpr std::int64_t kStoreCheckNs = 1'000'000'000;

zone::ZoneInbox::Config InboxLimits(const ros_io::ZoneCloudletConfig& config) {
  zone::ZoneInbox::Config limits;
  limits.max_reports = static_cast<std::size_t>(config.queue_reports);
  limits.max_bytes = static_cast<std::size_t>(config.queue_bytes);
  limits.batch = static_cast<std::size_t>(config.batch_reports);
  return limits;
}

}  // namespace

ros_io::ZoneCloudletConfig WithStreets(ros_io::ZoneCloudletConfig config) {
  if (config.streets.empty()) return config;
  const std::int64_t begin_ns = SteadyNs();
  const auto map =
      std::make_shared<const streets::StreetMap>(streets::ReadStreetFile(config.streets));
  const streets::StreetMap::Counters& left_out = map->counters();
  ROS_INFO(
      "%zu streets with %zu segments from '%s' in %.0f MB and %.1f s; left out: %zu missing nodes, "
      "%zu segments that are too long, %zu nodes beyond 85 degrees",
      map->streets(), map->segments(), config.streets.c_str(),
      static_cast<double>(map->bytes()) / 1e6, static_cast<double>(SteadyNs() - begin_ns) / 1e9,
      left_out.missing_nodes, left_out.long_segments, left_out.off_range);
  config.zone.streets = map;
  config.zone.addresses =
      std::make_shared<const streets::AddressMap>(streets::ReadAddresses(config.streets));
  ROS_INFO("%zu house numbers in %.0f MB", config.zone.addresses->size(),
           static_cast<double>(config.zone.addresses->bytes()) / 1e6);
  return config;
}

ZoneNode::ZoneNode(ros::NodeHandle node, const ros::NodeHandle& private_node,
                   ros_io::ZoneCloudletConfig config)
    : config_(std::move(config)),
      // Never simulated time: a store outlives any replay.
      zone_(config_.zone, SystemNs, EntropySeededGenerator()()),
      inbox_(InboxLimits(config_)),
      catch_up_(config_.catch_up),
      cell_allowance_({}),
      map_changes_(node, zone_, inbox_),
      pictures_(zone_, static_cast<std::size_t>(config_.notice_picture_bytes)),
      cells_(zone_.AnnouncedSequence()),
      updater_(node, private_node) {
  {
    const MutexLock lock(mutex_);
    auto origin = config_.map_datum;
    for (const zone::Hazard& hazard : zone_.Query(std::nullopt, 0, kFirstHazards)) {
      if (!origin) origin = origin_.AddHazard(hazard.position, hazard.vehicles);
    }
    if (origin) SetMap(*origin);
  }
  receipt_publisher_ = node.advertise<ReportReceipt>("hazard/receipt", 20000);
  poll_publisher_ = node.advertise<HazardPoll>("hazard/poll", 1000);
  NoticeSender::Publishers publishers;
  if (config_.notices_to_all) publishers.all = node.advertise<HazardNotice>("hazard/notice", 20000);
  publishers.cells = node.advertise<HazardNotice>("hazard/cell_notice", 20000);
  notices_ = std::make_unique<NoticeSender>(pictures_, publishers);
  CatchUpPublisher::Config telling;
  telling.radius_m = config_.catch_up.radius_m;
  telling.max_hazards = static_cast<std::size_t>(config_.join_max_hazards);
  telling.picture_bytes = static_cast<std::size_t>(config_.join_picture_bytes);
  teller_ = std::make_unique<CatchUpPublisher>(
      zone_, pictures_, node.advertise<HazardNotice>("hazard/vehicle_notice", 20000), telling);
  cell_teller_ = std::make_unique<CellPublisher>(
      zone_, cells_, node.advertise<CellHazards>("hazard/cell_hazards", 20000));
  RestoreCells();
  // Before anybody can decide or report: what is missed here no vehicle is told.
  subscription_ = zone_.Subscribe([this](const zone::ZoneEvent& event) { OnEvent(event); });
  marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>("hazard/markers", 1, true);
  if (!config_.work_orders.empty()) {
    orders_ = std::make_unique<orders::OrderDesk>(
        orders::ReadWorkOrderFile(config_.work_orders), config_.zone.directory, zone_,
        config_.zone.catalogue, SystemNs, EntropySeededGenerator()(),
        [](const std::string& line) { ROS_WARN("%s", line.c_str()); });
  }
  erasures_ = std::make_unique<zone::ErasureDesk>(
      config_.zone.directory, zone_, SystemNs,
      [](const std::string& line) { ROS_INFO("%s", line.c_str()); });
  if (config_.web) {
    if (!config_.neighbours.directory.empty()) FollowNeighbours();
    web_ = std::make_unique<web::WebServer>(config_.web_options, zone_, config_.zone.catalogue,
                                            orders_.get(), neighbours_.get());
    private_node.setParam("/livemap/web_port", web_->port());
  }
  worker_ = std::thread([this] { WorkUntilClosed(); });
  updater_.setHardwareID("zone_cloudlet");
  updater_.add("zone", this, &ZoneNode::Diagnose);
  timers_ = {node.createSteadyTimer(ros::WallDuration(config_.marker_period_s),
                                    &ZoneNode::OnMarkerTimer, this),
             node.createSteadyTimer(ros::WallDuration(config_.diagnostics_period_s),
                                    &ZoneNode::OnDiagnosticsTimer, this)};
  subscribers_ = {
      node.subscribe("hazard/report", 2000, &ZoneNode::OnReport, this),
      node.subscribe("vehicle/position", 2000, &ZoneNode::OnPosition, this),
      node.subscribe("hazard/poll_answer", 1000, &ZoneNode::OnAnswer, this),
      node.subscribe("hazard/cell_request", 2000, &ZoneNode::OnCellRequest, this),
  };
  SayReady();
  const zone::StoreDamage damage = zone_.Statistics().store_damage;
  if (damage.rows > 0) {
    ROS_ERROR(
        "the store in '%s' holds %zu rows that this program did not write; they are left "
        "there and do not count. The first: %s",
        config_.zone.directory.c_str(), damage.rows, damage.first.c_str());
  }
}

void ZoneNode::FollowNeighbours() {
  const auto& from = config_.neighbours;
  neighbours_ = std::make_unique<region::Neighbours>(
      region::Neighbours::Config{from.zone, from.directory, from.authority,
                                 config_.zone.directory + "/neighbours", from.ca_file,
                                 from.margin_m, from.ask_every_s},
      zone_, config_.zone.catalogue, SystemNs,
      [](const std::string& line) { ROS_INFO("neighbours: %s", line.c_str()); });
}

/// The cells of the hazards that drivers know already.
void ZoneNode::RestoreCells() {
  constexpr std::size_t kHazardsOfPage = 1000;
  zone::Walk<zone::HazardState> walk{std::nullopt, {}, 0, UINT64_MAX};
  for (bool is_last = false; !is_last;) {
    const zone::Page<zone::Hazard> page = zone_.ReadHazards(walk, kHazardsOfPage);
    for (const zone::Hazard& hazard : page.items) {
      if (zone::IsTold(hazard.state) && hazard.announced_sequence > 0) {
        cells_.Restore(hazard.uuid, hazard.position, hazard.announced_sequence);
      }
    }
    walk.after = page.sequence;
    is_last = page.is_last;
  }
}

/// One line for whoever waits for it in a terminal or a log file.
void ZoneNode::SayReady() const {
  std::string map = "no live map (web is false)";
  if (web_) {
    const bool everywhere = config_.web_options.address == "0.0.0.0";
    const std::string host = everywhere ? "127.0.0.1" : config_.web_options.address;
    const char* const scheme = web_->certificate() ? "https://" : "http://";
    map = std::string("live map at ") + scheme + host + ":" + std::to_string(web_->port()) + "/" +
          (everywhere ? " and this machine's other addresses" : "");
  }
  ROS_INFO("zone ready in '%s' with %zu hazards: %s", config_.zone.directory.c_str(),
           zone_.Statistics().active_hazards, map.c_str());
}

/// Once each.
void ZoneNode::SayCertificate(const web::CertificateState& certificate) {
  if (certificate.loads != certificate_.loads) {
    const double days = Seconds(certificate.ends_ns - SystemNs()) / 86400;
    if (days > 0) {
      ROS_INFO("the live map's certificate '%s' is valid for another %.1f days",
               config_.web_options.certificate_file.c_str(), days);
    } else {
      ROS_WARN("the live map's certificate '%s' ended %.1f days ago: browsers refuse it",
               config_.web_options.certificate_file.c_str(), -days);
    }
  }
  if (!certificate.refusal.empty() && certificate.refusal != certificate_.refusal) {
    ROS_WARN("%s", certificate.refusal.c_str());
  }
  certificate_ = certificate;
}

ZoneNode::~ZoneNode() {
  for (ros::Subscriber& subscriber : subscribers_) subscriber.shutdown();
  for (ros::SteadyTimer& timer : timers_) timer.stop();
  map_changes_.Close();
  inbox_.Close();
  worker_.join();
  zone_.Unsubscribe(subscription_);
}

template <typename Change>
void ZoneNode::Count(const Change& change) {
  const MutexLock lock(mutex_);
  change(counters_);
}

void ZoneNode::OnReport(const HazardReportConstPtr& message) {
  if (!zone_.IsActive()) return;
  Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.reports_received; });
  protocol::Report report;
  try {
    report = ros_io::FromMessage(*message);
  } catch (const Error& error) {
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.reports_malformed; });
    ReportReceipt receipt;
    receipt.schema_version = ReportReceipt::SCHEMA_VERSION;
    receipt.status = ReportReceipt::REFUSED;
    receipt.report_uuid = message->uuid;
    receipt.vehicle_id = message->vehicle_id;
    receipt.reason = error.what();
    receipt_publisher_.publish(receipt);
    ROS_WARN_THROTTLE(kSayAgainS, "report refused: %s", error.what());
    return;
  }
  if (inbox_.Push(std::move(report))) return;
  Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.reports_not_queued; });
  ROS_WARN_THROTTLE(kSayAgainS,
                    "%zu reports wait for a commit: further ones are not taken until "
                    "their vehicles send them again",
                    inbox_.reports());
}

void ZoneNode::OnPosition(const VehiclePosition& message) {
  if (!zone_.IsActive()) return;
  try {
    const zone::VehicleState vehicle = ros_io::FromMessage(message);
    if (zone_.UpdateVehicle(vehicle)) RecordNewReports(vehicle, message.map_sequence);
  } catch (const Error& error) {
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.positions_malformed; });
    ROS_WARN_THROTTLE(kSayAgainS, "vehicle position dropped: %s", error.what());
  }
}

void ZoneNode::OnAnswer(const HazardPollAnswer& message) {
  if (!zone_.IsActive()) return;
  try {
    if (inbox_.Push(ros_io::FromMessage(message))) return;
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.answers_dropped; });
  } catch (const Error& error) {
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.answers_malformed; });
    ROS_WARN_THROTTLE(kSayAgainS, "poll answer of '%.64s' dropped: %s", message.vehicle_id.c_str(),
                      error.what());
  }
}

/// What is dropped here the vehicle asks again.
void ZoneNode::OnCellRequest(const CellRequest& message) {
  if (!zone_.IsActive()) return;
  try {
    protocol::CellRequest request = ros_io::FromMessage(message);
    const std::int64_t now_ns = SteadyNs();
    {
      const MutexLock lock(mutex_);
      if (!cell_allowance_.Take(request.vehicle_id, request.cells.size(), now_ns)) {
        ++counters_.cell_requests_refused;
        return;
      }
      catch_up_.NoteCellRequest(request.vehicle_id, now_ns);
    }
    if (inbox_.Push(std::move(request))) return;
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.cell_requests_refused; });
  } catch (const Error& error) {
    Count([](ros_io::ZoneCloudletCounters& counters) { ++counters.cell_requests_malformed; });
    ROS_WARN_THROTTLE(kSayAgainS, "cell request of '%.64s' dropped: %s", message.vehicle_id.c_str(),
                      error.what());
  }
}

/// A vehicle that is new, moved far or missed announcements: the worker tells it.
void ZoneNode::RecordNewReports(const zone::VehicleState& vehicle, std::uint64_t map_sequence) {
  const std::uint64_t announced = zone_.AnnouncedSequence();
  const MutexLock lock(mutex_);
  auto order =
      catch_up_.Update(vehicle.vehicle_id, vehicle.position, map_sequence, announced, SteadyNs());
  if (catch_up_.TakeInvitation(vehicle.vehicle_id)) cell_teller_->Invite(vehicle.vehicle_id);
  if (!order) return;
  ++(order->since == 0 ? counters_.vehicles_joined : counters_.vehicles_behind);
  inbox_.Push(std::move(*order));
}

void ZoneNode::OnEvent(const zone::ZoneEvent& event) {
  // Not shown in rviz, and no vehicle is told.
  if (event.map_change || event.forgotten) return;
  view_changed_ = true;
  const geo::GeoPoint place =
      event.hazard ? event.hazard->hazard.position : event.vehicle->position;
  {
    const MutexLock lock(mutex_);
    const auto origin = map_ ? std::nullopt
                        : event.vehicle
                            ? origin_.AddVehicle(event.vehicle->vehicle_id, place, SteadyNs())
                            : origin_.AddHazard(place, event.hazard->hazard.vehicles);
    if (origin) SetMap(*origin);
    if (event.vehicle) paths_.Add(*event.vehicle);
  }
  if (!event.hazard || !event.hazard->announced) return;
  const zone::Hazard& hazard = event.hazard->hazard;
  notices_->Push(*event.hazard, cells_.Announce(hazard.uuid, hazard.position,
                                                zone::IsTold(hazard.state), hazard.sequence));
}

void ZoneNode::WorkUntilClosed() {
  for (bool telling = false;;) {
    const bool closing = inbox_.closed();
    zone::ZoneInbox::Batch batch = inbox_.Take(telling ? kTellPause : kPatience);
    // Closed before the inbox was found empty: nothing can have come since.
    if (closing && batch.empty()) return;
    // What came before the lease was lost is another process's to answer.
    if (!zone_.IsActive()) {
      telling = false;
      continue;
    }
    const bool tells_vehicles = TellVehicles(std::move(batch.orders));
    telling = TellCells(std::move(batch.cell_requests)) || tells_vehicles;
    HandleAnswers(batch.answers);
    CheckStore();
    LetTimePass();
    if (!batch.map_changes.empty()) CommitMapChanges(batch.map_changes);
    if (!batch.reports.empty()) CommitReports(batch.reports);
  }
}

void ZoneNode::CommitReports(const std::vector<protocol::Report>& reports) {
  try {
    for (const protocol::Receipt& receipt : zone_.HandleBatch(reports)) {
      if (receipt.status == protocol::Receipt::Status::kRefused) {
        ROS_WARN_THROTTLE(kSayAgainS, "report of '%.64s' refused: %s", receipt.vehicle_id.c_str(),
                          receipt.reason.c_str());
      }
      receipt_publisher_.publish(ros_io::ToMessage(receipt));
    }
    NoteCommit();
  } catch (const Error& error) {
    NoteFailedCommit(error);
  }
}

void ZoneNode::CommitMapChanges(const std::vector<protocol::MapChangeReport>& reports) {
  try {
    map_changes_.Commit(reports);
    NoteCommit();
  } catch (const Error& error) {
    NoteFailedCommit(error);
  }
}

void ZoneNode::NoteCommit() {
  Count([](ros_io::ZoneCloudletCounters& counters) {
    ++counters.commits;
    counters.store_error.clear();
  });
}

void ZoneNode::NoteFailedCommit(const Error& error) {
  Count([&error](ros_io::ZoneCloudletCounters& counters) {
    ++counters.store_errors;
    counters.store_error = error.what();
  });
  ROS_ERROR_THROTTLE(kSayAgainS, "%s; the reports' vehicles will send them again", error.what());
  std::this_thread::sleep_for(kStorePause);
}

/// Publishes the next portion of what single vehicles must know; true while there is more.
bool ZoneNode::TellVehicles(std::deque<zone::CatchUpOrder> orders) {
  for (zone::CatchUpOrder& order : orders) teller_->Add(std::move(order));
  const auto told = teller_->PublishBatch(SystemNs());
  const MutexLock lock(mutex_);
  if (told) catch_up_.Told(*told, SteadyNs());
  counters_.vehicle_notices_sent = teller_->notices();
  return teller_->busy();
}

/// Answers the next portion of what vehicles ask about cells; true while there is more.
bool ZoneNode::TellCells(std::deque<protocol::CellRequest> requests) {
  for (protocol::CellRequest& request : requests) cell_teller_->Add(std::move(request));
  cell_teller_->PublishBatch();
  const MutexLock lock(mutex_);
  counters_.cells_told = cell_teller_->cells();
  counters_.cell_hazards_told = cell_teller_->hazards();
  return cell_teller_->busy();
}

void ZoneNode::HandleAnswers(const std::deque<protocol::PollAnswer>& answers) {
  for (const protocol::PollAnswer& answer : answers) {
    try {
      zone_.HandleAnswer(answer);
    } catch (const Error& error) {
      // The poll stays open and is asked again.
      ROS_ERROR_THROTTLE(kSayAgainS, "an answer of '%.64s' is not counted: %s",
                         answer.vehicle_id.c_str(), error.what());
    }
  }
}

/// So that whoever asks whether the zone is ready knows it while no report comes, too.
void ZoneNode::CheckStore() {
  const std::int64_t now_ns = SteadyNs();
  if (now_ns - store_checked_ns_ < kStoreCheckNs) return;
  store_checked_ns_ = now_ns;
  try {
    zone_.CheckStore();
    // A commit that failed for another reason stays told until one succeeds.
    if (!is_store_away_) return;
    is_store_away_ = false;
    Count([](ros_io::ZoneCloudletCounters& counters) { counters.store_error.clear(); });
  } catch (const Error& error) {
    is_store_away_ = true;
    Count(
        [&error](ros_io::ZoneCloudletCounters& counters) { counters.store_error = error.what(); });
    ROS_ERROR_THROTTLE(kSayAgainS, "%s", error.what());
  }
}

/// Transitions that are due, and polls to be asked.
void ZoneNode::LetTimePass() {
  const std::int64_t now_ns = SteadyNs();
  if (now_ns - advanced_ns_ < static_cast<std::int64_t>(config_.advance_period_s * 1e9)) return;
  advanced_ns_ = now_ns;
  try {
    zone_.Advance();
    for (const protocol::Poll& poll : zone_.TakeDuePolls()) {
      poll_publisher_.publish(ros_io::ToMessage(poll));
    }
  } catch (const Error& error) {
    ROS_ERROR_THROTTLE(kSayAgainS, "hazards do not age: %s", error.what());
  }
}

void ZoneNode::SetMap(const geo::GeoPoint& datum) {
  map_.emplace(datum);
  const Eigen::Isometry3d pose = map_->InEarth();
  const Eigen::Quaterniond rotation(pose.linear());
  geometry_msgs::TransformStamped transform;
  transform.transform.translation.x = pose.translation().x();
  transform.transform.translation.y = pose.translation().y();
  transform.transform.translation.z = pose.translation().z();
  transform.transform.rotation.x = rotation.x();
  transform.transform.rotation.y = rotation.y();
  transform.transform.rotation.z = rotation.z();
  transform.transform.rotation.w = rotation.w();
  transform.header.frame_id = "earth";  // REP 105.
  transform.header.stamp = ros::Time::now();
  transform.child_frame_id = config_.map_frame;
  transform_broadcaster_.sendTransform(transform);
}

void ZoneNode::OnMarkerTimer(const ros::SteadyTimerEvent&) {
  // Nobody looks: whoever comes gets the view of then, or the latched one if it still holds.
  if (marker_publisher_.getNumSubscribers() == 0 || !view_changed_.exchange(false)) return;
  const auto hazards = zone_.Query(std::nullopt, 0, static_cast<std::size_t>(config_.max_markers));
  const auto vehicles = zone_.Vehicles();
  visualization_msgs::MarkerArray markers;
  {
    const MutexLock lock(mutex_);
    if (!map_) return;
    paths_.KeepOnly(vehicles);
    markers = ros_io::ZoneMarkers(hazards, vehicles, paths_, config_.zone.catalogue, *map_,
                                  config_.map_frame, ros::Time::now());
  }
  marker_publisher_.publish(markers);
}

void ZoneNode::OnDiagnosticsTimer(const ros::SteadyTimerEvent&) {
  updater_.force_update();
  if (!neighbours_) return;
  try {
    neighbours_->Renew();
  } catch (const Error& error) {
    ROS_ERROR_THROTTLE(kSayAgainS, "no neighbours are followed: %s", error.what());
  }
}

void ZoneNode::Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  ros_io::ZoneCloudletCounters counters;
  {
    const MutexLock lock(mutex_);
    counters = counters_;
  }
  counters.reports_waiting = inbox_.reports();
  const MapChangeReceiver::Counters changes = map_changes_.counters();
  counters.map_changes_received = changes.received;
  counters.map_changes_malformed = changes.malformed;
  counters.map_changes_not_queued = changes.not_queued;
  counters.map_changes_waiting = inbox_.map_changes();
  counters.notices_sent = notices_->sent();
  counters.notice_pictures = notices_->pictures();
  counters.notice_pictures_failed = pictures_.failed();
  if (web_) {
    const web::WebServer::Counters web = web_->counters();
    counters.web_connections = web_->connections();
    counters.web_connections_ended = web.connections_ended;
    counters.web_connections_refused = web.connections_refused;
    counters.web_held_bytes = web.held_bytes;
    counters.web_failed_handshakes = web.failed_handshakes;
    if (const auto certificate = web_->certificate()) {
      counters.web_certificate_s = Seconds(certificate->ends_ns - SystemNs());
      counters.web_certificate_refusal = certificate->refusal;
      SayCertificate(*certificate);
    }
    counters.web_pictures_refused = web.pictures.refused;
    counters.web_pictures_last_refusal = web.pictures.last_refusal;
    counters.web_pictures_busy = web.pictures.busy;
  }
  if (const zone::ZoneLease* lease = zone_.lease()) {
    counters.lease = ros_io::ZoneCloudletCounters::Lease{lease->IsHeld(), lease->config().holder,
                                                         lease->epoch(), lease->AgeS()};
  }
  ros_io::DescribeZone(counters, zone_.Statistics(), status);
}

}  // namespace livemap::nodes
