#include "vehicle/alerts/street_way.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "common/time.h"
#include "streets/street_map.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {
namespace {

using Polyline = std::vector<Eigen::Vector2d>;

constexpr double kMomentS = 0.2;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Streets drawn on a plane; nodes at the same place are one.
class DrawnStreets {
 public:
  explicit DrawnStreets(const geo::LocalFrame& frame) : frame_(frame) {}

  void Add(const Polyline& line, bool one_way = false, int layer = 0) {
    streets::Street street;
    street.id = ++streets_;
    street.backward = !one_way;
    street.layer = static_cast<std::int8_t>(layer);
    std::vector<std::int64_t> nodes;
    for (const Eigen::Vector2d& place_m : line) nodes.push_back(NodeAt(place_m));
    builder_.AddStreet(street, "", nodes);
  }

  std::shared_ptr<const streets::StreetMap> Map() {
    for (std::size_t i = 0; i < places_m_.size(); ++i) {
      builder_.SetPlace(static_cast<std::int64_t>(i), frame_.ToGeo(places_m_[i]));
    }
    return std::make_shared<const streets::StreetMap>(builder_.Build());
  }

 private:
  std::int64_t NodeAt(const Eigen::Vector2d& place_m) {
    for (std::size_t i = 0; i < places_m_.size(); ++i) {
      if ((places_m_[i] - place_m).norm() < 0.1) return static_cast<std::int64_t>(i);
    }
    places_m_.push_back(place_m);
    return static_cast<std::int64_t>(places_m_.size()) - 1;
  }

  const geo::LocalFrame& frame_;
  streets::StreetMapBuilder builder_;
  Polyline places_m_;
  std::int64_t streets_ = 0;
};

class StreetWayTest : public testing::Test {
 protected:
  static Uuid IdOf(std::uint8_t number) {
    Uuid id;
    id.bytes[15] = number;
    return id;
  }

  void Begin() {
    alerts_ = std::make_unique<DriverAlerts>(DriverAlerts::Config(), protocol::HazardCatalogue(),
                                             drawn_.Map());
  }

  /// `course_deg` is of a vehicle that passed it, clockwise from north.
  void PutHazard(std::uint8_t number, double east_m, double north_m, double course_deg = kUnknown) {
    ASSERT_TRUE(alerts_->Put({IdOf(number), "pothole", frame_.ToGeo({east_m, north_m}), 1.0,
                              std::nullopt, course_deg * M_PI / 180}));
  }

  /// With exact fixes, from where the vehicle is.
  void DriveTo(double east_m, double north_m, double speed_mps) {
    const Eigen::Vector2d to_m(east_m, north_m);
    while ((to_m - place_m_).norm() > speed_mps * kMomentS) {
      place_m_ += speed_mps * kMomentS * (to_m - place_m_).normalized();
      time_s_ += kMomentS;
      geo::TrackPose pose;
      pose.position = frame_.ToGeo(place_m_);
      pose.covariance_m2 = 1.5 * 1.5 * Eigen::Matrix2d::Identity();
      pose.course_rad = std::numeric_limits<double>::quiet_NaN();
      for (const HazardAlert& alert : alerts_->Add(Nanoseconds(1000 + time_s_), pose)) {
        if (alert.state == HazardAlert::State::kApproach) told_s_[alert.id.bytes[15]] = time_s_;
      }
    }
  }

  bool IsTold(int number) const { return told_s_.count(number) != 0; }

