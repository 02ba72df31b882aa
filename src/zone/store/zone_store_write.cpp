// What ZoneStore writes; see zone_store.cpp for the rest.
#include <soci/soci.h>

#include "zone/model/poll_answer.h"
#include "zone/store/zone_store_state.h"

namespace livemap::zone {

void ZoneStore::Implementation::PrepareWrites() {
  using soci::use;
  write_hazard_.emplace(
      (session_.prepare
           << "INSERT INTO hazards (id, uuid, class_name, confidence, latitude, longitude, "
              "covariance_ee, covariance_en, covariance_nn, sightings, first_seen_ns, "
              "last_seen_ns, updated_ns, sequence, announced_sequence, image_sha256, "
              "image_format, state, presence, vehicles, life) VALUES (:i, :u, :c, :co, :la, :lo, "
              ":ee, :en, :nn, :si, :fi, :ls, :up, :se, :an, :is, :im, :st, :pr, :ve, :li) "
              "ON CONFLICT (id) DO UPDATE SET confidence = excluded.confidence, "
              "latitude = excluded.latitude, longitude = excluded.longitude, "
              "covariance_ee = excluded.covariance_ee, covariance_en = excluded.covariance_en, "
              "covariance_nn = excluded.covariance_nn, sightings = excluded.sightings, "
              "first_seen_ns = excluded.first_seen_ns, last_seen_ns = excluded.last_seen_ns, "
              "updated_ns = excluded.updated_ns, sequence = excluded.sequence, "
              "announced_sequence = excluded.announced_sequence, "
              "image_sha256 = excluded.image_sha256, image_format = excluded.image_format, "
              "state = excluded.state, presence = excluded.presence, "
              "vehicles = excluded.vehicles, life = excluded.life",
       use(row_.id), use(row_.uuid), use(row_.class_name), use(row_.confidence), use(row_.latitude),
       use(row_.longitude), use(row_.covariance_ee), use(row_.covariance_en),
       use(row_.covariance_nn), use(row_.sightings), use(row_.first_seen_ns),
       use(row_.last_seen_ns), use(row_.updated_ns), use(row_.sequence),
       use(row_.announced_sequence), use(row_.image_sha256), use(row_.image_format),
       use(row_.state), use(row_.presence), use(row_.vehicles), use(row_.life)));
  write_report_.emplace(
      (session_.prepare
           << "INSERT INTO reports (uuid, hazard_id, vehicle_id, drive_id, stamp_ns, "
              "received_ns, confidence, latitude, longitude, covariance_ee, covariance_en, "
              "covariance_nn, image_sha256) VALUES "
              "(:u, :h, :v, :d, :st, :re, :co, :la, :lo, :ee, :en, :nn, :im)",
       use(row_.uuid), use(row_.id), use(row_.vehicle_id), use(row_.drive_id), use(row_.stamp_ns),
       use(row_.received_ns), use(row_.confidence), use(row_.latitude), use(row_.longitude),
       use(row_.covariance_ee), use(row_.covariance_en), use(row_.covariance_nn),
       use(row_.image_sha256)));
  write_event_.emplace((session_.prepare
                            << "INSERT INTO events (sequence, hazard_id, previous_sequence, "
                               "action, from_state, to_state, announced, reason, at_ns) "
                               "VALUES (:s, :h, :p, :a, :f, :t, :an, :r, :at)",
                        use(row_.sequence), use(row_.id), use(row_.previous_sequence),
                        use(row_.action), use(row_.from_state, row_.has_from), use(row_.state),
                        use(row_.announced), use(row_.reason), use(row_.updated_ns)));
  write_answer_.emplace(
      (session_.prepare
           << "INSERT INTO answers (poll_uuid, hazard_id, vehicle_id, answer, reason, confidence, "
              "stamp_ns, received_ns) VALUES (:u, :h, :v, :a, :r, :c, :st, :re)",
       use(row_.uuid), use(row_.id), use(row_.vehicle_id), use(row_.answer), use(row_.reason),
       use(row_.confidence), use(row_.stamp_ns), use(row_.received_ns)));
  write_life_.emplace((session_.prepare
                           << "INSERT INTO lives (class_name, ended, stood_s) VALUES (:c, :e, :s) "
                              "ON CONFLICT (class_name) DO UPDATE SET ended = excluded.ended, "
                              "stood_s = excluded.stood_s",
                       use(row_.class_name), use(row_.ended), use(row_.stood_s)));
  write_trust_.emplace(
      (session_.prepare
           << "INSERT INTO trust (vehicle_key, suspicion, at_ns, vouchers) VALUES (:k, :s, :a, :v) "
              "ON CONFLICT (vehicle_key) DO UPDATE SET suspicion = excluded.suspicion, "
              "at_ns = excluded.at_ns, vouchers = excluded.vouchers",
       use(row_.vehicle_key), use(row_.suspicion), use(row_.updated_ns), use(row_.vouchers)));
  write_last_report_.emplace(
      (session_.prepare
           << "INSERT INTO last_reports (vehicle_id, stamp_ns, latitude, longitude, sigma_m) "
              "VALUES (:v, :st, :la, :lo, :si) ON CONFLICT (vehicle_id) DO UPDATE SET "
              "stamp_ns = excluded.stamp_ns, latitude = excluded.latitude, "
              "longitude = excluded.longitude, sigma_m = excluded.sigma_m",
       use(row_.vehicle_id), use(row_.stamp_ns), use(row_.latitude), use(row_.longitude),
       use(row_.sigma_m)));
  PrepareMapChangeWrites();
}

void ZoneStore::Begin() {
  ExplainStore("beginning a transaction", [&] { implementation_->session_ << "BEGIN IMMEDIATE"; });
}

void ZoneStore::Commit() {
  ExplainStore("committing", [&] { implementation_->session_ << "COMMIT"; });
}

void ZoneStore::Rollback() noexcept {
  try {
    implementation_->session_ << "ROLLBACK";
  } catch (const std::exception&) {  // See the header.
  }
}

void ZoneStore::WriteHazard(const HazardRow& written) {
  ExplainStore("writing a hazard", [&] {
    Implementation::Row& row = implementation_->row_;
    const Hazard& hazard = written.hazard;
    row.id = static_cast<long long>(written.id);
    row.uuid = hazard.uuid.ToString();
    row.class_name = hazard.class_name;
    row.confidence = static_cast<double>(hazard.confidence);
    row.latitude = hazard.position.latitude_deg;
    row.longitude = hazard.position.longitude_deg;
    row.covariance_ee = hazard.covariance_m2(0, 0);
    row.covariance_en = hazard.covariance_m2(0, 1);
    row.covariance_nn = hazard.covariance_m2(1, 1);
    row.sightings = hazard.sightings;
    row.first_seen_ns = hazard.first_seen_ns;
    row.last_seen_ns = hazard.last_seen_ns;
    row.updated_ns = hazard.updated_ns;
    row.sequence = static_cast<long long>(hazard.sequence);
    row.announced_sequence = static_cast<long long>(hazard.announced_sequence);
    row.image_sha256 = hazard.image_sha256;
    row.image_format = hazard.image_format;
    row.state = static_cast<int>(hazard.state);
    row.presence = static_cast<double>(hazard.presence);
    row.vehicles = static_cast<int>(hazard.vehicles);
    row.life = PackPresence(written.life);
    implementation_->write_hazard_->execute(true);
  });
}

void ZoneStore::WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                            const std::string& image_sha256, std::int64_t received_ns) {
  ExplainStore("writing a report", [&] {
    Implementation::Row& row = implementation_->row_;
    row.uuid = report.uuid.ToString();
    row.id = static_cast<long long>(hazard_id);
    row.vehicle_id = report.vehicle_id;
    row.drive_id = report.drive_id;
    row.stamp_ns = report.stamp_ns;
    row.received_ns = received_ns;
    row.confidence = static_cast<double>(report.confidence);
    row.latitude = report.position.latitude_deg;
    row.longitude = report.position.longitude_deg;
    row.covariance_ee = report.covariance_m2(0, 0);
    row.covariance_en = report.covariance_m2(0, 1);
    row.covariance_nn = report.covariance_m2(1, 1);
    row.image_sha256 = image_sha256;
    implementation_->write_report_->execute(true);
  });
}

