#include "tools/evaluation/alert_trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "common/time.h"
#include "datasets/seeded_random.h"
#include "evaluation/quantile.h"
#include "geo/wgs84.h"
#include "vehicle/positioning/fix_track.h"

namespace livemap::tools {
namespace {

constexpr double kOwnLaneM = 2;       // So near the vehicle's way a hazard lies on it.
constexpr double kNextLaneM = 5.5;    // So near it lies on the same street.
constexpr double kLooksAheadS = 60;   // Of driving: an alert is about what comes until then.
constexpr double kWarmUpS = 15;       // Of driving, at the start: passes do not count.
constexpr double kLeftBehindM = 100;  // Further away an approach has ended.
constexpr std::int64_t kStartNs = 1'700'000'000'000'000'000;
constexpr double kDatumLatitude = 49.2;
constexpr double kDatumLongitude = 7.0;

/// An alert of the kind "approach", until it is passed or cancelled.
struct GivenAlert {
  std::size_t hazard;
  double time_s;
  double cancelled_s = std::numeric_limits<double>::infinity();
};

Uuid IdOfHazard(std::size_t index) {
  Uuid id;
  id.bytes[0] = 1;
  for (std::size_t i = 0; i < 8; ++i) {
    id.bytes[15 - i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(index) >> (8 * i));
  }
  return id;
}

std::size_t IndexOfHazard(const Uuid& id) {
  std::uint64_t index = 0;
  for (std::size_t i = 8; i < 16; ++i) index = index << 8U | id.bytes.at(i);
  return index;
}

/// The direction in which a hazard is passed, as the zone tells it; NaN where it knows none. The
/// same random numbers are drawn whatever the errors are.
double ToldCourse(const TrafficDrive& drive, const TrafficHazard& hazard,
                  const CourseErrors& errors, datasets::SeededRandom& random) {
  const bool is_none = random.Uniform() < errors.none_share;
  const double wrong_draw = random.Uniform();
  const bool is_oncoming = random.Uniform() < errors.oncoming_share;
  const double any_rad = 2 * M_PI * random.Uniform();
  const double noise_rad = errors.sigma_deg * M_PI / 180 * random.Normal().x();
  if (is_none) return std::numeric_limits<double>::quiet_NaN();
  const bool is_at_junction = std::any_of(
      drive.junctions_m.begin(), drive.junctions_m.end(), [&](const Eigen::Vector2d& junction_m) {
        return (junction_m - hazard.place_m).norm() < kAtJunctionM;
      });
  double course_rad = hazard.course_rad;
  if (is_oncoming && std::isfinite(hazard.oncoming_course_rad)) {
    course_rad = hazard.oncoming_course_rad;
  }
  if (is_at_junction && wrong_draw < errors.wrong_share) {
    course_rad += any_rad < M_PI ? M_PI / 2 : -M_PI / 2;
  } else if (!is_at_junction && wrong_draw < 0.1 * errors.wrong_share) {
    course_rad = any_rad;
  }
  return std::remainder(course_rad + noise_rad, 2 * M_PI);
}

/// How fast vehicles drive at a point of a line that has one every metre or five.
double CornerSpeedMps(const std::vector<Eigen::Vector2d>& line_m, std::size_t at) {
  constexpr double kSideways = 2.2;
  if (at < 4 || at + 4 >= line_m.size()) return 30;
  const Eigen::Vector2d in = line_m[at] - line_m[at - 4];
  const Eigen::Vector2d out = line_m[at + 4] - line_m[at];
  const double sine = in.x() * out.y() - in.y() * out.x();
  const double turn_rad = std::abs(std::atan2(sine, in.dot(out)));
  const double way_m = 0.5 * (in.norm() + out.norm());
  return std::max(4.0, std::sqrt(kSideways * way_m / std::max(1e-6, turn_rad)));
}

/// What the driver is told on a drive.
class AlertRun {
 public:
  AlertRun(const TrafficDrive& drive, const AlertTrial& trial,
           const vehicle::DriverAlerts::Config& config, const protocol::HazardCatalogue& catalogue)
      : drive_(drive),
        trial_(trial),
        frame_({kDatumLatitude, kDatumLongitude}),
        alerts_(config, catalogue, MapOf(drive, trial)) {
    datasets::SeededRandom random(trial.seed * 7919 + 1);
    datasets::SeededRandom courses(trial.seed * 7919 + 5);
    datasets::SeededRandom trails(trial.seed * 7919 + 6);
    for (std::size_t i = 0; i < drive.hazards.size(); ++i) {
      const Eigen::Vector2d told_m =
          drive.hazards[i].place_m + trial.place_sigma_m * random.Normal();
      alerts_.Put({IdOfHazard(i), drive.hazards[i].class_name, frame_.ToGeo(told_m),
                   trial.place_sigma_m, std::nullopt,
                   ToldCourse(drive, drive.hazards[i], trial.course_errors, courses),
                   ToldTrails(drive.hazards[i], trial.trail_errors, trails)});
    }
  }

