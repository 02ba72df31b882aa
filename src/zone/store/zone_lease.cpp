#include "zone/store/zone_lease.h"

#include <soci/soci.h>

#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "zone/store/lease_row.h"
#include "zone/store/postgresql_url.h"
#include "zone/store/queries.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxLeaseHolderBytes = 200;
/// Two processes that make the same table at the same time: one of them would fail.
constexpr char kLockLeaseTable[] = "SELECT count(*) FROM pg_advisory_xact_lock(7810761180241194)";
/// Somebody may have just the row: it is asked for again.
constexpr char kLeaseLockTimeout[] = "SET lock_timeout = '500ms'";

ZoneLease::Config CheckedLease(ZoneLease::Config config) {
  if (!IsPostgresqlUrl(config.database)) {
    throw Error("a lease wants a database of PostgreSQL, and the store's is '" + config.database +
                "'");
  }
  if (config.holder.empty() || config.holder.size() > kMaxLeaseHolderBytes) {
    throw Error("the lease's holder has a name of " + std::to_string(config.holder.size()) +
                " bytes, accepted are 1 to 200");
  }
  if (!(config.duration_s > 0)) {
    throw Error("the lease lasts " + std::to_string(config.duration_s) +
                " s, accepted are more than 0 s");
  }
  return config;
}

}  // namespace

/// Runs `body` with the session, once more over a new connection where the old one has broken.
template <typename Body>
auto ZoneLease::Ask(const std::string& doing, const Body& body) {
  return ExplainStore(doing, [&] {
    if (connection_ && !connection_->IsLost()) {
      try {
        return body(connection_->session());
      } catch (const soci::soci_error&) {
        if (!connection_->IsLost()) throw;
      }
    }
    return body(Connection().session());
  });
}

ZoneLease::ZoneLease(Config config) : config_(CheckedLease(std::move(config))) {
  Ask("making the lease", [&](soci::session&) { return true; });
}

ZoneLease::~ZoneLease() = default;

StoreConnection& ZoneLease::Connection() {
  if (connection_ && !connection_->IsLost()) return *connection_;
  connection_ = nullptr;
  connection_ = std::make_unique<StoreConnection>(config_.database, StoreConnection::Use::kWrite);
  MakeRow();
  connection_->session() << kLeaseLockTimeout;
  return *connection_;
}

void ZoneLease::MakeRow() {
  soci::session& session = connection_->session();
  soci::transaction transaction(session);
  long long locks = 0;
  session << kLockLeaseTable, soci::into(locks);
  session << kMakeLeaseTable;
  session << kMakeLeaseRow;
  transaction.commit();
}

bool ZoneLease::TryTake() {
  if (Read().valid_s > 0) return false;
  EndFormerWriter();
  const std::int64_t asked_ns = BootNs();
  return Ask("taking the lease", [&](soci::session& session) {
    long long epoch = 0;
    soci::indicator is_taken = soci::i_null;
    // The condition is looked at again where another one has just taken it.
    session << "UPDATE livemap_lease SET holder = :h, epoch = epoch + 1, writer = 0, valid_until = "
               "clock_timestamp() + make_interval(secs => :d) WHERE valid_until <= "
               "clock_timestamp() RETURNING epoch",
        soci::use(config_.holder), soci::use(config_.duration_s), soci::into(epoch, is_taken);
    if (!session.got_data()) return false;
    epoch_ = static_cast<std::uint64_t>(epoch);
    asked_ns_ = asked_ns;
    return true;
  });
}

/// A process that stands still in the middle of a transaction keeps its rows locked.
void ZoneLease::EndFormerWriter() {
  Ask("ending the former holder's connection", [&](soci::session& session) {
    long long ended = 0;
    session << "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE pid IN (SELECT "
               "writer FROM livemap_lease WHERE valid_until <= clock_timestamp()) AND datname = "
               "current_database() AND usename = current_user",
        soci::into(ended);
    return true;
  });
}

bool ZoneLease::Renew() {
  const std::int64_t asked_ns = BootNs();
  return Ask("renewing the lease", [&](soci::session& session) {
    const auto epoch = static_cast<long long>(epoch_.load());
    long long renewed = 0;
    session << "UPDATE livemap_lease SET valid_until = clock_timestamp() + make_interval(secs => "
               ":d) WHERE epoch = :e AND holder = :h RETURNING epoch",
        soci::use(config_.duration_s), soci::use(epoch), soci::use(config_.holder),
        soci::into(renewed);
    const bool is_mine = session.got_data();
    asked_ns_ = is_mine ? asked_ns : 0;
    return is_mine;
  });
}

void ZoneLease::GiveBack() noexcept {
  asked_ns_ = 0;
  try {
    Ask("giving the lease back", [&](soci::session& session) {
      const auto epoch = static_cast<long long>(epoch_.load());
      session << "UPDATE livemap_lease SET valid_until = clock_timestamp() WHERE epoch = :e AND "
                 "holder = :h",
          soci::use(epoch), soci::use(config_.holder);
      return true;
    });
  } catch (const std::exception&) {  // See the header.
  }
}

bool ZoneLease::IsHeld() const {
  const std::int64_t asked_ns = asked_ns_;
  return asked_ns != 0 && static_cast<double>(BootNs() - asked_ns) < config_.duration_s * 1e9;
}

double ZoneLease::AgeS() const {
  const std::int64_t asked_ns = asked_ns_;
  return asked_ns == 0 ? 0 : static_cast<double>(BootNs() - asked_ns) / 1e9;
}

ZoneLease::Row ZoneLease::Read() {
  return Ask("reading the lease", [&](soci::session& session) {
    Row row;
    long long epoch = 0;
    session << "SELECT holder, epoch, CAST(extract(epoch FROM valid_until - clock_timestamp()) AS "
               "DOUBLE PRECISION) FROM livemap_lease",
        soci::into(row.holder), soci::into(epoch), soci::into(row.valid_s);
    row.epoch = static_cast<std::uint64_t>(epoch);
    return row;
  });
}

}  // namespace livemap::zone
