#include "recordings/clock/clock_offset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "common/checks.h"
#include "common/time.h"
#include "recordings/clock/receiver_motion.h"

namespace livemap::recordings {
namespace {

constexpr double kGridS = 0.05;
/// Pieces that are drawn whole: longer than what the errors of neighbouring pictures share.
constexpr double kMinBlockS = 4;
constexpr std::size_t kMaxBlocks = 60;
constexpr int kResamples = 200;
constexpr std::size_t kMinPictures = 50;
/// Of the pictures, how many must lie within the track at an offset that is tried.
constexpr double kMinOverlap = 0.6;
/// A weaker relation may be chance.
constexpr double kMinCorrelation = 0.5;
/// Below this a standard deviation from resamples is a matter of the grid.
constexpr double kFloorSigmaS = 0.02;
/// Motion of less than this varies by noise alone: image widths per second, squared.
constexpr double kSteadyVariance = 1e-8;
/// Of positions beside those that the search reaches, for smoothing.
constexpr double kTrackMarginS = 10;

/// Sums of a linear regression of y on x.
struct RegressionSums {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;

  void Add(double x_value, double y_value) {
    n += 1;
    x += x_value;
    y += y_value;
    xx += x_value * x_value;
    xy += x_value * y_value;
    yy += y_value * y_value;
  }
  void Add(const RegressionSums& other) {
    n += other.n;
    x += other.x;
    y += other.y;
    xx += other.xx;
    xy += other.xy;
    yy += other.yy;
  }
  /// 0 where one of the two does not vary or they fall together.
  double Correlation() const {
    if (n < 3) return 0;
    const double x_variance = xx / n - x / n * x / n, y_variance = yy / n - y / n * y / n;
    const double covariance = xy / n - x / n * y / n;
    if (x_variance <= 1e-9 || y_variance <= kSteadyVariance || covariance <= 0) return 0;
    return std::min(0.9999, covariance / std::sqrt(x_variance * y_variance));
  }
};

struct MotionSums {
  RegressionSums turn, speed;

  void Add(const MotionSums& other) {
    turn.Add(other.turn);
    speed.Add(other.speed);
  }
};

/// The sums of every block at every offset that is tried.
class OffsetSearch {
 public:
  OffsetSearch(const std::vector<ImageMotion>& picture, const ReceiverMotion& receiver,
               double search_s)
      : pictures_(picture.size()), half_(static_cast<int>(std::lround(search_s / kGridS))) {
    const double length_s = Seconds(picture.back().stamp_ns - picture.front().stamp_ns);
    const double block_s =
        std::max(kMinBlockS, length_s / static_cast<double>(kMaxBlocks) * 1.0001);
    blocks_.assign(static_cast<std::size_t>(length_s / block_s) + 1,
                   std::vector<MotionSums>(static_cast<std::size_t>(2 * half_ + 1)));
    for (const ImageMotion& motion : picture) {
      const double since_s = Seconds(motion.stamp_ns - picture.front().stamp_ns);
      std::vector<MotionSums>& block = blocks_[static_cast<std::size_t>(since_s / block_s)];
      for (std::size_t i = 0; i < block.size(); ++i) {
        const auto sample = receiver.At(motion.stamp_ns + Nanoseconds(SecondsAt(i)));
        if (!sample) continue;
        block[i].turn.Add(sample->turn_radps, motion.turn);
        block[i].speed.Add(sample->speed_mps, motion.flow);
      }
    }
  }

  std::size_t blocks() const { return blocks_.size(); }