  std::vector<GivenAlert> Drive() {
    datasets::GnssReceiverModel receiver(trial_.receiver, trial_.seed * 7919 + 2);
    datasets::SeededRandom random(trial_.seed * 7919 + 4);
    vehicle::FixTrack track{vehicle::FixTrack::Config()};
    const auto every =
        std::max(1, static_cast<int>(std::lround(1 / (trial_.fixes_per_s * kTrafficStepS))));
    for (std::size_t i = 0; i < drive_.moments.size(); i += static_cast<std::size_t>(every)) {
      const TrafficMoment& moment = drive_.moments[i];
      const auto error_m = receiver.ErrorAt(moment.time_s);
      if (!error_m) continue;
      geo::Fix fix;
      fix.stamp_ns = kStartNs + Nanoseconds(moment.time_s);
      fix.position = frame_.ToGeo(moment.place_m + *error_m);
      fix.covariance_m2 = receiver.sigma_m() * receiver.sigma_m() * Eigen::Matrix2d::Identity();
      const auto verdict = track.Add(fix);
      if (verdict != vehicle::FixTrack::Verdict::kAccepted || track.newest_ns() != fix.stamp_ns) {
        continue;
      }
      if (trial_.velocity_sigma_mps > 0) {
        alerts_.AddVelocity(fix.stamp_ns,
                            {VelocityAt(i) + trial_.velocity_sigma_mps * random.Normal(),
                             trial_.velocity_sigma_mps});
      }
      const auto told = alerts_.Add(fix.stamp_ns, *track.Newest());
      for (const vehicle::HazardAlert& alert : told) Note(alert, moment.time_s + trial_.latency_s);
    }
    return given_;
  }

 private:
  /// How vehicles passed the hazard, as the zone tells it: their positions once a second.
  std::vector<protocol::Trail> ToldTrails(const TrafficHazard& hazard, const TrailErrors& errors,
                                          datasets::SeededRandom& random) const {
    std::vector<protocol::Trail> told;
    for (std::size_t i = 0; i < hazard.trails_m.size(); ++i) {
      const bool is_none = random.Uniform() < errors.none_share;
      const bool is_oncoming = random.Uniform() < errors.oncoming_share;
      const double usual_mps = 8 + 6 * random.Uniform();
      const Eigen::Vector2d bias_m = errors.bias_m * random.Normal();
      const auto& true_m = is_oncoming && !hazard.oncoming_trails_m.empty()
                               ? hazard.oncoming_trails_m[i]
                               : hazard.trails_m[i];
      protocol::Trail trail;
      double left_m = 0;
      for (std::size_t k = true_m.size(); k-- > 0;) {
        if (k + 1 < true_m.size()) left_m -= (true_m[k + 1] - true_m[k]).norm();
        if (left_m > 0) continue;
        left_m += std::min(usual_mps, CornerSpeedMps(true_m, k));  // Of one second.
        trail.push_back(frame_.ToGeo(true_m[k] + bias_m + errors.scatter_m * random.Normal()));
      }
      std::reverse(trail.begin(), trail.end());
      if (!is_none && i < errors.trails && trail.size() > 1) {
        told.push_back(protocol::SimplifiedTrail(trail));
      }
    }
    return told;
  }

  std::shared_ptr<const streets::StreetMap> MapOf(const TrafficDrive& drive,
                                                  const AlertTrial& trial) const {
    if (!trial.streets) return nullptr;
    return DrawStreetMap(drive.streets, drive.junctions_m, frame_, trial.map_errors,
                         trial.seed * 7919 + 3);
  }

