#include "fleet_load/city_fleet.h"

#include <livemap/CellHazards.h>
#include <livemap/CellRequest.h>
#include <livemap/HazardNotice.h>
#include <livemap/HazardPoll.h>
#include <livemap/HazardPollAnswer.h>
#include <livemap/HazardReport.h>
#include <livemap/ReportReceipt.h>
#include <livemap/VehiclePosition.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "ros/conversions/cell_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/poll_conversions.h"
#include "zone_messages.h"

namespace livemap::bench {
namespace {

constexpr std::size_t kKeptAnnouncements = 1000;
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kLoginPatienceNs = 300 * kSecondNs;
constexpr std::int64_t kSurveyPatienceNs = 600 * kSecondNs;
constexpr double kSurveyMps = 25;
/// The surveys are this old: what they report lasts for weeks.
constexpr std::int64_t kSurveyAgeNs = 3 * 86400 * kSecondNs;
constexpr std::size_t kSurveyWindow = 100;
constexpr double kSightM = 20;
constexpr double kSeen = 0.75;  ///< Of the passes: hit_rate of a pothole.
constexpr char kClass[] = "pothole";
const geo::GeoPoint kSouthWest{40.0, -80.0};

double MillisecondsSinceNs(std::int64_t begin_ns) {
  return static_cast<double>(SteadyNs() - begin_ns) * 1e-6;
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

}  // namespace

CityFleet::CityFleet(const Config& config, Movement movement)
    : config_(config),
      movement_(std::move(movement)),
      city_(kSouthWest),
      random_(config.seed),
      loop_(config.mqtt, {[this](std::size_t client, const transport::MqttMessage& message) {
                            OnMessage(client, message);
                          },
                          [this](std::size_t, const std::string& reason) {
                            if (result_.lost++ == 0) result_.first_loss = reason;
                          },
                          [this](std::size_t client, const std::vector<std::string>& topics) {
                            OnFollowed(client, topics);
                          }}) {
  while (standing_.size() < config_.hazards) {
    if (const auto hazard = hazards_.Add(movement_.RandomPlace(random_))) {
      standing_.push_back(*hazard);
    }
  }
  // Of each two of the zone's sightings the second confirms the first.
  last_report_ns_.resize(hazards_.size());
  sightings_.resize(hazards_.size(), 2);
}

std::size_t CityFleet::AddClient(const std::string& id, const std::string& zone_notices) {
  Vehicle vehicle;
  vehicle.id = id;
  vehicle.topics = "livemap/v1/" + config_.zone + "/vehicle/" + id + "/";
  vehicle.login_ns = SteadyNs();
  std::vector<transport::MqttSubscription> subscriptions = {{vehicle.topics + "receipt", 0},
                                                            {vehicle.topics + "notice", 1},
                                                            {vehicle.topics + "poll", 1},
                                                            {vehicle.topics + "cell_hazards", 1},
                                                            {vehicle.topics + "change_receipt", 0}};
  if (!zone_notices.empty()) subscriptions.push_back({zone_notices, 1});
  vehicles_.push_back(std::move(vehicle));
  return loop_.Connect({id, PasswordOf(config_.credentials + "/" + id), subscriptions});
}

/// Of the clients from `first` on.
void CityFleet::AwaitLogins(std::size_t first) {
  const std::int64_t deadline_ns = SteadyNs() + kLoginPatienceNs;
  for (std::size_t client = first; client < loop_.size();) {
    if (loop_.IsReady(client)) {
      ++client;
      continue;
    }
    loop_.Poll(50);
    if (SteadyNs() > deadline_ns || result_.lost > 0) {
      throw Error("client '" + vehicles_[client].id + "' could not log in and subscribe" +
                  (result_.first_loss.empty() ? "" : ": " + result_.first_loss));
    }
  }
}

void CityFleet::Survey() {
  const std::size_t first = loop_.size();
  for (std::size_t i = 0; i < kSurveyors; ++i) AddClient("surveyor-" + std::to_string(i), "");
  AwaitLogins(first);
  // Neighbours in a row of streets go to one surveyor, and then to the next one as well.
  std::vector<std::uint32_t> order = standing_;
  const auto row = [this](std::uint32_t hazard) {
    return std::floor(hazards_.PlaceOf(hazard).y() / 200);
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    if (row(a) != row(b)) return row(a) < row(b);
    return hazards_.PlaceOf(a).x() < hazards_.PlaceOf(b).x();
  });
  std::vector<std::vector<std::uint32_t>> ways(kSurveyors);
  const auto share = [&](std::size_t surveyor) {
    const std::size_t begin = order.size() * surveyor / kSurveyors;
    const std::size_t end = order.size() * (surveyor + 1) / kSurveyors;
    return std::vector<std::uint32_t>(order.begin() + static_cast<std::ptrdiff_t>(begin),
                                      order.begin() + static_cast<std::ptrdiff_t>(end));
  };
  for (std::size_t i = 0; i < kSurveyors; ++i) {
    ways[i] = share(i);
    const auto next = share((i + 1) % kSurveyors);
    ways[i].insert(ways[i].end(), next.begin(), next.end());
  }
  std::vector<std::size_t> done(kSurveyors);
  std::vector<std::int64_t> stamps(kSurveyors, SystemNs() - kSurveyAgeNs);
  const std::int64_t deadline_ns = SteadyNs() + kSurveyPatienceNs;
  counting_ = true;
  while (result_.committed + result_.refused < 2 * order.size()) {
    for (std::size_t i = 0; i < kSurveyors; ++i) {
      while (done[i] < ways[i].size() && vehicles_[first + i].reports.size() < kSurveyWindow) {
        const std::uint32_t hazard = ways[i][done[i]];
        if (done[i] > 0) {
          const double way_m =
              (hazards_.PlaceOf(hazard) - hazards_.PlaceOf(ways[i][done[i] - 1])).norm();
          stamps[i] += static_cast<std::int64_t>(way_m / kSurveyMps * 1e9) + kSecondNs;
        }
        ++done[i];
        SendReport(first + i, hazard, stamps[i]);
      }
      ResendReports(first + i);
    }
    loop_.Poll(20);
    if (SteadyNs() > deadline_ns) {
      throw Error("of " + std::to_string(2 * order.size()) + " reports the zone answered " +
                  std::to_string(result_.committed + result_.refused));
    }
  }
  counting_ = false;
  if (result_.refused > 0) {
    throw Error("the zone refused " + std::to_string(result_.refused) +
                " of the first reports: " + result_.first_refusal);
  }
  result_ = Result();
}

void CityFleet::Connect() {
  const std::int64_t begin_ns = SteadyNs();
  const std::size_t first = loop_.size();
  for (std::size_t i = 0; i < movement_.config().vehicles; ++i) {
    AddClient("car-" + std::to_string(config_.first_vehicle + i),
              config_.by_cells ? "" : "livemap/v1/" + config_.zone + "/notice");
    if (i % 50 == 0) loop_.Poll(0);
  }
  AwaitLogins(first);
  result_.connect_s = static_cast<double>(SteadyNs() - begin_ns) * 1e-9;
  for (std::size_t client = first; client < vehicles_.size(); ++client) {
    vehicles_[client].login_ns = SteadyNs();
  }
}

std::size_t CityFleet::second() const {
  const auto passed = static_cast<std::size_t>((SteadyNs() - start_ns_) / kSecondNs);
  return std::min(passed, movement_.config().seconds - 1);
}

const VehicleStep& CityFleet::StepOf(std::size_t client) const {
  const std::size_t first = vehicles_.size() - movement_.config().vehicles;
  return movement_.At(client - first, second());
}

CityFleet::Result CityFleet::Drive(double warm_up_s, double seconds,
                                   const std::function<void()>& on_measured) {
  const std::size_t count = movement_.config().vehicles;
  const std::size_t first = vehicles_.size() - count;
  start_ns_ = SteadyNs();
  const std::int64_t measured_ns = start_ns_ + static_cast<std::int64_t>(warm_up_s * 1e9);
  const std::int64_t end_ns = measured_ns + static_cast<std::int64_t>(seconds * 1e9);
  std::uint64_t due = 0;  // Positions, all vehicles in turn.
  std::size_t lived = 0;
  for (std::int64_t now_ns = start_ns_; now_ns < end_ns; now_ns = SteadyNs()) {
    if (!counting_ && now_ns >= measured_ns) {
      counting_ = true;
      on_measured();
      for (std::size_t client = first; client < vehicles_.size(); ++client) {
        vehicles_[client].before = loop_.TrafficOf(client);
      }
    }
    for (; lived <= second(); ++lived) LetHazardsComeAndGo(lived);
    for (int burst = 0; burst < 100; ++burst) {
      const auto due_ns = start_ns_ + static_cast<std::int64_t>(static_cast<double>(due) * 1e9 /
                                                                static_cast<double>(count));
      if (due_ns > SteadyNs()) break;
      const std::size_t client = first + due % count;
      const VehicleStep& step = movement_.At(due % count, second());
      ++due;
      if (counting_) result_.late_ms.push_back(MillisecondsSinceNs(due_ns));
      SendPosition(client, step);
      ResendReports(client);
      LookAround(client, step);
      AnswerPolls(client, step);
    }
    loop_.Poll(1);
  }
  counting_ = false;
  result_.seconds = static_cast<double>(SteadyNs() - measured_ns) * 1e-9;
  result_.connected = loop_.connected() - first;
  for (std::size_t client = first; client < vehicles_.size(); ++client) {
    result_.unanswered += vehicles_[client].reports.size();
    const ClientLoop::Traffic traffic = loop_.TrafficOf(client);
    if (traffic.received_bytes == 0) continue;
    const ClientLoop::Traffic& before = vehicles_[client].before;
    result_.up_bytes.push_back(static_cast<double>(traffic.sent_bytes - before.sent_bytes));
    result_.down_bytes.push_back(
        static_cast<double>(traffic.received_bytes - before.received_bytes));
  }
  return std::move(result_);
}

/// Where a vehicle will be soon, so that hazards come to be where there is traffic.
void CityFleet::LetHazardsComeAndGo(std::size_t now_s) {
  const int births = std::poisson_distribution<int>(config_.births_per_s)(random_);
  const Movement::Config& drive = movement_.config();
  for (int i = 0; i < births; ++i) {
    const std::size_t vehicle = random_() % drive.vehicles;
    const std::size_t then_s = std::min(now_s + 5 + random_() % 20, drive.seconds - 1);
    const auto hazard = hazards_.Add(movement_.At(vehicle, then_s).east_north_m);
    if (!hazard) continue;
    standing_.push_back(*hazard);
    last_report_ns_.push_back(0);
    sightings_.push_back(0);
    if (counting_) ++result_.births;
    const std::size_t ended = random_() % standing_.size();
    hazards_.End(standing_[ended]);
    standing_[ended] = standing_.back();
    standing_.pop_back();
  }
}

void CityFleet::SendPosition(std::size_t client, const VehicleStep& step) {
  Vehicle& vehicle = vehicles_[client];
  zone::VehicleState state;
  state.drive_id = "fleet";
  state.position = city_.ToGeo(step.east_north_m);
  state.course_rad = step.speed_mps > 0.5 ? step.course_rad : std::nan("");
  state.speed_mps = step.speed_mps;
  state.stamp_ns = SystemNs();
  state.outbox_age_s = 0;
  const bool is_sent =
      loop_.Publish(client, vehicle.topics + "position",
                    Enclose(ros_io::ToMessage(state, 1.0, vehicle.chain.known())), 0);
  if (counting_ && is_sent) ++result_.positions;
  if (config_.by_cells) FollowCells(client, state.position);
}

void CityFleet::FollowCells(std::size_t client, const geo::GeoPoint& position) {
  Vehicle& vehicle = vehicles_[client];
  if (vehicle.cells.MoveTo(position)) {
    std::vector<std::string> topics;
    for (const geo::MapCell& cell : vehicle.cells.wanted()) {
      topics.push_back("livemap/v1/" + config_.zone + "/notice/" + cell.Quadkey());
    }
    loop_.Follow(client, topics);
  }
  const auto knowledge_of = [&vehicle](const std::string&, const geo::MapCell& cell) {
    const vehicle::NoticeSequenceTracker& chain = vehicle.cell_chains[cell.number()];
    return vehicle::CellFollower::Knowledge{chain.known(), chain.has_gap()};
  };
  const double now_s = static_cast<double>(SteadyNs()) * 1e-9;
  for (const protocol::CellRequest& request : vehicle.cells.TakeDue(now_s, knowledge_of)) {
    loop_.Publish(client, vehicle.topics + "cell_request", Enclose(ros_io::ToMessage(request)), 1);
  }
}

void CityFleet::OnFollowed(std::size_t client, const std::vector<std::string>& topics) {
  std::vector<geo::MapCell> cells;
  for (const std::string& topic : topics) {
    const auto cell =
        geo::MapCell::FromQuadkey(std::string_view(topic).substr(topic.rfind('/') + 1));
    if (cell) cells.push_back(*cell);
  }
  vehicles_[client].cells.SetHeard("", cells);
}

/// As LocalHazardMap takes it, but for its disk.
void CityFleet::OnCellHazards(std::size_t client, const transport::MqttMessage& message) {
  Vehicle& vehicle = vehicles_[client];
  const protocol::CellNews news = ros_io::FromMessage(Open<CellHazards>(message));
  if (counting_) result_.told_bytes += message.topic.size() + message.payload.size;
  if (news.cells.empty()) vehicle.cells.AskAgain("");
  for (const protocol::CellNews::Cell& cell : news.cells) {
    vehicle::NoticeSequenceTracker& chain = vehicle.cell_chains[cell.cell.number()];
    if (!cell.is_whole() && cell.since > chain.known()) continue;
    chain.CloseTo(cell.sequence);
    vehicle.cells.NoteAnswer("", cell.cell, static_cast<double>(SteadyNs()) * 1e-9);
    if (counting_) {
      ++result_.cells_told;
      result_.told += cell.hazards.size();
    }
    for (const protocol::CellNews::Hazard& hazard : cell.hazards) {
      if (hazard.removed) continue;  // It has no place; the vehicle takes it for there.
      const auto number = hazards_.FindAt(city_.ToEnu(hazard.position));
      if (!number) continue;
      if (vehicle.knows.size() <= *number) vehicle.knows.resize(hazards_.size());
      vehicle.knows[*number] = true;
    }
  }
  if (vehicle.cells.heard() > 0 && vehicle.cells.unanswered() == 0) NoteJoin(vehicle);
}

void CityFleet::NoteJoin(Vehicle& vehicle) {
  if (vehicle.has_joined) return;
  vehicle.has_joined = true;
  result_.join_s.push_back(MillisecondsSinceNs(vehicle.login_ns) * 1e-3);
}

/// Reports what it passes and does not know.
void CityFleet::LookAround(std::size_t client, const VehicleStep& step) {
  Vehicle& vehicle = vehicles_[client];
  hazards_.Visit(step.east_north_m, kSightM, [&](std::uint32_t hazard) {
    if (!hazards_.IsThere(hazard)) return;
    if (vehicle.knows.size() <= hazard) vehicle.knows.resize(hazards_.size());
    if (vehicle.knows[hazard]) return;
    if (std::uniform_real_distribution<>(0, 1)(random_) > kSeen) return;
    vehicle.knows[hazard] = true;
    SendReport(client, hazard, SystemNs());
  });
}

void CityFleet::SendReport(std::size_t client, std::uint32_t hazard, std::int64_t stamp_ns) {
  Vehicle& vehicle = vehicles_[client];
  protocol::Report report;
  report.uuid = Uuid::Random(random_);
  report.drive_id = "fleet";
  report.stamp_ns = stamp_ns;
  report.class_name = kClass;
  report.confidence = 0.8F;
  report.box = {10, 20, 110, 90};
  report.position = city_.ToGeo(hazards_.PlaceOf(hazard));
  report.covariance_m2 = Eigen::Vector2d(1.0, 1.0).asDiagonal();
  report.image_width = 640;
  report.image_height = 480;
  const std::int64_t now_ns = SteadyNs();
  Waiting& waiting = vehicle.reports[report.uuid];
  waiting = {now_ns, now_ns, Enclose(ros_io::ToMessage(report))};
  last_report_ns_[hazard] = now_ns;
  loop_.Publish(client, vehicle.topics + "report", waiting.payload, 1);
  if (counting_) ++result_.reports;
}

void CityFleet::ResendReports(std::size_t client) {
  Vehicle& vehicle = vehicles_[client];
  const std::int64_t now_ns = SteadyNs();
  for (auto& [uuid, waiting] : vehicle.reports) {
    if (now_ns - waiting.sent_ns < kResendNs) continue;
    waiting.sent_ns = now_ns;
    loop_.Publish(client, vehicle.topics + "report", waiting.payload, 1);
    if (counting_) ++result_.resent;
  }
}

/// Of places that it is at.
void CityFleet::AnswerPolls(std::size_t client, const VehicleStep& step) {
  Vehicle& vehicle = vehicles_[client];
  const std::int64_t now_ns = SystemNs();
  auto& polls = vehicle.polls;
  for (auto poll = polls.begin(); poll != polls.end();) {
    const Eigen::Vector2d place = city_.ToEnu(poll->position);
    const bool is_over = poll->expires_ns < now_ns;
    if (!is_over && (place - step.east_north_m).norm() > kSightM) {
      ++poll;
      continue;
    }
    const auto hazard = hazards_.FindAt(place);
    if (!is_over && hazard) {
      protocol::PollAnswer answer;
      answer.poll = poll->poll;
      answer.hazard = poll->hazard;
      answer.drive_id = "fleet";
      answer.stamp_ns = now_ns;
      answer.answer = hazards_.IsThere(*hazard) ? protocol::PollAnswer::Answer::kYes
                                                : protocol::PollAnswer::Answer::kNo;
      answer.confidence = 0.8F;
      answer.vehicle_position = city_.ToGeo(step.east_north_m);
      answer.course_rad = step.course_rad;
      loop_.Publish(client, vehicle.topics + "answer", Enclose(ros_io::ToMessage(answer)), 1);
      if (counting_) ++result_.poll_answers;
    }
    poll = polls.erase(poll);
  }
}

void CityFleet::OnMessage(std::size_t client, const transport::MqttMessage& message) {
  const Vehicle& vehicle = vehicles_[client];
  if (message.topic.substr(0, vehicle.topics.size()) != vehicle.topics) {
    OnNoticeToAll(client, message);
  } else if (EndsWith(message.topic, "/notice")) {
    OnOwnNotice(client, message);
  } else if (EndsWith(message.topic, "/cell_hazards")) {
    OnCellHazards(client, message);
  } else if (EndsWith(message.topic, "/receipt")) {
    OnReceipt(client, message);
  } else if (EndsWith(message.topic, "/poll")) {
    vehicles_[client].polls.push_back(ros_io::FromMessage(Open<HazardPoll>(message)));
    if (counting_) ++result_.polls;
  }
}

void CityFleet::OnReceipt(std::size_t client, const transport::MqttMessage& message) {
  const protocol::Receipt receipt = ros_io::FromMessage(Open<ReportReceipt>(message));
  auto& reports = vehicles_[client].reports;
  const auto waiting = reports.find(receipt.report_uuid);
  if (waiting == reports.end()) return;
  if (counting_) {
    const bool is_committed = receipt.status == protocol::Receipt::Status::kCommitted;
    ++(is_committed ? result_.committed : result_.refused);
    if (!is_committed && result_.first_refusal.empty()) result_.first_refusal = receipt.reason;
    result_.receipt_ms.push_back(MillisecondsSinceNs(waiting->second.first_sent_ns));
  }
  reports.erase(waiting);
}

/// The announcement in the message; thousands of vehicles hear the same one after the other.
const CityFleet::Announcement& CityFleet::Decode(const transport::MqttMessage& message) {
  for (auto known = announcements_.rbegin(); known != announcements_.rend(); ++known) {
    const std::vector<std::uint8_t>& payload = known->second.payload;
    if (payload.size() == message.payload.size &&
        std::memcmp(payload.data(), message.payload.data, payload.size()) == 0) {
      return known->second;
    }
    if (std::distance(announcements_.rbegin(), known) > 20) break;
  }
  Announcement announcement;
  announcement.payload.assign(message.payload.data, message.payload.data + message.payload.size);
  announcement.notice = ros_io::FromMessage(Open<HazardNotice>(message));
  announcement.hazard = hazards_.FindAt(city_.ToEnu(announcement.notice.position));
  const std::pair key{announcement.notice.sequence,
                      geo::MapCell::At(announcement.notice.position).number()};
  const auto [entry, is_new] = announcements_.emplace(key, std::move(announcement));
  if (!is_new) return entry->second;
  Announcement& added = entry->second;
  if (added.hazard && added.notice.sightings > sightings_[*added.hazard]) {
    sightings_[*added.hazard] = added.notice.sightings;
    added.report_ns = last_report_ns_[*added.hazard];
  }
  if (counting_) ++result_.announcements;
  if (counting_ && added.report_ns != 0) {
    result_.report_ns.emplace(added.notice.sequence, added.report_ns);
  }
  if (announcements_.size() > kKeptAnnouncements) {
    if (announcements_.begin() != entry) announcements_.erase(announcements_.begin());
  }
  return added;
}

/// Or to the vehicles of a cell.
void CityFleet::OnNoticeToAll(std::size_t client, const transport::MqttMessage& message) {
  Vehicle& vehicle = vehicles_[client];
  const Announcement& announcement = Decode(message);
  const bool is_of_cell = !EndsWith(message.topic, "/notice");
  vehicle::NoticeSequenceTracker& chain =
      is_of_cell ? vehicle.cell_chains[geo::MapCell::At(announcement.notice.position).number()]
                 : vehicle.chain;
  chain.Add(announcement.notice.previous_sequence, announcement.notice.sequence);
  Learn(vehicle, announcement.notice, announcement.hazard);
  if (!counting_) return;
  const std::size_t bytes = message.topic.size() + message.payload.size;
  result_.notice_bytes += bytes;
  const VehicleStep& step = StepOf(client);
  const Eigen::Vector2d way = city_.ToEnu(announcement.notice.position) - step.east_north_m;
  if (way.norm() <= kNearM) result_.near_notice_bytes += bytes;
  if (announcement.report_ns == 0) return;
  const double ms = MillisecondsSinceNs(announcement.report_ns);
  result_.notice_ms.push_back(ms);
  const Eigen::Vector2d course(std::sin(step.course_rad), std::cos(step.course_rad));
  if (way.norm() <= kAheadM && way.dot(course) > 0.9 * way.norm()) result_.ahead_ms.push_back(ms);
}

/// As LocalHazardMap takes it, but for its disk.
void CityFleet::OnOwnNotice(std::size_t client, const transport::MqttMessage& message) {
  Vehicle& vehicle = vehicles_[client];
  const protocol::Notice notice = ros_io::FromMessage(Open<HazardNotice>(message));
  if (counting_) result_.told_bytes += message.topic.size() + message.payload.size;
  if (notice.action != protocol::Notice::Action::kCaughtUp) {
    if (counting_) ++result_.told;
    vehicle.told.insert(notice.hazard_uuid);
    return Learn(vehicle, notice, hazards_.FindAt(city_.ToEnu(notice.position)));
  }
  const bool is_whole = vehicle.told.size() >= notice.told;
  vehicle.told.clear();
  const bool began_anew = notice.previous_sequence > notice.sequence;
  if (!is_whole || (notice.previous_sequence > vehicle.chain.known() && !began_anew)) return;
  if (began_anew) {
    vehicle.chain = vehicle::NoticeSequenceTracker(notice.sequence);
  } else {
    vehicle.chain.CloseTo(notice.sequence);
  }
  NoteJoin(vehicle);
}

void CityFleet::Learn(Vehicle& vehicle, const protocol::Notice& notice,
                      std::optional<std::uint32_t> hazard) {
  if (!hazard) return;
  if (vehicle.knows.size() <= *hazard) vehicle.knows.resize(hazards_.size());
  vehicle.knows[*hazard] = notice.action != protocol::Notice::Action::kRemoved;
}

}  // namespace livemap::bench