void ZoneStore::WriteEvent(const HazardEvent& event, std::uint64_t hazard_id,
                           std::uint64_t previous_sequence) {
  ExplainStore("writing an event", [&] {
    Implementation::Row& row = implementation_->row_;
    row.sequence = static_cast<long long>(event.hazard.sequence);
    row.id = static_cast<long long>(hazard_id);
    row.previous_sequence = static_cast<long long>(previous_sequence);
    row.action = static_cast<int>(event.action);
    row.has_from = event.from ? soci::i_ok : soci::i_null;
    row.from_state = event.from ? static_cast<int>(*event.from) : 0;
    row.state = static_cast<int>(event.hazard.state);
    row.announced = event.announced ? 1 : 0;
    row.reason = event.reason;
    row.updated_ns = event.hazard.updated_ns;
    implementation_->write_event_->execute(true);
  });
}

void ZoneStore::WriteAnswer(const PollAnswer& answer, std::uint64_t hazard_id,
                            std::int64_t received_ns) {
  ExplainStore("writing an answer", [&] {
    Implementation::Row& row = implementation_->row_;
    row.uuid = answer.poll.ToString();
    row.id = static_cast<long long>(hazard_id);
    row.vehicle_id = answer.vehicle_id;
    row.answer = static_cast<int>(answer.answer);
    row.reason = answer.reason;
    row.confidence = answer.confidence;
    row.stamp_ns = answer.stamp_ns;
    row.received_ns = received_ns;
    implementation_->write_answer_->execute(true);
  });
}

void ZoneStore::WriteLife(const std::string& class_name, const LearnedLifetime& learned) {
  ExplainStore("writing what was learned of a class", [&] {
    Implementation::Row& row = implementation_->row_;
    row.class_name = class_name;
    row.ended = learned.ended;
    row.stood_s = learned.stood_s;
    implementation_->write_life_->execute(true);
  });
}

void ZoneStore::WriteTrust(std::uint64_t vehicle, const TrustRecord& record) {
  ExplainStore("writing what is held against a vehicle", [&] {
    Implementation::Row& row = implementation_->row_;
    // The same bits: databases have no unsigned numbers.
    row.vehicle_key = static_cast<long long>(vehicle);
    row.suspicion = record.suspicion;
    row.updated_ns = record.at_ns;
    row.vouchers = PackVouchers(record);
    implementation_->write_trust_->execute(true);
  });
}

void ZoneStore::WriteLastReport(const std::string& vehicle_id, const ReportedFix& fix) {
  ExplainStore("writing a vehicle's last report", [&] {
    Implementation::Row& row = implementation_->row_;
    row.vehicle_id = vehicle_id;
    row.stamp_ns = fix.stamp_ns;
    row.latitude = fix.position.latitude_deg;
    row.longitude = fix.position.longitude_deg;
    row.sigma_m = fix.sigma_m;
    implementation_->write_last_report_->execute(true);
  });
}

}  // namespace livemap::zone
