#pragma once

#include <algorithm>

namespace livemap::odometry {

/// How large a share is in frame after frame, and by how much single frames fall short of that.
class UsualShare {
 public:
  /// What is expected of the first frame; 0: it says itself what is usual.
  explicit UsualShare(double at_first = 0) : at_first_(at_first), usual_(at_first) {}
  void Forget() {
    usual_ = at_first_;
    shortfall_ = 0;
  }
  void Add(double share) {
    if (usual_ == 0) usual_ = share;
    const double difference = share - usual_;
    usual_ += kNewestShare * difference;
    shortfall_ += kNewestShare * (std::max(0.0, -difference) - shortfall_);
  }
  /// 0 before anything is known.
  double value() const { return usual_; }
  /// By how much a frame may fall short of the last ones without being strange: by `least`, or by
  /// much more than they did themselves. That some had more than usual excuses nobody.
  double Drop(double least) const { return std::max(least, kShortfalls * shortfall_); }

 private:
  static constexpr double kNewestShare = 0.2;
  static constexpr double kShortfalls = 6;  // Three mean deviations, half of which are shortfalls.

  double at_first_, usual_;
  double shortfall_ = 0;  // Mean, of frames with more than usual as 0.
};

}  // namespace livemap::odometry
