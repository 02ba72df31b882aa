// livemap_evaluate_placement: how well many vehicles together place a hazard.

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "common/error.h"
#include "common/time.h"
#include "datasets/seeded_random.h"
#include "datasets/sensors/gnss_multipath.h"
#include "datasets/sensors/gnss_receiver_model.h"
#include "datasets/sensors/wheel_odometer_model.h"
#include "evaluation/quantile.h"
#include "localization/geo_localizer.h"
#include "tools/common/command_line.h"
#include "vehicle/reporting/hazard_reporter.h"
#include "zone/registry/hazard_registry.h"

namespace livemap::tools {
namespace {

constexpr geo::GeoPoint kHazard{48.13, 11.57};
constexpr std::array<int, 5> kFleets = {1, 2, 5, 10, 20};
constexpr std::int64_t kFirstNs = 1'700'000'000'000'000'000;
constexpr double kImageHz = 10;
constexpr double kBlockM = 30;  // Of houses.
constexpr int kBlocks = 16;
constexpr double kApproachM = 150;  // Driven before the hazard, by one half more or less.
constexpr double kBeyondM = 15;
constexpr double kNodTimeS = 0.5;
constexpr char kOpticalFrame[] = "camera_optical_frame";
constexpr char kClass[] = "pothole";

struct Options {
  bool json = false;
  std::uint64_t first_seed = 1;
  int seeds = 20;
  double multipath_m = 2;
  double fix_noise_m = 0.5;
  double fix_rate_hz = 5;
  double pixel_sigma_px = 2;
  double nod_sigma_rad = 0.003;
  double mounting_sigma_rad = 0.003;
  vehicle::HazardReporter::Config reporter;
  localization::LocalizerConfig localizer;
};

std::optional<Options> ParseEvaluatePlacementOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_placement [FLAGS]",
      "Simulates vehicles that pass a hazard, each with a receiver, wheel odometry and a camera of "
      "its\n"
      "own, and fuses their reports as the zone does. Prints the error of the hazard's place after "
      "1, 2,\n"
      "5, 10 and 20 vehicles. docs/reference/measures.md defines the figures.",
      0,
      {{"json", "", "one line of JSON instead of a table"},
       {"seed", "N", "of the first street, default 1"},
       {"seeds", "N", "streets with a hazard each, default 20"},
       {"multipath-m", "M", "reflections in the street, see GnssMultipath, default 2; 0: open sky"},
       {"fix-noise-m", "M", "receiver's white noise, sigma per axis, default 0.5"},
       {"fix-rate", "HZ", "fixes per second, 1 to 10, default 5"},
       {"positions", "SOURCE", "gps or fused, default fused"},
       {"sights", "N", "sights of a pass that count, 1 to 100, default 24"},
       {"settle-s", "S", "how long a report waits for further sights, default 1.5"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.json = line.Has("json");
  options.first_seed = line.Seed("seed", options.first_seed);
  options.seeds = line.Whole("seeds", options.seeds, 1, 100000);
  options.multipath_m = line.Number("multipath-m", options.multipath_m, 0, 100);
  options.fix_noise_m = line.Number("fix-noise-m", options.fix_noise_m, 0.01, 100);
  options.fix_rate_hz = line.Number("fix-rate", options.fix_rate_hz, 1, 10);
  const std::string positions = line.Text("positions", "fused");
  if (positions != "gps" && positions != "fused") {
    throw Error("--positions is '" + positions + "', accepted are gps and fused");
  }
  vehicle::HazardReporter::Config& reporter = options.reporter;
  reporter.position_source =
      positions == "fused" ? vehicle::PositionSource::kFused : vehicle::PositionSource::kFixes;
  reporter.passes.sights.max_sights =
      line.Whole("sights", reporter.passes.sights.max_sights, 1, 100);
  reporter.settle_wait_s = line.Number("settle-s", reporter.settle_wait_s, 0, 60);
  reporter.image_wait_s = 0;
  // As the tables of docs/results/localization.md were made: the simulated receiver stamps its
  // measurements, and does not see its reflections.
  localization::ReceiverModel& receiver = options.localizer.receiver;
  receiver.latency_s = receiver.latency_sigma_s = 0;
  receiver.min_sigma_m = 2;
  receiver.shared_sigma_m = 1.5;
  receiver.shared_time_s = 5;
  options.localizer.start_yaw_sigma_rad = 0.08;
  return options;
}

/// A straight street through the hazard, with houses on both sides.
class PlacementStreet {
 public:
  PlacementStreet(std::uint64_t seed, bool has_houses) : random_(seed) {
    heading_rad_ = 2 * M_PI * random_.Uniform();
    for (datasets::SkyVisibility& block : blocks_) {
      if (has_houses) block = {random_.Uniform(), random_.Uniform()};
    }
  }

  /// Counter-clockwise from east.
  double heading_rad() const { return heading_rad_; }
  /// `along_m` before (< 0) or after the hazard; for one who drives that way.
  datasets::SkyVisibility SkyAt(double along_m, bool is_reverse) const {
    const double place_m = (is_reverse ? -along_m : along_m) + 0.5 * kBlocks * kBlockM;
    const int block = std::clamp(static_cast<int>(place_m / kBlockM), 0, kBlocks - 1);
    const datasets::SkyVisibility& sky = blocks_.at(static_cast<std::size_t>(block));
    return is_reverse ? datasets::SkyVisibility{sky.right_rad, sky.left_rad} : sky;
  }

 private:
  datasets::SeededRandom random_;
  double heading_rad_ = 0;
  std::array<datasets::SkyVisibility, kBlocks> blocks_{};
};

/// One vehicle's way past the hazard.
class PlacementPass {
 public:
  PlacementPass(const Options& options, const PlacementStreet& street, std::uint64_t seed,
                const std::string& database)
      : options_(options),
        street_(street),
        random_(seed),
        is_reverse_(random_.Uniform() < 0.5),
        speed_mps_(6 + 8 * random_.Uniform()),
        start_m_(-kApproachM * (0.75 + 0.5 * random_.Uniform())),
        left_m_(6 * random_.Uniform() - 3),
        receiver_({options.fix_noise_m}, seed + 1),
        multipath_(options.multipath_m, seed + 2),
        wheels_(seed + 3),
        localizer_(options.localizer) {
    heading_rad_ = street.heading_rad() + (is_reverse_ ? M_PI : 0);
    mounting_.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    mounting_.translation() = Eigen::Vector3d(1.5, 0, 1.45);
    true_mounting_ = mounting_;
    const Eigen::Vector2d mounting = random_.Normal();
    true_mounting_.translation().z() += options.reporter.projection.height_sigma_m * mounting.x();
    mounting_pitch_rad_ = options.mounting_sigma_rad * mounting.y();
    vehicle::HazardReporter::Config config = options.reporter;
    config.map.path = database;
    reporter_ = std::make_unique<vehicle::HazardReporter>(config, protocol::HazardCatalogue(),
                                                          std::mt19937_64(seed), kFirstNs, 0.0);
    reporter_->SetIntrinsics(kCamera);
    reporter_->SetMounting(kOpticalFrame, mounting_);
  }

  std::vector<protocol::Report> Drive() {
    const int images = static_cast<int>((kBeyondM - start_m_) / speed_mps_ * kImageHz);
    for (int i = 0; i < images; ++i) Step(i / kImageHz);
    const double end_s = images / kImageHz;
    reporter_->Process(end_s + 10, end_s + 10);
    return reporter_->TakeDue(end_s + 10, 100);
  }

 private:
  static constexpr geo::CameraIntrinsics kCamera{493, 493, 319.5, 199.5, 640, 400};

  static std::int64_t StampNs(double time_s) { return kFirstNs + Nanoseconds(time_s); }
  double AlongM(double time_s) const { return start_m_ + speed_mps_ * time_s; }
  /// Of base_link, east-north from the hazard, which lies left_m_ beside the way.
  Eigen::Vector2d PlaceM(double time_s) const {
    const Eigen::Vector2d forward(std::cos(heading_rad_), std::sin(heading_rad_));
    return AlongM(time_s) * forward - left_m_ * Eigen::Vector2d(-forward.y(), forward.x());
  }

  void Step(double time_s) {
    AddOdometry(time_s);
    if (time_s >= next_fix_s_ - 1e-9) {
      next_fix_s_ += 1 / options_.fix_rate_hz;
      AddFix(time_s);
    }
    AddPose(time_s);
    AddImage(time_s);
    reporter_->Process(Seconds(StampNs(time_s)), time_s);
  }

  void AddOdometry(double time_s) {
    const datasets::WheelTwist twist = wheels_.Measure(speed_mps_, 0);
    const double dt_s = 1 / kImageHz;
    yaw_rad_ += twist.yaw_rate_radps * dt_s;
    way_m_ += twist.speed_mps * dt_s * Eigen::Vector2d(std::cos(yaw_rad_), std::sin(yaw_rad_));
    Eigen::Isometry3d odom = Eigen::Isometry3d::Identity();
    odom.translation().head<2>() = way_m_;
    odom.linear() = Eigen::AngleAxisd(yaw_rad_, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    localizer_.AddOdometry(StampNs(time_s), odom);
  }

  void AddFix(double time_s) {
    const auto error_m = receiver_.ErrorAt(time_s);
    const Eigen::Vector2d reflections_m = multipath_.ErrorAt(
        time_s, speed_mps_ * time_s, heading_rad_, street_.SkyAt(AlongM(time_s), is_reverse_));
    if (!error_m) return;
    geo::Fix fix;
    fix.stamp_ns = StampNs(time_s);
    fix.position = frame_.ToGeo(PlaceM(time_s) + *error_m + reflections_m);
    const double sigma_m = receiver_.sigma_m();
    fix.covariance_m2 = Eigen::Matrix2d::Identity() * (sigma_m * sigma_m);
    reporter_->AddFix(fix);
    localizer_.AddFix(fix);
  }

  void AddPose(double time_s) {
    const auto fused = localizer_.Fused(StampNs(time_s));
    if (!fused || fused->state == localization::LocalizerState::kUninitialised) return;
    geo::TrackPose pose;
    pose.position = fused->position;
    pose.covariance_m2 = fused->covariance_m2;
    pose.course_rad = fused->heading_rad;
    pose.course_variance_rad2 = fused->heading_variance_rad2;
    pose.speed_mps = speed_mps_;
    // Courses count clockwise, yaws counter-clockwise.
    pose.position_course = -fused->map_covariance.topRightCorner<2, 1>();
    reporter_->AddPose(StampNs(time_s), pose);
  }

  /// The box of a thing half a metre wide; none where the camera does not see its foot.
  void AddImage(double time_s) {
    const double keep = std::exp(-1 / kImageHz / kNodTimeS);
    const Eigen::Vector2d random = random_.Normal();
    nod_rad_ = keep * nod_rad_ + std::sqrt(1 - keep * keep) * options_.nod_sigma_rad * random.x();
    Eigen::Isometry3d camera = true_mounting_;
    camera.linear() = Eigen::AngleAxisd(nod_rad_ + mounting_pitch_rad_, Eigen::Vector3d::UnitY()) *
                      true_mounting_.linear();
    const Eigen::Vector3d in_base_m(-AlongM(time_s), left_m_, 0);
    const Eigen::Vector3d optical_m = camera.inverse() * in_base_m;
    const Eigen::Vector2d noise_px = options_.pixel_sigma_px * random_.Normal();
    if (optical_m.z() < 1) return;
    const double u = kCamera.fx * optical_m.x() / optical_m.z() + kCamera.cx + 0.5 + noise_px.x();
    const double v = kCamera.fy * optical_m.y() / optical_m.z() + kCamera.cy + 0.5 + noise_px.y();
    const double half_px = 0.25 * kCamera.fx / optical_m.z();
    if (u - half_px < 2 || u + half_px > kCamera.width - 2 || v > kCamera.height - 2) return;
    placement::Sighting sighting;
    sighting.class_name = kClass;
    sighting.confidence = 0.8F;
    sighting.box = {static_cast<float>(u - half_px), static_cast<float>(v - half_px),
                    static_cast<float>(u + half_px), static_cast<float>(v)};
    reporter_->AddFrame({StampNs(time_s), kOpticalFrame, 640, 400, {sighting}},
                        Seconds(StampNs(time_s)));
  }

  const Options& options_;
  const PlacementStreet& street_;
  datasets::SeededRandom random_;
  bool is_reverse_;
  double speed_mps_;
  double start_m_;
  double left_m_;
  datasets::GnssReceiverModel receiver_;
  datasets::GnssMultipath multipath_;
  datasets::WheelOdometerModel wheels_;
  localization::GeoLocalizer localizer_;
  geo::LocalFrame frame_{kHazard};
  double heading_rad_ = 0;
  Eigen::Isometry3d mounting_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d true_mounting_ = Eigen::Isometry3d::Identity();
  double mounting_pitch_rad_ = 0;
  double nod_rad_ = 0;
  double next_fix_s_ = 0;
  double yaw_rad_ = 0;
  Eigen::Vector2d way_m_ = Eigen::Vector2d::Zero();
  std::unique_ptr<vehicle::HazardReporter> reporter_;
};

/// Of all reports of all vehicles, each for itself.
struct ReportFigures {
  std::vector<double> errors_m;
  std::vector<double> nees;

  void Note(const protocol::Report& report) {
    const Eigen::Vector2d error_m = geo::LocalFrame(kHazard).ToEnu(report.position);
    errors_m.push_back(error_m.norm());
    nees.push_back(error_m.dot(report.covariance_m2.inverse() * error_m));
  }
};

/// Of all streets, after so many vehicles.
struct FleetFigures {
  std::vector<double> errors_m;
  std::vector<double> nees;
  double hazards = 0;  // On the map.
};

/// A vehicle's reports as ReportIntake merges them, all of it believed.
void MergePlacementReports(const std::vector<protocol::Report>& reports,
                           zone::HazardRegistry& registry, std::uint64_t& sequence) {
  std::vector<zone::HazardRegistry::Slot> seen;
  for (const protocol::Report& report : reports) {
    const auto slot = registry.FindMatch(report.class_name, report.position);
    if (!slot) {
      seen.push_back(registry.Add(report, {}, report.uuid, ++sequence, kFirstNs));
      continue;
    }
    const bool is_further = std::find(seen.begin(), seen.end(), *slot) != seen.end();
    registry.Merge(*slot, report, {}, ++sequence, kFirstNs,
                   is_further ? zone::SightingSays::kWhen : zone::SightingSays::kWhere);
    seen.push_back(*slot);
  }
}

void NoteFigures(const zone::HazardRegistry& registry, FleetFigures& figures) {
  figures.hazards += static_cast<double>(registry.size());
  const geo::LocalFrame frame(kHazard);
  std::optional<zone::Hazard> best;
  for (zone::HazardRegistry::Slot slot = 0; slot < registry.size(); ++slot) {
    const zone::Hazard hazard = registry.Get(slot);
    const bool is_nearer =
        !best || frame.ToEnu(hazard.position).norm() < frame.ToEnu(best->position).norm();
    if (is_nearer) best = hazard;
  }
  if (!best) return;
  const Eigen::Vector2d error_m = frame.ToEnu(best->position);
  figures.errors_m.push_back(error_m.norm());
  figures.nees.push_back(error_m.dot(best->covariance_m2.inverse() * error_m));
}

struct PlacementFigures {
  ReportFigures reports;
  std::array<FleetFigures, kFleets.size()> fleets;
};

void EvaluateStreet(const Options& options, std::uint64_t seed, const std::string& folder,
                    PlacementFigures& figures) {
  const PlacementStreet street(seed, options.multipath_m > 0);
  zone::HazardRegistry registry(protocol::HazardCatalogue(), seed);
  std::uint64_t sequence = 0;
  std::size_t fleet = 0;
  for (int vehicle = 1; vehicle <= kFleets.back(); ++vehicle) {
    const std::string database = folder + "/" + std::to_string(vehicle) + ".sqlite3";
    const std::uint64_t vehicle_seed = seed * 1000 + static_cast<std::uint64_t>(vehicle) * 10;
    {
      PlacementPass pass(options, street, vehicle_seed, database);
      const std::vector<protocol::Report> reports = pass.Drive();
      for (const protocol::Report& report : reports) figures.reports.Note(report);
      MergePlacementReports(reports, registry, sequence);
    }
    for (const char* end : {"", "-wal", "-shm"}) std::filesystem::remove(database + end);
    if (vehicle != kFleets.at(fleet)) continue;
    NoteFigures(registry, figures.fleets.at(fleet));
    ++fleet;
  }
}

double MeanOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double RmsOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

void PutErrors(const std::vector<double>& errors_m, const std::vector<double>& nees,
               nlohmann::ordered_json& row) {
  const auto figure = [&](double value) {
    return errors_m.empty() ? nlohmann::json(nullptr) : nlohmann::json(value);
  };
  row["n"] = errors_m.size();
  row["error_rms_m"] = figure(RmsOf(errors_m));
  row["error_median_m"] = figure(evaluation::Quantile(errors_m, 0.5));
  row["error_p95_m"] = figure(evaluation::Quantile(errors_m, 0.95));
  row["nees_mean"] = figure(MeanOf(nees));
}

nlohmann::ordered_json ToJson(const Options& options, const PlacementFigures& figures) {
  nlohmann::ordered_json json;
  json["streets"] = options.seeds;
  PutErrors(figures.reports.errors_m, figures.reports.nees, json["reports"]);
  json["reports"]["per_pass"] =
      static_cast<double>(figures.reports.errors_m.size()) / (options.seeds * kFleets.back());
  for (std::size_t i = 0; i < kFleets.size(); ++i) {
    const FleetFigures& of_fleet = figures.fleets.at(i);
    nlohmann::ordered_json row;
    row["vehicles"] = kFleets.at(i);
    PutErrors(of_fleet.errors_m, of_fleet.nees, row);
    row["hazards_per_street"] = of_fleet.hazards / options.seeds;
    json["fleets"].push_back(row);
  }
  return json;
}

std::string ToText(const nlohmann::ordered_json& json) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2);
  const auto figure = [&](const nlohmann::ordered_json& row, const char* key, int width) {
    text << std::setw(width);
    if (row[key].is_null()) {
      text << "-";
    } else {
      text << row[key].get<double>();
    }
  };
  const auto errors = [&](const nlohmann::ordered_json& row) {
    text << std::setw(6) << row["n"].get<int>();
    figure(row, "error_rms_m", 7);
    figure(row, "error_median_m", 10);
    figure(row, "error_p95_m", 8);
    figure(row, "nees_mean", 7);
  };
  text << "vehicles     n  rms m  median m  95 % m   NEES  hazards per street\n";
  for (const auto& row : json["fleets"]) {
    text << std::setw(8) << row["vehicles"].get<int>();
    errors(row);
    figure(row, "hazards_per_street", 20);
    text << "\n";
  }
  text << "a report";
  errors(json["reports"]);
  text << "  (";
  figure(json["reports"], "per_pass", 0);
  text << " per pass)\n";
  return text.str();
}

int EvaluatePlacement(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluatePlacementOptions(argc, argv);
  if (!options) return 0;
  std::string folder =
      (std::filesystem::temp_directory_path() / "livemap_placement_XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw Error("no temporary folder '" + folder + "'");
  PlacementFigures figures;
  for (int i = 0; i < options->seeds; ++i) {
    EvaluateStreet(*options, options->first_seed + static_cast<std::uint64_t>(i), folder, figures);
  }
  std::filesystem::remove_all(folder);
  const nlohmann::ordered_json json = ToJson(*options, figures);
  std::cout << (options->json ? json.dump() + "\n" : ToText(json));
  if (!figures.fleets.back().errors_m.empty()) return 0;
  SayNothingMeasured("livemap_evaluate_placement", "no vehicle reported the hazard");
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_placement", argc, argv,
                                    livemap::tools::EvaluatePlacement);
}
