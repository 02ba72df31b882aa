#include "recordings/clock/clock_offset.h"

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/checks.h"
#include "common/time.h"
#include "recordings/clock/receiver_motion.h"

namespace livemap::recordings {
namespace {

constexpr double kGridS = 0.05;
/// Steps of the grid to both sides through which the parabola goes.
constexpr int kParabolaSteps = 6;
constexpr std::size_t kMinPictures = 50;
/// Of the pictures, how many must lie within the track at an offset that is tried.
constexpr double kMinOverlap = 0.6;
/// A weaker relation may be chance.
constexpr double kMinCorrelation = 0.5;
/// What the picture's motion errs alike all the time is no noise: no offset is surer.
constexpr double kFloorSigmaS = 0.03;
/// Another offset this far away is another answer.
constexpr double kOtherOffsetS = 2;
/// By how much it must be less likely: as three standard deviations are.
constexpr double kMinLead = 9;
/// Below this speed a vehicle is nearly standing.
constexpr double kStandingMps = 1.5;
/// Pictures are smoothed about as much as the receiver's motion is by its polynomials.
constexpr double kPictureSmoothing = 0.8;
/// Of positions beside those that the search reaches, for smoothing.
constexpr double kTrackMarginS = 10;
constexpr int kRounds = 3;

/// 0 at a stand, near 1 at speed.
double FromStanding(double speed_mps) { return speed_mps / (speed_mps + kStandingMps); }

/// Values at times, smoothed by Gaussian weights.
std::vector<double> SmoothValues(const std::vector<double>& times_s,
                                 const std::vector<double>& values, double sigma_s) {
  std::vector<double> smooth(values.size());
  std::size_t begin = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    while (times_s[begin] < times_s[i] - 3 * sigma_s) ++begin;
    double sum = 0, weights = 0;
    for (std::size_t k = begin; k < values.size() && times_s[k] <= times_s[i] + 3 * sigma_s; ++k) {
      const double ratio = (times_s[k] - times_s[i]) / sigma_s;
      const double weight = std::exp(-ratio * ratio / 2);
      sum += weight * values[k];
      weights += weight;
    }
    smooth[i] = sum / weights;
  }
  return smooth;
}

double MedianOfUpperHalf(std::vector<double> values) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 3 / 4);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// A linear regression of y on x.
struct Regression {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;

  void Add(double x_value, double y_value) {
    n += 1;
    x += x_value;
    y += y_value;
    xx += x_value * x_value;
    xy += x_value * y_value;
    yy += y_value * y_value;
  }
  double Covariance() const { return xy / n - x / n * (y / n); }
  double VarianceX() const { return xx / n - x / n * (x / n); }
  /// 0 where one of the two does not vary or they fall together.
  double Correlation() const {
    const double y_variance = yy / n - y / n * (y / n);
    if (n < 3 || VarianceX() <= 1e-7 || y_variance <= 1e-7 || Covariance() <= 0) return 0;
    return std::min(0.9999, Covariance() / std::sqrt(VarianceX() * y_variance));
  }
  double Slope() const { return VarianceX() > 1e-7 ? Covariance() / VarianceX() : 0; }
};

/// How many independent values a series has: their number over the sum of its autocorrelations.
double IndependentValues(const std::vector<double>& series) {
  const auto count = static_cast<Eigen::Index>(series.size());
  Eigen::VectorXd values = Eigen::VectorXd::Map(series.data(), count);
  values.array() -= values.mean();
  const double variance = values.squaredNorm() / static_cast<double>(count);
  if (variance <= 0) return 1;
  double length = 1;
  for (Eigen::Index lag = 1; lag < count / 4; ++lag) {
    const Eigen::Index left = count - lag;
    const double correlation =
        values.head(left).dot(values.tail(left)) / static_cast<double>(left) / variance;
    if (correlation < 0.05) break;
    length += 2 * correlation;
  }
  return static_cast<double>(count) / length;
}

