#include "simulation/world/road_line.h"

#include <cmath>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

constexpr double kSampleM = 0.5;

double SmoothRoadTurn(double t) { return t * t * (3 - 2 * t); }

}  // namespace

RoadLine::RoadLine(double bearing_deg, const std::vector<RoadPiece>& pieces) {
  double heading = (90 - bearing_deg) * M_PI / 180;
  double height = 0;
  Eigen::Vector2d place(0, 0);
  samples_.push_back({{0, 0, 0}, heading});
  double piece_start = 0;
  std::size_t next = 1;
  for (const RoadPiece& piece : pieces) {
    const double turn = piece.turn_deg * M_PI / 180;
    const double piece_end = piece_start + piece.length_m;
    for (; static_cast<double>(next) * kSampleM <= piece_end; ++next) {
      const double t = (static_cast<double>(next) * kSampleM - piece_start) / piece.length_m;
      const double middle = std::max(0.0, t - 0.5 * kSampleM / piece.length_m);
      const double heading_between = heading + turn * SmoothRoadTurn(middle);
      place += kSampleM * Eigen::Vector2d(std::cos(heading_between), std::sin(heading_between));
      samples_.push_back({{place.x(), place.y(), height + piece.climb_m * SmoothRoadTurn(t)},
                          heading + turn * SmoothRoadTurn(t)});
    }
    heading += turn;
    height += piece.climb_m;
    piece_start = piece_end;
  }
  length_m_ = piece_start;
}

RoadLine::Sample RoadLine::Interpolate(double along_m) const {
  const double last = static_cast<double>(samples_.size() - 1);
  const double index = along_m / kSampleM;
  if (index <= 0 || index >= last) {
    Sample sample = index <= 0 ? samples_.front() : samples_.back();
    const double beyond = (index <= 0 ? index : index - last) * kSampleM;
    sample.position +=
        beyond * Eigen::Vector3d(std::cos(sample.heading_rad), std::sin(sample.heading_rad), 0);
    return sample;
  }
  const auto whole = static_cast<std::size_t>(index);
  const double part = index - static_cast<double>(whole);
  const Sample& a = samples_[whole];
  const Sample& b = samples_[whole + 1];
  return {a.position + part * (b.position - a.position),
          a.heading_rad + part * (b.heading_rad - a.heading_rad)};
}

Eigen::Vector3d RoadLine::At(double along_m, double left_m, double up_m) const {
  const Sample sample = Interpolate(along_m);
  return sample.position + Eigen::Vector3d(-std::sin(sample.heading_rad) * left_m,
                                           std::cos(sample.heading_rad) * left_m, up_m);
}

double RoadLine::HeadingRad(double along_m) const { return Interpolate(along_m).heading_rad; }

double RoadLine::Slope(double along_m) const {
  return Interpolate(along_m + 0.5).position.z() - Interpolate(along_m - 0.5).position.z();
}

Eigen::Isometry3d RoadLine::Upright(double along_m, double left_m, double up_m) const {
  return Eigen::Translation3d(At(along_m, left_m, up_m)) *
         Eigen::AngleAxisd(HeadingRad(along_m), Eigen::Vector3d::UnitZ());
}

std::vector<RoadPiece> DrawRoad(std::uint64_t seed, double length_m) {
  std::vector<RoadPiece> pieces;
  double drawn_m = 0;
  for (std::uint64_t i = 0; drawn_m < length_m; ++i) {
    CounterRandom random(seed, 1, i);
    RoadPiece piece;
    const bool curve = i % 2 == 1;
    piece.length_m = curve ? random.Uniform(50.0, 90.0) : random.Uniform(50.0, 110.0);
    if (curve) {
      const double most = std::min(40.0, piece.length_m / 70 / 1.5 * 180 / M_PI);
      piece.turn_deg = (random.Chance(0.5) ? 1 : -1) * random.Uniform(0.25, 1.0) * most;
    }
    piece.climb_m = random.Uniform(-0.03, 0.03) * piece.length_m;
    drawn_m += piece.length_m;
    pieces.push_back(piece);
  }
  return pieces;
}

}  // namespace livemap::simulation
