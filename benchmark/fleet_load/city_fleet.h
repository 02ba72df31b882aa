#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "fleet_load/city_hazards.h"
#include "fleet_load/client_loop.h"
#include "fleet_load/movement.h"
#include "geo/wgs84.h"
#include "protocol/notice.h"
#include "protocol/poll.h"
#include "vehicle/reporting/cell_follower.h"
#include "vehicle/reporting/notice_sequence_tracker.h"

namespace livemap::bench {

/// Vehicles that drive through a city, each an MQTT client with a login of its own, and speak the
/// vehicle's messages with a zone: they say every second where they are and up to where they know
/// the zone's map, report hazards that they pass and do not know, again until they are answered,
/// and answer polls. A few further logins, the surveyors, put the city's first hazards on the map
/// before. Everything runs in one thread. Reports have no pictures.
///
/// Typical usage:
///
///     CityFleet fleet(config, std::move(movement));
///     if (is_new_city) fleet.Survey();
///     fleet.Connect();
///     CityFleet::Result result = fleet.Drive(warm_up_s, seconds, [] {});
class CityFleet {
 public:
  struct Config {
    transport::MqttConfig mqtt;  ///< Without client id, user and password.
    std::string zone;
    std::string credentials;  ///< Folder with a file per login, its password in the first line.
    std::size_t first_vehicle = 0;  ///< Logins are car-N from here on.
    std::size_t hazards = 10000;    ///< In the city at first.
    double births_per_s = 2;        ///< New hazards; as many end.
    /// Vehicles hear of the cells of the map around them; else of all hazards of the zone.
    bool by_cells = true;
    std::uint64_t seed = 1;
  };

  /// Counts and times of the measured seconds only, if not said otherwise.
  struct Result {
    double seconds = 0;
    std::size_t connected = 0;     ///< Vehicles at the end.
    std::uint64_t lost = 0;        ///< Connections, since the start.
    std::string first_loss;        ///< Why.
    double connect_s = 0;          ///< From the first login to the last subscription.
    std::uint64_t positions = 0;   ///< Sent.
    std::vector<double> late_ms;   ///< Each, after it was due: how busy this program is.
    std::uint64_t reports = 0;     ///< Sent.
    std::uint64_t resent = 0;      ///< Reports sent once more, without a receipt for kResendNs.
    std::uint64_t unanswered = 0;  ///< Of all reports, at the end.
    std::uint64_t committed = 0;
    std::uint64_t refused = 0;
    std::string first_refusal;
    std::uint64_t births = 0;
    std::uint64_t polls = 0;
    std::uint64_t poll_answers = 0;
    std::uint64_t announcements = 0;  ///< Different ones that a vehicle heard.
    std::vector<double> receipt_ms;   ///< From sending a report to its receipt.
    /// When the report was sent that an announcement tells of, by the announcement's sequence.
    std::map<std::uint64_t, std::int64_t> report_ns;
    /// From then to each vehicle that hears the announcement.
    std::vector<double> notice_ms;
    /// The same, of vehicles with the hazard ahead, at most kAheadM away.
    std::vector<double> ahead_ms;
    std::vector<double> up_bytes;  ///< Per vehicle, over its TCP connection.
    std::vector<double> down_bytes;
    /// MQTT payload and topic of notices to everybody or to a cell's vehicles, all vehicles.
    std::uint64_t notice_bytes = 0;
    std::uint64_t near_notice_bytes = 0;  ///< Of them, of hazards within kNearM of the hearer.
    std::uint64_t told_bytes = 0;         ///< The same of notices to one vehicle.
    std::uint64_t told = 0;               ///< Hazards told to single vehicles.
    std::uint64_t cells_told = 0;         ///< The same of cells of the map.
    /// Since the start: from login until the vehicle knows all around it for the first time.
    std::vector<double> join_s;
  };

  static constexpr double kAheadM = 500;
  static constexpr double kNearM = 1500;
  static constexpr std::size_t kSurveyors = 24;
  static constexpr std::int64_t kResendNs = 10'000'000'000;