/// The picture's motion beside the receiver's at every offset that is tried.
class OffsetSearch {
 public:
  OffsetSearch(const std::vector<ImageMotion>& picture, ReceiverMotion receiver, double search_s)
      : receiver_(std::move(receiver)), half_(static_cast<int>(std::lround(search_s / kGridS))) {
    std::vector<double> times_s, turns, flows, speeds;
    for (const ImageMotion& motion : picture) {
      stamps_ns_.push_back(motion.stamp_ns);
      times_s.push_back(Seconds(motion.stamp_ns - picture.front().stamp_ns));
      turns.push_back(motion.turn_radps);
      flows.push_back(motion.flow);
    }
    for (const ReceiverMotion::Sample& sample : receiver_.samples) {
      if (!std::isnan(sample.speed_mps)) speeds.push_back(sample.speed_mps);
    }
    // Flow in metres per second, about.
    const double usual_flow = std::max(1e-6, MedianOfUpperHalf(flows));
    const double usual_speed = speeds.empty() ? 0 : MedianOfUpperHalf(speeds);
    for (double& flow : flows) flow = FromStanding(flow * usual_speed / usual_flow);
    turns_ = SmoothValues(times_s, turns, kPictureSmoothing * receiver_.turn_smoothing_s);
    standing_ = SmoothValues(times_s, flows, kPictureSmoothing * receiver_.speed_smoothing_s);
    for (int i = -half_; i <= half_; ++i) Compare(i * kGridS);
  }

  std::optional<ClockOffset> Best() {
    std::optional<std::size_t> best = Least();
    for (int round = 0; best && round < kRounds; ++round) {
      Weigh(SecondsAt(*best));
      best = Least();
    }
    if (!best) return std::nullopt;
    ClockOffset offset = Refine(*best);
    offset.turn_correlation = turn_correlations_[*best];
    offset.speed_correlation = speed_correlations_[*best];
    lead_ = LeadOf(*best);
    return offset;
  }

  /// By how much -2 log of the likelihood of the second best offset is larger.
  double lead() const { return lead_; }

 private:
  double SecondsAt(std::size_t index) const { return (static_cast<int>(index) - half_) * kGridS; }
  bool IsTried(std::size_t index) const { return !std::isnan(turn_correlations_[index]); }

  void Compare(double offset_s) {
    Regression turn, speed;
    for (std::size_t i = 0; i < stamps_ns_.size(); ++i) {
      const auto sample = receiver_.At(stamps_ns_[i] + Nanoseconds(offset_s));
      if (!sample) continue;
      turn.Add(sample->turn_radps, turns_[i]);
      speed.Add(FromStanding(sample->speed_mps), standing_[i]);
    }
    const bool tried = turn.n >= kMinOverlap * static_cast<double>(stamps_ns_.size());
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    turn_correlations_.push_back(tried ? turn.Correlation() : kNone);
    speed_correlations_.push_back(tried ? speed.Correlation() : kNone);
  }

