#include "vehicle/reporting/settling_reports.h"

#include <gmock/gmock.h>

#include "geo/wgs84.h"
#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::SizeIs;

/// Hazards on the way of a vehicle that drives straight on, where it sees them first at 3 s.
class SettlingReportsTest : public ::testing::Test {
 protected:
  /// A sight of a pothole that lies so far ahead at 3 s, as an image with it alone; its pass
  /// begins with the first.
  WaitingFrame See(double time_s, double forward_m = 20) {
    const PassSights::Seen seen = SeenAt(time_s, forward_m, 0, "pothole");
    const double ahead_m = forward_m - kSpeedMps * (time_s - 3);
    return ViewOf(time_s, passes_.Add({seen}).front(), forward_m, BoxAt(ahead_m, 0));
  }
  static WaitingFrame ViewOf(double time_s, PassSights::Id pass, double forward_m = 20,
                             const imaging::Box& box = BoxAt(20, 0)) {
    WaitingFrame view;
    view.frame = FrameAt(time_s, {{"pothole", 0.8F, box}});
    PlacedSighting hazard;
    hazard.sighting = view.frame.sightings.front();
    hazard.place.position = geo::GeodesicDestination(VehicleAt(3), kBearingRad, forward_m);
    hazard.pass = pass;
    view.candidates = {hazard};
    return view;
  }
  bool Add(double now_s, const WaitingFrame& view) {
    return settling_.Add(view, 0, passes_, now_s, steady_s_);
  }
  /// How many hazards are reported now, images up to `shown_s` having been looked through.
  std::size_t WorkOff(double now_s, double shown_s) {
    std::size_t reported = 0;
    settling_.WorkOff(passes_, StampNs(shown_s), now_s, steady_s_, [&](const WaitingFrame&) {
      reported += has_pictures_ ? 1U : 0U;
      return has_pictures_;
    });
    return reported;
  }

  protocol::HazardCatalogue catalogue_ = protocol::HazardCatalogue::Parse(
      "classes:\n  pothole:\n    urgency: 2\n  deer:\n    urgency: 1\n", "test");
  PassSights passes_{{}, catalogue_};
  SettlingReports settling_{{1.5, 0.2}, catalogue_};
  double steady_s_ = 500;
  bool has_pictures_ = true;
};

TEST_F(SettlingReportsTest, OnlyWhatIsNotUrgentAndOfAPassHasToWaitAndOnlyOnce) {
  PlacedSighting hazard = See(3).candidates.front();
  EXPECT_TRUE(settling_.HasToWait(hazard));
  EXPECT_FALSE(SettlingReports({0, 0.2}, catalogue_).HasToWait(hazard));
  hazard.has_settled = true;
  EXPECT_FALSE(settling_.HasToWait(hazard));
  EXPECT_FALSE(settling_.HasToWait(ViewOf(3, 0).candidates.front()));
  hazard = ViewOf(3, 1).candidates.front();
  hazard.sighting.class_name = "deer";
  EXPECT_FALSE(settling_.HasToWait(hazard));
}

TEST_F(SettlingReportsTest, WaitsAsLongAsItMayByTheClockOfTheStamps) {
  Add(3, See(3));
  EXPECT_EQ(WorkOff(4.49, 3), 0U);
  EXPECT_EQ(WorkOff(4.51, 3), 1U);
  EXPECT_EQ(settling_.size(), 0U);
}

TEST_F(SettlingReportsTest, WaitsTwiceAsLongByTheSteadyClockWhereTheOtherStands) {
  Add(3, See(3));
  steady_s_ += 2.9;
  EXPECT_EQ(WorkOff(3, 3), 0U);
  steady_s_ += 0.2;
  EXPECT_EQ(WorkOff(3, 3), 1U);
}

TEST_F(SettlingReportsTest, AClockThatIsSetBackBeginsTheWaitAnew) {
  Add(3, See(3));
  EXPECT_EQ(WorkOff(-10, 3), 0U);
  EXPECT_EQ(WorkOff(-8.4, 3), 1U);
}

TEST_F(SettlingReportsTest, WaitsNoLongerThanItIsInView) {
  Add(3, See(3));
  EXPECT_EQ(WorkOff(3.05, 3.05), 0U);
  EXPECT_EQ(WorkOff(3.1, 3.1), 1U) << "newer images do not show it";
  const imaging::Box at_the_edge{300, 370, 340, 399};
  Add(4, ViewOf(4, See(4, 40).candidates.front().pass, 40, at_the_edge));
  EXPECT_EQ(WorkOff(4, 4), 1U) << "the next image will not show it";
}

TEST_F(SettlingReportsTest, APlaceThatIsSureDoesNotWait) {
  settling_ = SettlingReports({1.5, 100}, catalogue_);
  Add(3, See(3));
  EXPECT_EQ(WorkOff(3, 3), 1U);
}

TEST_F(SettlingReportsTest, ANewerSightOfThePassTakesTheOldersPlace) {
  const WaitingFrame first = See(3);
  const WaitingFrame late = See(3.1);
  EXPECT_TRUE(Add(3, first));
  EXPECT_FALSE(Add(3.2, See(3.2)));
  EXPECT_FALSE(Add(3.3, late)) << "an older one changes nothing";
  const std::vector<WaitingFrame> views = settling_.TakeAll();
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views.front().frame.stamp_ns, StampNs(3.2));
  EXPECT_TRUE(views.front().candidates.front().has_settled);
  EXPECT_EQ(settling_.size(), 0U);
}

TEST_F(SettlingReportsTest, AnotherPassOfOneClassAndPlaceIsTheSameHazardAndLeavesItsView) {
  EXPECT_TRUE(Add(3, ViewOf(3, 1)));
  EXPECT_FALSE(Add(3.2, ViewOf(3.2, 2)));
  EXPECT_TRUE(Add(3.2, ViewOf(3.2, 3, 300)));
  const std::vector<WaitingFrame> views = settling_.TakeAll();
  ASSERT_THAT(views, SizeIs(2));
  EXPECT_EQ(views.front().candidates.front().pass, 1U);
  EXPECT_EQ(views.front().frame.stamp_ns, StampNs(3));
}

TEST_F(SettlingReportsTest, OneThatIsDueStaysUntilItsPictureIsThereAndTakesNoNewerSight) {
  Add(3, See(3));
  has_pictures_ = false;
  EXPECT_EQ(WorkOff(5, 3), 0U);
  EXPECT_FALSE(Add(5, See(3.2)));
  ASSERT_EQ(settling_.size(), 1U);
  has_pictures_ = true;
  EXPECT_EQ(WorkOff(5.1, 3.2), 1U);
}

TEST_F(SettlingReportsTest, PicturesGoToTheHazardThatOrderedThem) {
  Add(3, See(3));
  settling_.WorkOff(passes_, StampNs(3), 5, steady_s_, [](WaitingFrame& view) {
    view.order = 7;
    return false;
  });
  std::vector<imaging::CroppedPicture> pictures(1);
  EXPECT_FALSE(settling_.AddPictures(8, pictures));
  EXPECT_THAT(pictures, SizeIs(1));
  EXPECT_TRUE(settling_.AddPictures(7, pictures));
  EXPECT_TRUE(settling_.TakeAll().front().pictures.has_value());
}

}  // namespace
}  // namespace livemap::vehicle
