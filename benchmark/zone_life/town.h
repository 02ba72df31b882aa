#pragma once

#include <cstddef>
#include <vector>

#include "datasets/seeded_random.h"
#include "geo/wgs84.h"

namespace livemap::bench {

constexpr double kDayS = 86400;

/// A town of square blocks: streets between junctions, every fourth one an artery.
class Town {
 public:
  static constexpr std::size_t kSide = 16;  ///< Junctions per side.
  static constexpr double kBlockM = 300;    ///< Between junctions.
  static constexpr double kArteryMps = 14;
  static constexpr double kStreetMps = 9;

  /// A street in one direction.
  struct Lane {
    std::size_t road = 0;
    bool forward = true;
  };

  Town();

  std::size_t roads() const { return roads_.size(); }
  /// The fastest way between two junctions.
  std::vector<Lane> Route(std::size_t from, std::size_t to) const;
  double SpeedMps(std::size_t road) const { return roads_[road].artery ? kArteryMps : kStreetMps; }
  /// A place on a road; `offset_m` from its southern or western end.
  geo::GeoPoint At(std::size_t road, double offset_m) const;
  /// Clockwise from true north.
  double CourseRad(const Lane& lane) const;

 private:
  struct Road {
    std::size_t from, to;
    bool north, artery;
  };

  std::vector<Road> roads_;
  std::vector<std::size_t> next_;  // Junction after `from` on the way to `to`.
  std::vector<std::vector<std::size_t>> roads_at_;
};

/// One vehicle enters one lane.
struct Traversal {
  double at_s = 0;
  std::size_t vehicle = 0;
  Town::Lane lane;
};

/// Vehicles with habits: seven in ten commute, one in ten drives all day, the rest now and then.
class Fleet {
 public:
  Fleet(const Town& town, std::size_t vehicles, datasets::SeededRandom& random);

  std::size_t size() const { return members_.size(); }
  /// All traversals of a day (0: a Monday), in order of time; seconds since the first midnight.
  std::vector<Traversal> Day(int day, datasets::SeededRandom& random) const;

 private:
  enum class Habit { kCommuter, kProfessional, kOccasional };
  struct Member {
    Habit habit = Habit::kCommuter;
    std::size_t home = 0;
    std::size_t work = 0;
  };

  void Drive(std::size_t vehicle, std::size_t from, std::size_t to, double at_s,
             std::vector<Traversal>& day) const;
  void DriveMember(std::size_t vehicle, int day_of_week, double midnight_s,
                   datasets::SeededRandom& random, std::vector<Traversal>& day) const;

  const Town& town_;
  std::vector<Member> members_;
};

}  // namespace livemap::bench
