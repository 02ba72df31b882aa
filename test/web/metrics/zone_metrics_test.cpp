#include "web/metrics/zone_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "common/sqlite.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "test/zone/postgresql_server.h"
#include "web/metrics/metrics_text.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;
using testing::Not;

class ZoneMetricsTest : public testing::Test {
 protected:
  std::string Metrics() const { return MetricsOf(server_); }
  static std::string MetricsOf(const WebServer& server) {
    const HttpResult answer = Get(server.port(), "/metrics");
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.Field("Content-Type"), kMetricsType);
    return answer.body;
  }

  void TellOutboxAge(const std::string& vehicle_id, std::optional<double> age_s) {
    zone::VehicleState vehicle;
    vehicle.vehicle_id = vehicle_id;
    vehicle.position = {40.44, -79.94};
    vehicle.stamp_ns = fixture_.now_ns;
    vehicle.outbox_age_s = age_s;
    EXPECT_TRUE(fixture_.zone->UpdateVehicle(vehicle));
  }

  ZoneFixture fixture_;
  WebServer server_{TestOptions(), *fixture_.zone, fixture_.catalogue};
};

TEST_F(ZoneMetricsTest, CountsReportsRefusalsAndAges) {
  fixture_.AddRow("pothole", {40.44, -79.94}, 2);
  protocol::Report late = fixture_.MakeReport("pothole", {40.44, -79.94});
  late.stamp_ns -= 20'000'000'000;
  fixture_.zone->Handle(late);
  protocol::Report wrong = fixture_.MakeReport("pothole", {40.44, -79.94});
  wrong.confidence = 2;
  fixture_.zone->Handle(wrong);
  const std::string metrics = Metrics();
  EXPECT_THAT(metrics, HasSubstr("# TYPE livemap_reports_total counter\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_reports_total{outcome=\"added\"} 2\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_reports_total{outcome=\"merged\"} 1\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_reports_refused_total{reason=\"malformed\"} 1\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_hazards{state=\"candidate\"} 2\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_report_age_seconds_bucket{le=\"10\"} 2\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_report_age_seconds_bucket{le=\"30\"} 3\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_report_age_seconds_bucket{le=\"+Inf\"} 3\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_report_age_seconds_sum 20\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_web_connections 1\n"));
  // No metric grows with what strangers send.
  EXPECT_THAT(metrics, Not(HasSubstr("car-1")));
}

TEST_F(ZoneMetricsTest, SaysHowOldTheOutboxesAreOfVehiclesThatSayIt) {
  EXPECT_THAT(Metrics(), Not(HasSubstr("livemap_vehicle_outbox_age_seconds{")));
  int number = 0;
  for (const auto& age_s :
       {std::optional(0.0), std::optional(40.0), std::optional(2.5), std::optional<double>()}) {
    TellOutboxAge("car-" + std::to_string(++number), age_s);
  }
  const std::string metrics = Metrics();
  EXPECT_THAT(metrics, HasSubstr("livemap_vehicles_telling_outbox 3\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_vehicle_outbox_age_seconds{quantile=\"0.5\"} 2.5\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_vehicle_outbox_age_seconds{quantile=\"1\"} 40\n"));
  fixture_.now_ns += 61'000'000'000;
  EXPECT_THAT(Metrics(), HasSubstr("livemap_vehicles_telling_outbox 0\n"));
}

TEST_F(ZoneMetricsTest, EveryLineIsOfTheTextFormatAndEveryFamilyHasOneType) {
  std::istringstream lines(Metrics());
  const std::regex comment("# (HELP|TYPE) (livemap_[a-z_]+) .+");
  const std::regex sample("(livemap_[a-z_]+)(\\{[a-z]+=\"[^\"]*\"\\})? [0-9.e+-]+");
  std::set<std::string> typed;
  for (std::string line; std::getline(lines, line);) {
    std::smatch parts;
    const bool is_comment = std::regex_match(line, parts, comment);
    EXPECT_TRUE(is_comment || std::regex_match(line, sample)) << line;
    if (is_comment && parts[1] == "TYPE") {
      EXPECT_TRUE(typed.insert(parts[2]).second) << line;
    }
  }
  EXPECT_GT(typed.size(), 15U);
}

