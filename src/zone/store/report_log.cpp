#include "zone/store/report_log.h"

#include <algorithm>

#include "protocol/poll.h"
#include "zone/store/queries.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMostAskedReports = 1000;

/// Of each uuid in :asked that a report has, its number there from 1, the report's hazard, and its
/// vehicle. SQLite is asked for one uuid at a time, PostgreSQL for an array of them. A report whose
/// hazard is broken is known all the same: its uuid is taken.
std::string FindReportsStatement(const StoreConnection& connection) {
  const Dialect& dialect = connection.dialect();
  const std::string what = dialect.TextOrEmpty("h.uuid", 37) + " AS hazard_uuid, " +
                           dialect.TextOrEmpty("r.vehicle_id", 65) +
                           " AS vehicle_id FROM reports r LEFT JOIN hazards h ON h.id = "
                           "r.hazard_id WHERE r.uuid = ";
  if (!connection.is_postgresql()) return "SELECT 1, " + what + ":asked";
  // The limit keeps the server from a plan that reads the whole table, whatever it believes to know
  // of a table that is new to it.
  return "SELECT asked.number, known.hazard_uuid, known.vehicle_id FROM "
         "unnest(CAST(:asked AS text[])) WITH ORDINALITY AS asked (uuid, number) "
         "CROSS JOIN LATERAL (SELECT " +
         what + "asked.uuid LIMIT 1) AS known";
}

}  // namespace

ReportLog::ReportLog(StoreConnection& connection)
    : connection_(connection),
      find_reports_((connection.session().prepare << FindReportsStatement(connection),
                     soci::use(row_.asked), soci::into(row_.number), soci::into(row_.hazard_uuid),
                     soci::into(row_.vehicle_id))),
      write_report_(
          connection,
          "INSERT INTO reports (uuid, hazard_id, vehicle_id, drive_id, stamp_ns, "
          "received_ns, confidence, latitude, longitude, covariance_ee, covariance_en, "
          "covariance_nn, image_sha256) VALUES "
          "(:u, :h, :v, :d, :st, :re, :co, :la, :lo, :ee, :en, :nn, :im)",
          {row_.uuid, row_.hazard_id, row_.vehicle_id, row_.drive_id, row_.stamp_ns,
           row_.received_ns, row_.confidence, row_.latitude, row_.longitude, row_.covariance_ee,
           row_.covariance_en, row_.covariance_nn, row_.image_sha256}),
      write_box_(connection,
                 "INSERT INTO report_boxes (hazard_id, image_sha256, box_left, "
                 "box_top, box_right, box_bottom) VALUES (:h, :i, :l, :t, :r, "
                 ":b)",
                 {row_.hazard_id, row_.image_sha256, row_.box_left, row_.box_top, row_.box_right,
                  row_.box_bottom}),
      write_answer_(connection,
                    "INSERT INTO answers (poll_uuid, hazard_id, vehicle_id, answer, "
                    "reason, confidence, "
                    "stamp_ns, received_ns) VALUES (:u, :h, :v, :a, :r, :c, :st, :re)",
                    {row_.uuid, row_.hazard_id, row_.vehicle_id, row_.answer, row_.reason,
                     row_.confidence, row_.stamp_ns, row_.received_ns}) {}

std::vector<std::optional<ZoneStore::KnownReport>> ReportLog::FindReports(
    const std::vector<Uuid>& reports) {
  return ExplainStore("looking up reports", [&] {
    std::vector<std::optional<ZoneStore::KnownReport>> known(reports.size());
    const std::size_t at_once = connection_.is_postgresql() ? kMostAskedReports : 1;
    for (std::size_t begin = 0; begin < reports.size(); begin += at_once) {
      const std::size_t end = std::min(reports.size(), begin + at_once);
      row_.asked = connection_.is_postgresql() ? "{" : "";
      for (std::size_t i = begin; i < end; ++i) {
        if (i > begin) row_.asked += ',';
        row_.asked += reports[i].ToString();
      }
      if (connection_.is_postgresql()) row_.asked += '}';
      connection_.Run(find_reports_);
      while (find_reports_.fetch()) {
        if (row_.number < 1 || row_.number > static_cast<long long>(end - begin)) continue;
        known[begin + static_cast<std::size_t>(row_.number) - 1] =
            ZoneStore::KnownReport{Uuid::Parse(row_.hazard_uuid).value_or(Uuid{}), row_.vehicle_id};
      }
    }
    return known;
  });
}

void ReportLog::WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                            const std::string& image_sha256, std::int64_t received_ns) {
  ExplainStore("writing a report", [&] {
    row_.uuid = report.uuid.ToString();
    row_.hazard_id = static_cast<long long>(hazard_id);
    row_.vehicle_id = report.vehicle_id;
    row_.drive_id = report.drive_id;
    row_.stamp_ns = report.stamp_ns;
    row_.received_ns = received_ns;
    row_.confidence = static_cast<double>(report.confidence);
    row_.latitude = report.position.latitude_deg;
    row_.longitude = report.position.longitude_deg;
    row_.covariance_ee = report.covariance_m2(0, 0);
    row_.covariance_en = report.covariance_m2(0, 1);
    row_.covariance_nn = report.covariance_m2(1, 1);
    row_.image_sha256 = image_sha256;
    write_report_.Execute();
    if (!image_sha256.empty()) WriteBox(report);
  });
}

/// Of the row's hazard and picture, as far as the picture shows it.
void ReportLog::WriteBox(const protocol::Report& report) {
  imaging::PixelRegion shown = report.shown;
  if (shown.IsWholeImage()) shown = {0, 0, report.image_width, report.image_height};
  const auto share = [](float edge, std::uint32_t begin, std::uint32_t size) {
    return std::clamp((static_cast<double>(edge) - begin) / size, 0.0, 1.0);
  };
  row_.box_left = share(report.box.x_min, shown.x, shown.width);
  row_.box_top = share(report.box.y_min, shown.y, shown.height);
  row_.box_right = share(report.box.x_max, shown.x, shown.width);
  row_.box_bottom = share(report.box.y_max, shown.y, shown.height);
  const bool is_shown = row_.box_left < row_.box_right && row_.box_top < row_.box_bottom;
  if (is_shown) write_box_.Execute();
}

void ReportLog::WriteAnswer(const protocol::PollAnswer& answer, std::uint64_t hazard_id,
                            std::int64_t received_ns) {
  ExplainStore("writing an answer", [&] {
    row_.uuid = answer.poll.ToString();
    row_.hazard_id = static_cast<long long>(hazard_id);
    row_.vehicle_id = answer.vehicle_id;
    row_.answer = static_cast<int>(answer.answer);
    row_.reason = answer.reason;
    row_.confidence = static_cast<double>(answer.confidence);
    row_.stamp_ns = answer.stamp_ns;
    row_.received_ns = received_ns;
    write_answer_.Execute();
  });
}

}  // namespace livemap::zone
