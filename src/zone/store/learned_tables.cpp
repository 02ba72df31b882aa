#include "zone/store/learned_tables.h"

#include "common/error.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

constexpr double kMaxEnded = 1e6;  // SurvivalModel's largest memory.
constexpr double kMaxStoodS = 1e15;

std::string IsSoundLife(const Dialect& dialect) {
  return dialect.AreTexts({{"class_name", 64}}) + " AND " +
         dialect.AreNumbers({"ended", "stood_s"});
}
std::string IsSoundTrust(const Dialect& dialect) {
  return dialect.AreIntegers({"vehicle_key", "at_ns"}) + " AND " +
         dialect.AreNumbers({"suspicion"}) + " AND " + dialect.AreTexts({{"vouchers", 200}});
}

}  // namespace

LearnedTables::LearnedTables(StoreConnection& connection)
    : connection_(connection),
      write_life_(connection,
                  "INSERT INTO lives (class_name, ended, stood_s) VALUES (:c, :e, :s) "
                  "ON CONFLICT (class_name) DO UPDATE SET ended = excluded.ended, "
                  "stood_s = excluded.stood_s",
                  {row_.class_name, row_.ended, row_.stood_s}),
      write_trust_(
          connection,
          "INSERT INTO trust (vehicle_key, suspicion, at_ns, vouchers) VALUES (:k, :s, :a, "
          ":v) "
          "ON CONFLICT (vehicle_key) DO UPDATE SET suspicion = excluded.suspicion, "
          "at_ns = excluded.at_ns, vouchers = excluded.vouchers",
          {row_.vehicle_key, row_.suspicion, row_.updated_ns, row_.vouchers}) {}

StoreDamage LearnedTables::LoadLives(
    const std::function<void(const std::string&, LearnedLifetime)>& take) {
  return ExplainStore("loading what was learned of classes", [&] {
    Row row;
    soci::statement query =
        (connection_.session().prepare << "SELECT class_name, ended, stood_s FROM lives WHERE "
                                       << IsSoundLife(connection_.dialect()),
         soci::into(row.class_name), soci::into(row.ended), soci::into(row.stood_s));
    return LoadRows(connection_, "lives", query, [&] {
      const bool sound = protocol::IsPrintableText(row.class_name, kMaxStoredTextBytes) &&
                         row.ended >= 0 && row.ended <= kMaxEnded && row.stood_s >= 0 &&
                         row.stood_s <= kMaxStoodS;
      if (!sound) throw Error("what was learned of a class is no such thing");
      take(row.class_name, {row.ended, row.stood_s});
    });
  });
}

StoreDamage LearnedTables::LoadTrust(
    const std::function<void(std::uint64_t, const TrustRecord&)>& take) {
  return ExplainStore("loading what is held against vehicles", [&] {
    Row row;
    soci::statement query =
        (connection_.session().prepare
             << "SELECT vehicle_key, suspicion, at_ns, vouchers FROM trust WHERE "
             << IsSoundTrust(connection_.dialect()),
         soci::into(row.vehicle_key), soci::into(row.suspicion), soci::into(row.updated_ns),
         soci::into(row.vouchers));
    return LoadRows(connection_, "trust", query, [&] {
      TrustRecord record;
      record.suspicion = row.suspicion;
      record.at_ns = row.updated_ns;
      if (!IsStamp(record.at_ns) || !UnpackVouchers(row.vouchers, record)) {
        throw Error("what is held against a vehicle is no such record");
      }
      take(static_cast<std::uint64_t>(row.vehicle_key), record);
    });
  });
}

void LearnedTables::WriteLife(const std::string& class_name, const LearnedLifetime& learned) {
  ExplainStore("writing what was learned of a class", [&] {
    row_.class_name = class_name;
    row_.ended = learned.ended;
    row_.stood_s = learned.stood_s;
    write_life_.Execute();
  });
}

void LearnedTables::WriteTrust(std::uint64_t vehicle, const TrustRecord& record) {
  ExplainStore("writing what is held against a vehicle", [&] {
    // The same bits: databases have no unsigned numbers.
    row_.vehicle_key = static_cast<long long>(vehicle);
    row_.suspicion = record.suspicion;
    row_.updated_ns = record.at_ns;
    row_.vouchers = PackVouchers(record);
    write_trust_.Execute();
  });
}

}  // namespace livemap::zone