  /// Places the city's first hazards. `movement` has at least the seconds that are driven.
  CityFleet(const Config& config, Movement movement);

  /// Puts the first hazards on the map, by two surveyors each. Throws Error when the zone does not
  /// commit them all.
  void Survey();
  /// Logs the vehicles in. Throws Error when not all could in time.
  void Connect();
  /// Drives for `warm_up_s`, then for `seconds`, and measures the latter, from when `on_measured`
  /// is called.
  Result Drive(double warm_up_s, double seconds, const std::function<void()>& on_measured);

 private:
  /// A report in a vehicle's outbox.
  struct Waiting {
    std::int64_t first_sent_ns = 0;
    std::int64_t sent_ns = 0;  ///< The last time.
    std::vector<std::uint8_t> payload;
  };
  struct Vehicle {
    std::string id;
    std::string topics;  ///< Where its own begin.
    std::int64_t login_ns = 0;
    vehicle::NoticeSequenceTracker chain;
    vehicle::CellFollower cells{vehicle::CellFollower::Config{}};
    std::map<std::uint32_t, vehicle::NoticeSequenceTracker> cell_chains;  ///< By cell's number.
    std::set<Uuid> told;      ///< Since the last CAUGHT_UP.
    std::vector<bool> knows;  ///< By the number of the hazard.
    std::vector<protocol::Poll> polls;
    std::unordered_map<Uuid, Waiting> reports;  ///< Without a receipt.
    bool has_joined = false;
    ClientLoop::Traffic before;
  };
  /// An announcement, decoded once for all vehicles that hear it.
  struct Announcement {
    std::vector<std::uint8_t> payload;
    protocol::Notice notice;
    std::optional<std::uint32_t> hazard;
    std::int64_t report_ns =
        0;  ///< When the report that it tells of was sent; 0: it tells of none.
  };

  std::size_t AddClient(const std::string& id, const std::string& zone_notices);
  void AwaitLogins(std::size_t first);
  void OnMessage(std::size_t client, const transport::MqttMessage& message);
  void OnNoticeToAll(std::size_t client, const transport::MqttMessage& message);
  void OnOwnNotice(std::size_t client, const transport::MqttMessage& message);
  void OnCellHazards(std::size_t client, const transport::MqttMessage& message);
  void OnFollowed(std::size_t client, const std::vector<std::string>& topics);
  void FollowCells(std::size_t client, const geo::GeoPoint& position);
  void NoteJoin(Vehicle& vehicle);
  void OnReceipt(std::size_t client, const transport::MqttMessage& message);
  const Announcement& Decode(const transport::MqttMessage& message);
  void Learn(Vehicle& vehicle, const protocol::Notice& notice, std::optional<std::uint32_t> hazard);
  void SendReport(std::size_t client, std::uint32_t hazard, std::int64_t stamp_ns);
  void ResendReports(std::size_t client);
  void SendPosition(std::size_t client, const VehicleStep& step);
  void AnswerPolls(std::size_t client, const VehicleStep& step);
  void LookAround(std::size_t client, const VehicleStep& step);
  void LetHazardsComeAndGo(std::size_t second);
  std::size_t second() const;
  const VehicleStep& StepOf(std::size_t client) const;

  const Config config_;
  const Movement movement_;
  const geo::LocalFrame city_;
  std::mt19937_64 random_;
  CityHazards hazards_;
  std::vector<std::uint32_t> standing_;       ///< Hazards that are there.
  std::vector<std::int64_t> last_report_ns_;  ///< By hazard: when it was sent.
  std::vector<std::uint32_t> sightings_;      ///< By hazard: as announced last.
  /// The newest, by sequence and number of the cell: one may tell two cells of a hazard.
  std::map<std::pair<std::uint64_t, std::uint32_t>, Announcement> announcements_;
  std::vector<Vehicle> vehicles_;  ///< By client.
  bool counting_ = false;
  std::int64_t start_ns_ = 0;  ///< Of the drive.
  Result result_;
  ClientLoop loop_;  ///< Last: it calls the rest.
};

}  // namespace livemap::bench