TEST_F(ZoneMetricsTest, TheDashboardAsksOnlyForMetricsThatThereAre) {
  std::ifstream file(LIVEMAP_SOURCE_DIR "/config/grafana/livemap_zone.json");
  const nlohmann::json dashboard = nlohmann::json::parse(file);
  // A zone with all that a zone may have.
  const TemporaryFolder folder;
  orders::OrderDesk desk(
      {}, folder.path(), *fixture_.zone, fixture_.catalogue,
      [this] { return fixture_.now_ns.load(); }, 1, [](const std::string&) {});
  const WebServer server(TestOptions(), *fixture_.zone, fixture_.catalogue, &desk);
  TellOutboxAge("car-1", 0.0);
  const std::string metrics = MetricsOf(server);
  const std::regex name("livemap_[a-z_]+");
  std::set<std::string> asked;
  std::set<std::string> rows;
  for (const auto& panel : dashboard["panels"]) {
    if (panel["type"] == "row") {
      rows.insert(panel["title"]);
      continue;
    }
    for (const auto& target : panel["targets"]) {
      const std::string query = target["expr"];
      for (std::sregex_iterator found(query.begin(), query.end(), name), end; found != end;
           ++found) {
        asked.insert(found->str());
      }
    }
  }
  EXPECT_GT(asked.size(), 18U);
  EXPECT_EQ(rows.count("Work orders"), 1U);
  for (const char* of_orders : {"livemap_work_orders", "livemap_work_order_oldest_seconds",
                                "livemap_work_order_attempts_total"}) {
    EXPECT_EQ(asked.count(of_orders), 1U) << of_orders << " is on no panel";
  }
  for (const std::string& metric : asked) {
    const bool is_there = metrics.find('\n' + metric + ' ') != std::string::npos ||
                          metrics.find('\n' + metric + '{') != std::string::npos;
    EXPECT_TRUE(is_there) << metric;
  }
}

TEST_F(ZoneMetricsTest, TheZoneIsReadyWhileItsStoreKeepsWhatIsWritten) {
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 200);
  EXPECT_EQ(Get(server_.port(), "/readyz").Json()["status"], "ready");
  SqliteDatabase saboteur(fixture_.database(), true);
  saboteur.Execute(
      "CREATE TRIGGER no_space BEFORE INSERT ON events BEGIN SELECT RAISE(ABORT, 'full'); END");
  EXPECT_THROW(fixture_.AddRow("pothole", {40.44, -79.94}, 1), StoreError);
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 503);
  EXPECT_THAT(Metrics(), HasSubstr("livemap_ready 0\n"));
  EXPECT_THAT(Metrics(), HasSubstr("livemap_store_errors_total 1\n"));
  saboteur.Execute("DROP TRIGGER no_space");
  fixture_.AddRow("pothole", {40.44, -79.94}, 1);
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 200);
}

TEST_F(ZoneMetricsTest, AZoneWhoseFileIsGoneIsNotReadyUntilItIsBack) {
  const std::string elsewhere = fixture_.database() + ".elsewhere";
  std::filesystem::rename(fixture_.database(), elsewhere);
  EXPECT_THROW(fixture_.zone->CheckStore(), StoreError);
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 503);
  std::filesystem::rename(elsewhere, fixture_.database());
  fixture_.zone->CheckStore();
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 200);
}

TEST_F(ZoneMetricsTest, AZoneIsReadyAgainOnceAWriteIsKeptAlsoWithoutAReport) {
  SqliteDatabase saboteur(fixture_.database(), true);
  saboteur.Execute(
      "CREATE TRIGGER no_space BEFORE UPDATE ON livemap_schema BEGIN SELECT RAISE(ABORT, 'full'); "
      "END");
  saboteur.Execute(
      "CREATE TRIGGER no_event BEFORE INSERT ON events BEGIN SELECT RAISE(ABORT, 'full'); END");
  fixture_.zone->CheckStore();
  EXPECT_THROW(fixture_.AddRow("pothole", {40.44, -79.94}, 1), StoreError);
  EXPECT_THROW(fixture_.zone->CheckStore(), StoreError);
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 503);
  saboteur.Execute("DROP TRIGGER no_space");
  fixture_.zone->CheckStore();
  EXPECT_EQ(Get(server_.port(), "/readyz").status, 200);
}

TEST(ZoneReadinessTest, WithoutItsServerOfPostgresqlAZoneIsNotReadyUntilThatIsBack) {
  if (!test::PostgresqlServer::IsInstalled()) GTEST_SKIP() << "skipped, no PostgreSQL server";
  test::PostgresqlServer postgresql;
  const ZoneFixture fixture(nullptr, "", postgresql.MakeDatabase());
  const WebServer server(TestOptions(), *fixture.zone, fixture.catalogue);
  fixture.zone->CheckStore();
  EXPECT_EQ(Get(server.port(), "/readyz").status, 200);
  for (const int how : {SIGINT, SIGKILL}) {
    postgresql.Kill(how);
    EXPECT_THROW(fixture.zone->CheckStore(), StoreError);
    EXPECT_THROW(fixture.zone->CheckStore(), StoreError);
    const HttpResult answer = Get(server.port(), "/readyz");
    EXPECT_EQ(answer.status, 503);
    EXPECT_THAT(std::string(answer.Json()["error"]), HasSubstr("the store does not answer"));
    EXPECT_THAT(answer.body, Not(HasSubstr("livemap@"))) << "strangers do not learn where it is";
    postgresql.Start();
    fixture.zone->CheckStore();
    EXPECT_EQ(Get(server.port(), "/readyz").status, 200);
  }
}

TEST(MetricsTextTest, EscapesValuesOfLabels) {
  MetricsText text;
  text.Begin("a", "gauge", "Help.");
  text.Add("b", "c\"\\\n", 1.5);
  EXPECT_EQ(text.text(), "# HELP a Help.\n# TYPE a gauge\na{b=\"c\\\"\\\\\\n\"} 1.5\n");
}

}  // namespace
}  // namespace livemap::web