  /// How many independent values the differences at an offset have.
  void Weigh(double offset_s) {
    Regression turn, speed;
    std::vector<ReceiverMotion::Sample> samples;
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < stamps_ns_.size(); ++i) {
      const auto sample = receiver_.At(stamps_ns_[i] + Nanoseconds(offset_s));
      if (!sample) continue;
      turn.Add(sample->turn_radps, turns_[i]);
      speed.Add(FromStanding(sample->speed_mps), standing_[i]);
      samples.push_back(*sample);
      indices.push_back(i);
    }
    std::vector<double> turn_rest, speed_rest;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      turn_rest.push_back(turns_[indices[i]] - turn.Slope() * samples[i].turn_radps);
      speed_rest.push_back(standing_[indices[i]] -
                           speed.Slope() * FromStanding(samples[i].speed_mps));
    }
    turn_weight_ = IndependentValues(turn_rest);
    speed_weight_ = IndependentValues(speed_rest);
  }

  double CostAt(std::size_t index) const {
    const double turn = turn_correlations_[index], speed = speed_correlations_[index];
    return turn_weight_ * std::log(1 - turn * turn) + speed_weight_ * std::log(1 - speed * speed);
  }

  std::optional<std::size_t> Least() const {
    std::optional<std::size_t> best;
    for (std::size_t i = 0; i < turn_correlations_.size(); ++i) {
      if (IsTried(i) && (!best || CostAt(i) < CostAt(*best))) best = i;
    }
    return best;
  }

  /// By the parabola around a least cost; of no certainty where it has none around.
  ClockOffset Refine(std::size_t best) const {
    ClockOffset offset;
    offset.seconds = SecondsAt(best);
    offset.sigma_s = std::numeric_limits<double>::infinity();
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (int step = -kParabolaSteps; step <= kParabolaSteps; ++step) {
      const auto index = static_cast<std::int64_t>(best) + step;
      if (index < 0 || index >= static_cast<std::int64_t>(turn_correlations_.size()) ||
          !IsTried(static_cast<std::size_t>(index))) {
        return offset;
      }
      const double t = step * kGridS;
      const Eigen::Vector3d row(1, t, t * t);
      normal += row * row.transpose();
      right += row * CostAt(static_cast<std::size_t>(index));
    }
    const Eigen::Vector3d parabola = normal.ldlt().solve(right);
    if (parabola[2] <= 0) return offset;
    const double reach_s = kParabolaSteps * kGridS;
    offset.seconds += std::clamp(-parabola[1] / (2 * parabola[2]), -reach_s, reach_s);
    offset.sigma_s = std::max(kFloorSigmaS, 1 / std::sqrt(parabola[2]));
    return offset;
  }

  double LeadOf(std::size_t best) const {
    double second = 0;
    for (std::size_t i = 1; i + 1 < turn_correlations_.size(); ++i) {
      if (std::abs(SecondsAt(i) - SecondsAt(best)) <= kOtherOffsetS) continue;
      if (!IsTried(i - 1) || !IsTried(i) || !IsTried(i + 1)) continue;
      if (CostAt(i) <= CostAt(i - 1) && CostAt(i) <= CostAt(i + 1)) {
        second = std::min(second, CostAt(i));
      }
    }
    return second - CostAt(best);
  }

  const ReceiverMotion receiver_;
  const int half_;
  std::vector<std::int64_t> stamps_ns_;
  std::vector<double> turns_, standing_;
  std::vector<double> turn_correlations_, speed_correlations_;  ///< NaN: not tried.
  double turn_weight_ = 1, speed_weight_ = 1;
  double lead_ = 0;
};

/// What of the track the search can reach.
RecordedTrack Beside(const std::vector<ImageMotion>& picture, const RecordedTrack& track,
                     double search_s) {
  const std::int64_t reach_ns = Nanoseconds(search_s + kTrackMarginS);
  RecordedTrack beside;
  for (const RecordedPosition& position : track.positions) {
    if (position.stamp_ns >= picture.front().stamp_ns - reach_ns &&
        position.stamp_ns <= picture.back().stamp_ns + reach_ns) {
      beside.positions.push_back(position);
    }
  }
  return beside;
}

}  // namespace

ClockOffsetAnswer FindClockOffset(const std::vector<ImageMotion>& picture,
                                  const RecordedTrack& track, const ClockOffsetConfig& config) {
  CheckRange("the search for the clocks' offset, s,", config.search_s, 1, 300);
  if (picture.size() < kMinPictures) return {std::nullopt, "the recording is too short"};
  const RecordedTrack beside = Beside(picture, track, config.search_s);
  const std::string outside = "the recording's times lie outside the track's";
  if (beside.positions.size() < 2) return {std::nullopt, outside};
  OffsetSearch search(picture, MotionOf(beside), config.search_s);
  const std::optional<ClockOffset> best = search.Best();
  if (!best) return {std::nullopt, outside};
  if (std::max(best->turn_correlation, best->speed_correlation) < kMinCorrelation) {
    return {std::nullopt, "the picture's motion shows neither a stop nor a turn of the track"};
  }
  if (search.lead() < kMinLead) {
    return {std::nullopt, "several offsets explain the picture's motion about as well"};
  }
  if (best->sigma_s > config.max_sigma_s) {
    return {std::nullopt, "no stop or turn is sharp enough to tell it"};
  }
  return {best, ""};
}

}  // namespace livemap::recordings