  /// The best offset when each block counts `times` times; none where no offset overlaps enough.
  std::optional<ClockOffset> Best(const std::vector<int>& times) const {
    const std::size_t offsets = blocks_.front().size();
    std::vector<double> costs(offsets, 0);
    std::vector<MotionSums> sums(offsets);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      for (int repeat = 0; repeat < times[b]; ++repeat) {
        for (std::size_t i = 0; i < offsets; ++i) sums[i].Add(blocks_[b][i]);
      }
    }
    std::optional<std::size_t> best;
    for (std::size_t i = 0; i < offsets; ++i) {
      if (sums[i].speed.n < kMinOverlap * static_cast<double>(pictures_)) continue;
      const double turn = sums[i].turn.Correlation(), speed = sums[i].speed.Correlation();
      costs[i] = std::log(1 - turn * turn) + std::log(1 - speed * speed);
      if (!best || costs[i] < costs[*best]) best = i;
    }
    if (!best) return std::nullopt;
    ClockOffset offset;
    offset.seconds = SecondsAt(*best) + kGridS * PeakBeside(costs, *best);
    offset.turn_correlation = sums[*best].turn.Correlation();
    offset.speed_correlation = sums[*best].speed.Correlation();
    return offset;
  }

  bool IsAtEdge(double seconds) const { return std::abs(seconds) > half_ * kGridS - 0.5; }

 private:
  double SecondsAt(std::size_t index) const { return (static_cast<int>(index) - half_) * kGridS; }

  /// Of the parabola through a smallest cost and its neighbours, in steps of the grid.
  static double PeakBeside(const std::vector<double>& costs, std::size_t at) {
    if (at == 0 || at + 1 >= costs.size()) return 0;
    const double bend = costs[at - 1] - 2 * costs[at] + costs[at + 1];
    if (bend <= 0) return 0;
    return std::clamp((costs[at - 1] - costs[at + 1]) / (2 * bend), -0.5, 0.5);
  }

  const std::size_t pictures_;
  const int half_;
  std::vector<std::vector<MotionSums>> blocks_;
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

/// Standard deviation of the offsets of recordings made of this one's blocks, about `offset`.
double BootstrapSigma(const OffsetSearch& search, double offset, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  double squares = 0;
  int counted = 0;
  std::vector<int> times(search.blocks());
  for (int i = 0; i < kResamples; ++i) {
    std::fill(times.begin(), times.end(), 0);
    for (std::size_t draw = 0; draw < times.size(); ++draw) ++times[random() % times.size()];
    const std::optional<ClockOffset> drawn = search.Best(times);
    if (!drawn) continue;
    squares += (drawn->seconds - offset) * (drawn->seconds - offset);
    ++counted;
  }
  if (counted < kResamples / 2) return 1e3;
  return std::max(kFloorSigmaS, std::sqrt(squares / counted));
}

}  // namespace

ClockOffsetAnswer FindClockOffset(const std::vector<ImageMotion>& picture,
                                  const RecordedTrack& track, const ClockOffsetConfig& config) {
  CheckRange("the search for the clocks' offset, s,", config.search_s, 1, 300);
  if (picture.size() < kMinPictures) return {std::nullopt, "the recording is too short"};
  const RecordedTrack beside = Beside(picture, track, config.search_s);
  if (beside.positions.size() < 2) {
    return {std::nullopt, "the recording's times lie outside the track's"};
  }
  const OffsetSearch search(picture, MotionOf(beside), config.search_s);
  const std::vector<int> once(search.blocks(), 1);
  std::optional<ClockOffset> best = search.Best(once);
  if (!best) return {std::nullopt, "the recording's times lie outside the track's"};
  if (std::max(best->turn_correlation, best->speed_correlation) < kMinCorrelation) {
    return {std::nullopt, "the picture's motion shows neither a stop nor a turn of the track"};
  }
  best->sigma_s = BootstrapSigma(search, best->seconds, config.seed);
  if (search.IsAtEdge(best->seconds)) {
    return {std::nullopt, "the best offset is at the edge of the search"};
  }
  if (best->sigma_s > config.max_sigma_s) {
    return {std::nullopt, "several offsets explain the picture's motion about as well"};
  }
  return {best, ""};
}

}  // namespace livemap::recordings
