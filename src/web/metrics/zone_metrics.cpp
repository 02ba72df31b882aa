#include "web/metrics/zone_metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/time.h"
#include "web/metrics/metrics_text.h"
#include "zone/admission/report_validation.h"
#include "zone/model/hazard_state.h"
#include "zone/model/map_change_state.h"
#include "zone/pictures/picture_allowance.h"

namespace livemap::web {
namespace {

constexpr const char* kCounter = "counter";
constexpr const char* kGauge = "gauge";

void AddOne(MetricsText& text, const char* name, const char* type, const char* help, double value) {
  text.Begin(name, type, help);
  text.Add(value);
}

/// One sample per enumerator.
template <typename Kind, typename Counts>
void AddByKind(MetricsText& text, const char* label, const char* (*name_of)(Kind),
               const Counts& counts) {
  for (std::size_t i = 0; i < counts.size(); ++i) {
    text.Add(label, name_of(static_cast<Kind>(i)), static_cast<double>(counts.at(i)));
  }
}

void AddReports(MetricsText& text, const zone::ZoneStatistics& zone) {
  text.Begin("livemap_reports_total", kCounter, "Reports of hazards, by what became of them.");
  text.Add("outcome", "added", static_cast<double>(zone.added));
  text.Add("outcome", "merged", static_cast<double>(zone.merged));
  text.Add("outcome", "repeated", static_cast<double>(zone.repeated));
  text.Add("outcome", "refused", static_cast<double>(zone.refused));
  text.Add("outcome", "not_now", static_cast<double>(zone.not_now));
  text.Begin("livemap_reports_refused_total", kCounter, "Reports refused for good, by reason.");
  AddByKind(text, "reason", zone::RefusalName, zone.refused_by_kind);
  text.Begin("livemap_map_change_reports_total", kCounter,
             "Reports of map changes, by what became of them.");
  text.Add("outcome", "added", static_cast<double>(zone.map_changes.added));
  text.Add("outcome", "merged", static_cast<double>(zone.map_changes.merged));
  text.Add("outcome", "denied", static_cast<double>(zone.map_changes.denied));
  text.Add("outcome", "known", static_cast<double>(zone.map_changes.known));
  text.Add("outcome", "repeated", static_cast<double>(zone.map_changes.repeated));
  text.Add("outcome", "refused", static_cast<double>(zone.map_changes.refused));
  text.Add("outcome", "not_now", static_cast<double>(zone.map_changes.not_now));
}

/// Three quantiles, the greatest among them, instead of a series for each vehicle.
void AddOutboxes(MetricsText& text, const std::vector<double>& ages_s) {
  AddOne(text, "livemap_vehicles_telling_outbox", kGauge,
         "Vehicles heard in the last minute that say how old their outbox is.",
         static_cast<double>(ages_s.size()));
  text.Begin("livemap_vehicle_outbox_age_seconds", kGauge,
             "Age of a vehicle's oldest report without a receipt, by quantile of these vehicles.");
  if (ages_s.empty()) return;
  for (const auto& [name, share] :
       std::array<std::pair<const char*, double>, 3>{{{"0.5", 0.5}, {"0.95", 0.95}, {"1", 1.0}}}) {
    const double place = share * static_cast<double>(ages_s.size() - 1);
    text.Add("quantile", name, ages_s[static_cast<std::size_t>(std::ceil(place))]);
  }
}

void AddVehicles(MetricsText& text, const zone::ZoneStatistics& zone) {
  AddOne(text, "livemap_vehicle_positions_total", kCounter, "Positions of vehicles, accepted.",
         static_cast<double>(zone.vehicle_positions));
  text.Begin("livemap_vehicle_positions_refused_total", kCounter,
             "Positions of vehicles that were refused, by reason.");
  AddByKind(text, "reason", zone::RefusalName, zone.positions_refused_by_kind);
  AddOutboxes(text, zone.outbox_ages_s);
  AddOne(text, "livemap_suspect_vehicles", kGauge, "Vehicles that do not count as witnesses.",
         static_cast<double>(zone.suspect_vehicles));
  AddOne(text, "livemap_polls_total", kCounter, "Questions put to vehicles.",
         static_cast<double>(zone.polls));
  text.Begin("livemap_poll_answers_total", kCounter, "Answers to them, by what became of them.");
  text.Add("outcome", "counted", static_cast<double>(zone.answers));
  text.Add("outcome", "refused", static_cast<double>(zone.answers_refused));
}

void AddMap(MetricsText& text, const zone::ZoneService& service, const zone::ZoneStatistics& zone) {
  text.Begin("livemap_hazards", kGauge, "Hazards, by state.");
  AddByKind(text, "state", zone::HazardStateName, zone.hazards_by_state);
  text.Begin("livemap_map_changes", kGauge, "Map changes, by state.");
  AddByKind(text, "state", zone::MapChangeStateName, zone.map_changes.by_state);
  AddOne(text, "livemap_sequence", kGauge, "Number of the newest event.",
         static_cast<double>(service.Sequence()));
  AddOne(text, "livemap_picture_bytes", kGauge, "Pictures on disk.",
         static_cast<double>(zone.image_bytes));
  text.Begin("livemap_pictures_refused_total", kCounter,
             "Pictures of accepted reports that were not kept, by reason.");
  AddByKind(text, "reason", zone::PictureRefusalName, zone.pictures_refused);
}

void AddStore(MetricsText& text, const zone::ZoneService& service,
              const zone::ZoneStatistics& zone) {
  AddOne(text, "livemap_store_errors_total", kCounter, "Transactions that the store did not keep.",
         static_cast<double>(zone.store_errors));
  AddOne(text, "livemap_store_damaged_rows", kGauge, "Rows found broken at the start.",
         static_cast<double>(zone.store_damage.rows));
  AddOne(text, "livemap_ready", kGauge, "1 while the zone keeps what it is told, else 0.",
         service.IsStoreWell() && service.IsActive() ? 1 : 0);
  text.Begin("livemap_commit_seconds", "histogram", "Time that batches of reports take.");
  text.Add(service.commit_times());
  text.Begin("livemap_report_age_seconds", "histogram",
             "Time from a report's image to its commit: drive, outbox, network and zone.");
  text.Add(service.report_ages());
}

void AddServer(MetricsText& text, const ServerMetrics& server) {
  AddOne(text, "livemap_web_connections", kGauge, "Open connections, live streams included.",
         static_cast<double>(server.connections));
  AddOne(text, "livemap_web_connections_ended_total", kCounter,
         "Connections that had to make room for others.",
         static_cast<double>(server.connections_ended));
  AddOne(text, "livemap_web_connections_refused_total", kCounter,
         "Connections for which there was no room.",
         static_cast<double>(server.connections_refused));
  AddOne(text, "livemap_web_held_bytes", kGauge, "Of answers that are being written.",
         static_cast<double>(server.held_bytes));
  if (server.certificate_ends_ns) {
    AddOne(text, "livemap_web_certificate_seconds", kGauge,
           "Time until the certificate of the web server ends; below 0: since it ended.",
           Seconds(*server.certificate_ends_ns - SystemNs()));
    AddOne(text, "livemap_web_failed_handshakes_total", kCounter,
           "Connections that began TLS in vain.", static_cast<double>(server.failed_handshakes));
  }
  text.Begin("livemap_web_answer_seconds", "histogram",
             "Time until an answer begins, without pictures.");
  text.Add(server.answers);
}

void AddLease(MetricsText& text, const LeaseMetrics& lease) {
  AddOne(text, "livemap_zone_active", kGauge, "1 where the process is the active one, else 0.",
         lease.is_active ? 1 : 0);
  AddOne(text, "livemap_lease_epoch", kGauge, "Number of the lease; it rises with every holder.",
         static_cast<double>(lease.epoch));
  AddOne(text, "livemap_lease_age_seconds", kGauge,
         "Time since the process renewed its lease; 0: it has none.", lease.age_s);
}

void AddOrders(MetricsText& text, const orders::OrderDesk& desk) {
  const orders::OrderCounts counts = desk.Counts();
  text.Begin("livemap_work_orders", kGauge, "Work orders, by state.");
  AddByKind(text, "state", orders::OrderStateName, counts.by_state);
  const bool waits = counts.oldest_waiting_ns != 0;
  AddOne(text, "livemap_work_order_oldest_seconds", kGauge,
         "Age of the oldest work order that waits to be sent; 0: none waits.",
         waits ? std::max(0.0, Seconds(SystemNs() - counts.oldest_waiting_ns)) : 0);
  const auto attempts = desk.attempts();
  text.Begin("livemap_work_order_attempts_total", kCounter,
             "Attempts to send a work order, by what became of them.");
  text.Add("outcome", "sent", static_cast<double>(attempts[0]));
  text.Add("outcome", "refused", static_cast<double>(attempts[1]));
  text.Add("outcome", "unknown", static_cast<double>(attempts[2]));
}

}  // namespace

std::string StandbyMetricsText(const LeaseMetrics& lease) {
  MetricsText text;
  AddLease(text, lease);
  return text.text();
}

std::string ZoneMetricsText(const zone::ZoneService& zone, const ServerMetrics& server,
                            const orders::OrderDesk* orders) {
  const zone::ZoneStatistics statistics = zone.Statistics();
  MetricsText text;
  AddReports(text, statistics);
  AddVehicles(text, statistics);
  AddMap(text, zone, statistics);
  AddStore(text, zone, statistics);
  AddServer(text, server);
  if (const zone::ZoneLease* lease = zone.lease()) {
    AddLease(text, {lease->IsHeld(), lease->epoch(), lease->AgeS()});
  }
  if (orders != nullptr) AddOrders(text, *orders);
  return text.text();
}

}  // namespace livemap::web