  geo::LocalFrame frame_{{49.2, 7.0}};
  DrawnStreets drawn_{frame_};
  std::unique_ptr<DriverAlerts> alerts_;
  Eigen::Vector2d place_m_{0, 0};
  double time_s_ = 0;
  std::map<int, double> told_s_;
};

TEST_F(StreetWayTest, WarnsBeforeASharpBendOfWhatLiesBehindIt) {
  drawn_.Add({{0, 0}, {0, 300}, {12, 325}, {35, 337}, {400, 337}});
  Begin();
  PutHazard(1, 38, 337);
  DriveTo(0, 300, 12);
  // Here it is 57 m, 4.7 s ahead, and 37 m to the side of the course.
  EXPECT_TRUE(IsTold(1));
}

TEST_F(StreetWayTest, KeepsSilentAboutTheOtherCarriagewayWhereTheRoadBends) {
  drawn_.Add({{0, 0}, {0, 500}, {60, 700}, {200, 900}}, true);
  drawn_.Add({{188, 908}, {47, 705}, {-14, 502}, {-14, 0}}, true);
  Begin();
  PutHazard(1, -14, 480);
  PutHazard(2, -10, 515);
  PutHazard(3, 1, 490);
  DriveTo(0, 500, 28);
  DriveTo(60, 700, 28);
  EXPECT_FALSE(IsTold(1));
  EXPECT_FALSE(IsTold(2));
  EXPECT_TRUE(IsTold(3));
}

TEST_F(StreetWayTest, KeepsSilentWhereABridgeIsRightAbove) {
  drawn_.Add({{0, 0}, {0, 800}});
  drawn_.Add({{-100, 400}, {100, 400}}, false, 1);
  Begin();
  PutHazard(1, 0, 400);
  PutHazard(2, 7, 400);
  PutHazard(3, 0, 440);
  DriveTo(0, 700, 14);
  EXPECT_FALSE(IsTold(1)) << "it may lie on either";
  EXPECT_FALSE(IsTold(2));
  EXPECT_TRUE(IsTold(3));
}

TEST_F(StreetWayTest, BelowABridgeTheDirectionOfThePassTellsWhoseHazardItIs) {
  drawn_.Add({{0, 0}, {0, 800}});
  drawn_.Add({{-100, 400}, {100, 400}}, false, 1);
  Begin();
  PutHazard(1, 0, 400, 8);
  PutHazard(2, 0, 401, 175);
  PutHazard(3, 0, 399, 85);
  PutHazard(4, 1, 400, -95);
  PutHazard(5, 0, 400);
  DriveTo(0, 700, 14);
  EXPECT_TRUE(IsTold(1));
  EXPECT_TRUE(IsTold(2)) << "a vehicle on the other lane has seen it, too";
  EXPECT_FALSE(IsTold(3)) << "it was passed on the bridge";
  EXPECT_FALSE(IsTold(4)) << "it was passed on the bridge, the other way";
  EXPECT_FALSE(IsTold(5)) << "it may lie on either";
}

TEST_F(StreetWayTest, BetweenTwoCarriagewaysTheDirectionOfThePassTellsWhoseHazardItIs) {
  drawn_.Add({{0, 0}, {0, 800}}, true);
  drawn_.Add({{-8, 800}, {-8, 0}}, true);
  Begin();
  PutHazard(1, -3, 400, 3);
  PutHazard(2, -5, 420, 183);
  PutHazard(3, -3, 440, 183);
  DriveTo(0, 700, 14);
  EXPECT_TRUE(IsTold(1));
  EXPECT_FALSE(IsTold(2));
  EXPECT_TRUE(IsTold(3)) << "one direction can be wrong: the place lies on the own carriageway";
}

TEST_F(StreetWayTest, AJunctionsSquareBelongsToBothStreetsInWhicheverDirectionItWasPassed) {
  drawn_.Add({{0, 0}, {0, 400}});
  drawn_.Add({{0, 400}, {0, 800}});
  drawn_.Add({{-200, 400}, {0, 400}});
  drawn_.Add({{0, 400}, {200, 400}});
  Begin();
  PutHazard(1, 1, 401, 90);
  PutHazard(2, 1, 399, 0);
  DriveTo(0, 700, 14);
  EXPECT_TRUE(IsTold(1));
  EXPECT_TRUE(IsTold(2));
}

TEST_F(StreetWayTest, AJunctionsSquareBelongsToBothStreets) {
  drawn_.Add({{0, 0}, {0, 400}});
  drawn_.Add({{0, 400}, {0, 800}});
  drawn_.Add({{-100, 400}, {0, 400}, {100, 400}});
  Begin();
  PutHazard(1, 0, 400);
  PutHazard(2, 14, 400);
  DriveTo(0, 700, 14);
  EXPECT_TRUE(IsTold(1));
  EXPECT_FALSE(IsTold(2));
}

TEST_F(StreetWayTest, AParallelStreetIsNotTheOwn) {
  drawn_.Add({{0, 0}, {0, 800}});
  drawn_.Add({{9, 0}, {9, 800}});
  Begin();
  PutHazard(1, 9, 400);
  PutHazard(2, 1, 500);
  DriveTo(0, 700, 14);
  EXPECT_FALSE(IsTold(1));
  EXPECT_TRUE(IsTold(2));
}

TEST_F(StreetWayTest, WhereTheMapHasOnlyTheOtherCarriagewayWhatLiesThereIsNotTold) {
  drawn_.Add({{-14, 900}, {-14, 0}}, true);
  const auto drive = [&] {
    place_m_ = {0, 0};
    told_s_.clear();
    PutHazard(1, -14, 600);
    PutHazard(2, 0, 750);
    DriveTo(0, 450, 30);
    DriveTo(-5, 503, 30);  // Swerves towards the other carriageway.
    DriveTo(0, 560, 30);
    DriveTo(0, 800, 30);
  };
  alerts_ = std::make_unique<DriverAlerts>(DriverAlerts::Config(), protocol::HazardCatalogue());
  drive();
  EXPECT_TRUE(IsTold(1)) << "by the course alone it is";
  Begin();
  drive();
  EXPECT_FALSE(IsTold(1));
  EXPECT_TRUE(IsTold(2));
}

TEST_F(StreetWayTest, WhereTheMapHasNoStreetTheCourseCounts) {
  drawn_.Add({{3000, 0}, {3000, 800}});
  Begin();
  PutHazard(1, 0, 400);
  DriveTo(0, 350, 14);
  EXPECT_EQ(alerts_->on_street(), 0);
  EXPECT_TRUE(IsTold(1));
}

TEST_F(StreetWayTest, WhereTheMapEndsTheCourseCounts) {
  drawn_.Add({{0, 0}, {0, 300}});
  Begin();
  PutHazard(1, 0, 345);
  DriveTo(0, 295, 14);
  EXPECT_GT(alerts_->on_street(), 0.9);
  EXPECT_TRUE(IsTold(1));
}

TEST_F(StreetWayTest, WhoPassesCrossingsIsTakenToPassTheNext) {
  for (int i = 0; i < 9; ++i) {
    drawn_.Add({{0, 150.0 * i}, {0, 150.0 * (i + 1)}});
    drawn_.Add({{-100, 150.0 * (i + 1)}, {0, 150.0 * (i + 1)}, {100, 150.0 * (i + 1)}});
  }
  Begin();
  DriveTo(0, 1340, 14);
  EXPECT_LT(alerts_->turn_habit(), 0.5);
}

TEST_F(StreetWayTest, WhoTurnsAtEachCrossingIsTakenToTurnAtTheNext) {
  // Stairs: at each corner the street goes on straight, too.
  for (int i = 0; i < 8; ++i) {
    const double corner_m = 100.0 * i;
    drawn_.Add({{corner_m, corner_m}, {corner_m, corner_m + 100}, {corner_m, corner_m + 180}});
    drawn_.Add({{corner_m, corner_m + 100}, {corner_m + 100, corner_m + 100}});
    drawn_.Add({{corner_m + 100, corner_m + 100}, {corner_m + 180, corner_m + 100}});
  }
  Begin();
  for (int i = 0; i < 7; ++i) {
    DriveTo(100.0 * i, 100.0 * i + 100, 6);
    DriveTo(100.0 * i + 100, 100.0 * i + 100, 6);
  }
  EXPECT_GT(alerts_->turn_habit(), 1.5);
  alerts_->StartAnew();
  EXPECT_DOUBLE_EQ(alerts_->turn_habit(), 1);
}

TEST_F(StreetWayTest, WhoBrakesBeforeACrossingIsNotTakenToSpeedUpThere) {
  drawn_.Add({{0, 0}, {0, 400}});
  drawn_.Add({{0, 400}, {0, 800}});
  drawn_.Add({{-200, 400}, {0, 400}, {200, 400}});
  Begin();
  PutHazard(1, 0, 418);
  DriveTo(0, 340, 13);
  // It brakes by 1.5 m/s^2 towards the crossing.
  for (double speed_mps = 13; speed_mps > 4.5; speed_mps -= 1.5 * kMomentS) {
    DriveTo(0, place_m_.y() + speed_mps * kMomentS * 1.01, speed_mps);
  }
  EXPECT_FALSE(IsTold(1)) << "it may turn, and " << 418 - place_m_.y() << " m take 6 s";
}

TEST_F(StreetWayTest, StartingAnewForgetsTheStreet) {
  drawn_.Add({{0, 0}, {0, 600}});
  Begin();
  DriveTo(0, 300, 14);
  EXPECT_GT(alerts_->on_street(), 0.9);
  alerts_->StartAnew();
  EXPECT_EQ(alerts_->on_street(), 0);
}

}  // namespace
}  // namespace livemap::vehicle
