#include "simulation/motion/speed_profile.h"

#include <algorithm>
#include <cmath>

namespace livemap::simulation {
namespace {

constexpr double kStepM = 0.5;
constexpr double kStepS = 0.05;
/// What the table holds before time 0 and after the drive.
constexpr double kMarginS = 4;
/// Changes of acceleration spread over this time; even number of steps.
constexpr int kSmoothingSteps = 20;
constexpr double kBreath = 0.1;
constexpr double kBreathS = 14;
/// Half the length of road over which a crossing is driven slowly.
constexpr double kCrossingHalfM = 6;

double Square(double x) { return x * x; }

/// Of the lane, 1/m.
double CurvatureForSpeed(const Street& street, double along) {
  constexpr double kReachM = 2;
  const double turn =
      street.line().HeadingRad(along + kReachM) - street.line().HeadingRad(along - kReachM);
  const double middle = turn / (2 * kReachM);
  return std::abs(middle / (1 - middle * street.lane_left_m()));
}

/// Lowers speeds so that they can be reached from their neighbours.
void BoundSpeedRise(std::vector<double>& squared) {
  constexpr double kMaxPerStep = 2 * kLongitudinalMps2 * kStepM;
  for (std::size_t i = 1; i < squared.size(); ++i) {
    squared[i] = std::min(squared[i], squared[i - 1] + kMaxPerStep);
  }
  for (std::size_t i = squared.size() - 1; i > 0; --i) {
    squared[i - 1] = std::min(squared[i - 1], squared[i] + kMaxPerStep);
  }
}

/// The mean of each entry's surroundings; speeds stay monotone, accelerations within their bound.
std::vector<double> SmoothSpeeds(const std::vector<double>& values) {
  std::vector<double> smooth;
  if (values.size() <= kSmoothingSteps) return values;
  smooth.reserve(values.size());
  for (std::size_t i = 0; i + kSmoothingSteps < values.size(); ++i) {
    // Ends count half: a trapezoid over the whole width.
    double sum = 0.5 * (values[i] + values[i + kSmoothingSteps]);
    for (std::size_t j = 1; j < kSmoothingSteps; ++j) sum += values[i + j];
    smooth.push_back(sum / kSmoothingSteps);
  }
  return smooth;
}

/// Of a monotone cubic between two steps (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984).
double MonotoneSpeedSlope(double before, double after) {
  return before + after > 0 ? 2 * before * after / (before + after) : 0;
}

}  // namespace

SpeedProfile::SpeedProfile(const Street& street, const DrivingStyle& style, double start_m,
                           double phase_rad)
    : style_(style), start_m_(start_m) {
  first_m_ = start_m - 1.2 * style.speed_mps * (kMarginS + 1);
  std::vector<std::size_t> stops;
  std::vector<double> squared = LimitSpeeds(street, phase_rad, stops);
  BoundSpeedRise(squared);
  along_m_ = SmoothSpeeds(Drive(squared, stops));
  // Time 0 is where the start is passed.
  const auto after = std::lower_bound(along_m_.begin(), along_m_.end(), start_m);
  const auto index = std::max<std::ptrdiff_t>(1, after - along_m_.begin());
  const double before_m = along_m_[static_cast<std::size_t>(index - 1)];
  const double step_m = along_m_[static_cast<std::size_t>(index)] - before_m;
  offset_s_ = -kStepS * (static_cast<double>(index - 1) + (start_m - before_m) / step_m);
}

std::vector<double> SpeedProfile::LimitSpeeds(const Street& street, double phase_rad,
                                              std::vector<std::size_t>& stops) const {
  const double end_m = start_m_ + 1.1 * style_.speed_mps * (style_.seconds + 2 * kMarginS) + 20;
  const auto count = static_cast<std::size_t>((end_m - first_m_) / kStepM) + 1;
  const double wave = 2 * M_PI / (kBreathS * style_.speed_mps);
  std::vector<double> squared(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double along = std::max(start_m_, first_m_ + kStepM * static_cast<double>(i));
    const double aim =
        style_.speed_mps * (1 + kBreath * std::sin(wave * (along - start_m_) + phase_rad));
    const double curvature = std::max(CurvatureForSpeed(street, along), 1e-9);
    squared[i] = std::min(Square(aim), kLateralMps2 / curvature);
  }
  LimitAtCrossings(street, end_m, squared, stops);
  return squared;
}

void SpeedProfile::LimitAtCrossings(const Street& street, double end_m,
                                    std::vector<double>& squared,
                                    std::vector<std::size_t>& stops) const {
  std::size_t crossings = 0;
  const int last = static_cast<int>(std::floor(end_m / kBlockM));
  for (int block = static_cast<int>(std::floor(start_m_ / kBlockM)); block <= last; ++block) {
    for (const double at : street.Crossings(block)) {
      // A stop must be ahead, or the drive would begin in it.
      if (at - kStopBeforeM <= start_m_ + 1) continue;
      const auto begin = static_cast<std::size_t>((at - kCrossingHalfM - first_m_) / kStepM);
      const auto end = static_cast<std::size_t>((at + kCrossingHalfM - first_m_) / kStepM) + 1;
      for (std::size_t i = begin; i < std::min(end, squared.size()); ++i) {
        squared[i] = std::min(squared[i], Square(kCrossingShare * style_.speed_mps));
      }
      if (!style_.stops || ++crossings % 2 != 0) continue;
      const auto stop = static_cast<std::size_t>((at - kStopBeforeM - first_m_) / kStepM);
      if (stop >= squared.size()) continue;
      squared[stop] = 0;
      stops.push_back(stop);
    }
  }
}

std::vector<double> SpeedProfile::Drive(const std::vector<double>& squared,
                                        const std::vector<std::size_t>& stops) const {
  // Smoothing takes its width from both ends of a standstill.
  const double wait_s = kStandstillS + kSmoothingSteps * kStepS;
  const double needed_s = style_.seconds + kMarginS + kSmoothingSteps * kStepS;
  std::vector<double> along;
  double time_s = 0;
  std::size_t next_stop = 0;
  double passed_start_s = -1;
  const auto fill = [&](double until_s, double from_m, double speed, double acceleration) {
    while (static_cast<double>(along.size()) * kStepS < until_s) {
      const double t = static_cast<double>(along.size()) * kStepS - time_s;
      along.push_back(from_m + speed * t + 0.5 * acceleration * t * t);
    }
    time_s = until_s;
  };
  for (std::size_t i = 0; i + 1 < squared.size(); ++i) {
    const double from_m = first_m_ + kStepM * static_cast<double>(i);
    if (next_stop < stops.size() && stops[next_stop] == i) {
      fill(time_s + wait_s, from_m, 0, 0);
      ++next_stop;
    }
    const double speed = std::sqrt(squared[i]);
    const double took_s = 2 * kStepM / (speed + std::sqrt(squared[i + 1]));
    fill(time_s + took_s, from_m, speed, 0.5 * (squared[i + 1] - squared[i]) / kStepM);
    if (passed_start_s < 0 && from_m >= start_m_) passed_start_s = time_s;
    if (passed_start_s >= 0 && time_s > passed_start_s + needed_s) break;
  }
  return along;
}

double SpeedProfile::AlongM(double time_s) const {
  const double last = static_cast<double>(along_m_.size() - 2);
  const double index = (time_s - offset_s_) / kStepS;
  if (index < 1 || index >= last) {
    // On at the speed of the table's end.
    const double end = index < 1 ? 1 : last;
    const auto at = static_cast<std::size_t>(end);
    return along_m_[at] + (index - end) * 0.5 * (along_m_[at + 1] - along_m_[at - 1]);
  }
  const auto whole = static_cast<std::size_t>(index);
  const double t = index - static_cast<double>(whole);
  const double* p = &along_m_[whole - 1];
  // A monotone cubic: speed neither jumps nor falls below zero.
  const double slope_a = MonotoneSpeedSlope(p[1] - p[0], p[2] - p[1]);
  const double slope_b = MonotoneSpeedSlope(p[2] - p[1], p[3] - p[2]);
  const double step = p[2] - p[1];
  return p[1] + t * (slope_a +
                     t * ((3 * step - 2 * slope_a - slope_b) + t * (slope_a + slope_b - 2 * step)));
}

double SpeedProfile::SpeedMps(double time_s) const {
  constexpr double kHalfS = 0.01;
  return std::max(0.0, (AlongM(time_s + kHalfS) - AlongM(time_s - kHalfS)) / (2 * kHalfS));
}

double SpeedProfile::AccelerationMps2(double time_s) const {
  constexpr double kHalfS = 0.25;
  return (SpeedMps(time_s + kHalfS) - SpeedMps(time_s - kHalfS)) / (2 * kHalfS);
}

}  // namespace livemap::simulation