  /// The true one in the last step before a moment, as a receiver has it: nothing of what comes.
  Eigen::Vector2d VelocityAt(std::size_t i) const {
    if (i == 0) return Eigen::Vector2d::Zero();
    return (drive_.moments[i].place_m - drive_.moments[i - 1].place_m) / kTrafficStepS;
  }

  void Note(const vehicle::HazardAlert& alert, double time_s) {
    const std::size_t hazard = IndexOfHazard(alert.id);
    if (alert.state == vehicle::HazardAlert::State::kApproach) {
      given_.push_back({hazard, time_s});
    } else if (alert.state == vehicle::HazardAlert::State::kCancelled) {
      for (GivenAlert& each : given_) {
        if (each.hazard == hazard) each.cancelled_s = std::min(each.cancelled_s, time_s);
      }
    }
  }

  const TrafficDrive& drive_;
  const AlertTrial& trial_;
  geo::LocalFrame frame_;
  vehicle::DriverAlerts alerts_;
  std::vector<GivenAlert> given_;
};

/// Moments at which the vehicle passes a hazard on its way.
std::vector<const TrafficMoment*> PassesOf(const TrafficHazard& hazard,
                                           const std::vector<TrafficMoment>& moments) {
  std::vector<const TrafficMoment*> passes;
  if (hazard.other_level) return passes;
  const TrafficMoment* nearest = nullptr;
  double nearest_m = 0;
  for (const TrafficMoment& moment : moments) {
    const double distance_m = (moment.place_m - hazard.place_m).norm();
    if (distance_m > kOwnLaneM + 3) {
      if (nearest != nullptr && nearest_m <= kOwnLaneM) passes.push_back(nearest);
      nearest = nullptr;
    } else if (nearest == nullptr || distance_m < nearest_m) {
      nearest = &moment;
      nearest_m = distance_m;
    }
  }
  return passes;
}

/// The moment in `moments`, which are evenly spaced, at a time.
std::size_t IndexAt(const std::vector<TrafficMoment>& moments, double time_s) {
  const auto index = static_cast<std::size_t>(std::max(0.0, time_s / kTrafficStepS));
  return std::min(index, moments.size() - 1);
}

/// How near the vehicle comes in the time that an alert is about, m.
double NearestAfter(const GivenAlert& given, const TrafficHazard& hazard,
                    const std::vector<TrafficMoment>& moments) {
  double nearest_m = std::numeric_limits<double>::infinity();
  const std::size_t first = IndexAt(moments, given.time_s);
  for (std::size_t i = first; i < moments.size(); ++i) {
    if (moments[i].moving_s - moments[first].moving_s > kLooksAheadS) break;
    nearest_m = std::min(nearest_m, (moments[i].place_m - hazard.place_m).norm());
  }
  return nearest_m;
}

/// Whether the vehicle stayed near the hazard from one alert to the next.
bool SameApproach(const GivenAlert& first, const GivenAlert& second, const TrafficHazard& hazard,
                  const std::vector<TrafficMoment>& moments) {
  for (std::size_t i = IndexAt(moments, first.time_s); i <= IndexAt(moments, second.time_s); ++i) {
    if ((moments[i].place_m - hazard.place_m).norm() > kLeftBehindM) return false;
  }
  return true;
}

std::string ShareText(std::size_t part, std::size_t whole) {
  if (whole == 0) return "-";
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3f",
                static_cast<double>(part) / static_cast<double>(whole));
  return text.data();
}

nlohmann::ordered_json ShareOrNull(std::size_t part, std::size_t whole) {
  if (whole == 0) return nullptr;
  return static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

void AlertFigures::Add(const AlertFigures& other) {
  drives += other.drives;
  hours += other.hours;
  on_way += other.on_way;
  early += other.early;
  late += other.late;
  alerts += other.alerts;
  false_alerts += other.false_alerts;
  beside += other.beside;
  doubles += other.doubles;
  leads_s.insert(leads_s.end(), other.leads_s.begin(), other.leads_s.end());
}

AlertFigures TryAlerts(const TrafficDrive& drive, const AlertTrial& trial,
                       const vehicle::DriverAlerts::Config& config,
                       const protocol::HazardCatalogue& catalogue) {
  const std::vector<GivenAlert> given = AlertRun(drive, trial, config, catalogue).Drive();
  const std::vector<TrafficMoment>& moments = drive.moments;
  AlertFigures figures;
  figures.drives = 1;
  figures.hours = moments.back().time_s / 3600;
  std::map<std::size_t, std::vector<GivenAlert>> of_hazard;
  for (const GivenAlert& each : given) of_hazard[each.hazard].push_back(each);
  for (std::size_t i = 0; i < drive.hazards.size(); ++i) {
    const TrafficHazard& hazard = drive.hazards[i];
    const auto alerts = of_hazard.find(i);
    double before_s = -1;  // The pass before.
    for (const TrafficMoment* pass : PassesOf(hazard, moments)) {
      if (pass->moving_s < kWarmUpS) continue;
      ++figures.on_way;
      std::optional<double> lead_s;
      if (alerts != of_hazard.end()) {
        for (const GivenAlert& each : alerts->second) {
          const bool counts = each.time_s > before_s && each.time_s <= pass->time_s &&
                              each.cancelled_s > pass->time_s;
          if (counts && !lead_s) lead_s = pass->time_s - each.time_s;
        }
      }
      before_s = pass->time_s;
      if (!lead_s) continue;
      figures.leads_s.push_back(*lead_s);
      ++(*lead_s >= kWantedLeadS ? figures.early : figures.late);
    }
    if (alerts == of_hazard.end()) continue;
    for (std::size_t k = 0; k < alerts->second.size(); ++k) {
      const GivenAlert& each = alerts->second[k];
      ++figures.alerts;
      const double nearest_m = NearestAfter(each, hazard, moments);
      if (hazard.other_level || nearest_m > kNextLaneM) {
        ++figures.false_alerts;
      } else if (nearest_m > kOwnLaneM) {
        ++figures.beside;
      }
      if (k > 0 && SameApproach(alerts->second[k - 1], each, hazard, moments)) ++figures.doubles;
    }
  }
  return figures;
}

nlohmann::ordered_json ToJson(const AlertFigures& figures) {
  const auto lead = [&](double fraction) -> nlohmann::ordered_json {
    if (figures.leads_s.empty()) return nullptr;
    return evaluation::Quantile(figures.leads_s, fraction);
  };
  nlohmann::ordered_json json;
  json["drives"] = figures.drives;
  json["hours"] = figures.hours;
  json["on_way"] = figures.on_way;
  json["early"] = figures.early;
  json["early_share"] = ShareOrNull(figures.early, figures.on_way);
  json["late"] = figures.late;
  json["missed"] = figures.on_way - figures.early - figures.late;
  json["alerts"] = figures.alerts;
  json["false_alerts"] = figures.false_alerts;
  json["false_per_hour"] = nullptr;
  if (figures.hours > 0) {
    json["false_per_hour"] = static_cast<double>(figures.false_alerts) / figures.hours;
  }
  json["beside"] = figures.beside;
  json["doubles"] = figures.doubles;
  json["lead_p5_s"] = lead(0.05);
  json["lead_p50_s"] = lead(0.5);
  json["lead_p95_s"] = lead(0.95);
  return json;
}

std::string HeadOfAlertTable() {
  return "scenario       hours  on way  early share  late  missed  false  false/h  beside  doubles "
         " "
         "lead p5/p50/p95, s\n";
}

std::string ToRow(const std::string& name, const AlertFigures& figures) {
  std::array<char, 256> text{};
  const bool led = !figures.leads_s.empty();
  std::snprintf(text.data(), text.size(),
                "%-13s %6.2f  %6zu  %11s  %4zu  %6zu  %5zu  %7.2f  %6zu  %7zu  ", name.c_str(),
                figures.hours, figures.on_way, ShareText(figures.early, figures.on_way).c_str(),
                figures.late, figures.on_way - figures.early - figures.late, figures.false_alerts,
                figures.hours > 0 ? static_cast<double>(figures.false_alerts) / figures.hours : 0,
                figures.beside, figures.doubles);
  std::string row = text.data();
  if (!led) return row + "-\n";
  std::snprintf(
      text.data(), text.size(), "%.1f/%.1f/%.1f\n", evaluation::Quantile(figures.leads_s, 0.05),
      evaluation::Quantile(figures.leads_s, 0.5), evaluation::Quantile(figures.leads_s, 0.95));
  return row + text.data();
}

}  // namespace livemap::tools
