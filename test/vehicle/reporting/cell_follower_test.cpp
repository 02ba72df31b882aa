#include "vehicle/reporting/cell_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::vehicle {
namespace {

const geo::GeoPoint kTown{48.1, 11.5};

CellFollower::Knowledge KnowsUpTo7(const std::string& /*zone*/, const geo::MapCell& /*cell*/) {
  return {7, false};
}
CellFollower::Knowledge HasGap(const std::string& /*zone*/, const geo::MapCell& /*cell*/) {
  return {7, true};
}

bool Wants(const CellFollower& follower, const geo::GeoPoint& place) {
  const auto& wanted = follower.wanted();
  return std::find(wanted.begin(), wanted.end(), geo::MapCell::At(place)) != wanted.end();
}

geo::GeoPoint EastOfTown(double east_m) {
  return geo::GeodesicDestination(kTown, 1.5707963, east_m);
}

TEST(CellFollowerTest, WantsTheCellsAroundTheVehicleAndChangesThemAsItDrives) {
  CellFollower follower({});
  EXPECT_TRUE(follower.wanted().empty());
  EXPECT_TRUE(follower.MoveTo(kTown));
  EXPECT_TRUE(Wants(follower, kTown));
  EXPECT_TRUE(Wants(follower, EastOfTown(1499)));
  EXPECT_FALSE(Wants(follower, EastOfTown(4000)));
  EXPECT_FALSE(follower.MoveTo(kTown));
  for (double east_m = 0; east_m <= 6000; east_m += 10) follower.MoveTo(EastOfTown(east_m));
  EXPECT_FALSE(Wants(follower, kTown));
  EXPECT_TRUE(Wants(follower, EastOfTown(7499)));
}

TEST(CellFollowerTest, AVehicleThatWaversAtAnEdgeChangesNothing) {
  CellFollower follower({});
  follower.MoveTo(kTown);
  // Until a cell comes in; within the hysteresis it stays.
  double east_m = 0;
  while (!follower.MoveTo(EastOfTown(east_m))) east_m += 1;
  for (int i = 0; i < 20; ++i) {
    EXPECT_FALSE(follower.MoveTo(EastOfTown(east_m + (i % 2 == 0 ? -150 : 0))));
  }
}

TEST(CellFollowerTest, NeverWantsMoreCellsThanItMay) {
  CellFollower::Config config;
  config.max_cells = 20;
  CellFollower follower(config);
  for (double latitude = 60; latitude <= 90; latitude += 0.02) {
    follower.MoveTo({latitude, 10});
    ASSERT_LE(follower.wanted().size(), 20U);
  }
  EXPECT_TRUE(Wants(follower, {90, 10}));
}

TEST(CellFollowerTest, WithoutARadiusItWantsNothing) {
  CellFollower::Config config;
  config.radius_m = 0;
  CellFollower follower(config);
  EXPECT_FALSE(follower.MoveTo(kTown));
  EXPECT_TRUE(follower.wanted().empty());
}

TEST(CellFollowerTest, AsksOnceForWhatItHearsOf) {
  CellFollower follower({});
  follower.MoveTo(kTown);
  EXPECT_TRUE(follower.TakeDue(0, KnowsUpTo7).empty()) << "the broker has granted nothing yet";
  follower.SetHeard("west", follower.wanted());
  const auto requests = follower.TakeDue(1, KnowsUpTo7);
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_EQ(requests.front().zone, "west");
  ASSERT_EQ(requests.front().cells.size(), follower.wanted().size());
  EXPECT_EQ(requests.front().cells.front().sequence, 7U);
  EXPECT_TRUE(follower.TakeDue(2, KnowsUpTo7).empty());
}

TEST(CellFollowerTest, AsksAgainWhereNobodyAnswersAndLessAndLessOften) {
  CellFollower follower({});
  follower.SetHeard("west", {geo::MapCell::At(kTown)});
  std::vector<double> asked_s;
  for (double now_s = 0; now_s < 200; now_s += 1) {
    if (!follower.TakeDue(now_s, KnowsUpTo7).empty()) asked_s.push_back(now_s);
  }
  EXPECT_EQ(asked_s, (std::vector<double>{0, 20, 60, 120, 180}));
  EXPECT_EQ(follower.unanswered(), 1U);
}

TEST(CellFollowerTest, AsksAgainFromTimeToTime) {
  CellFollower follower({});
  follower.SetHeard("west", {geo::MapCell::At(kTown)});
  follower.TakeDue(0, KnowsUpTo7);
  follower.NoteAnswer("west", geo::MapCell::At(kTown), 1);
  EXPECT_EQ(follower.unanswered(), 0U);
  EXPECT_TRUE(follower.TakeDue(60, KnowsUpTo7).empty());
  EXPECT_EQ(follower.TakeDue(61, KnowsUpTo7).size(), 1U);
}

TEST(CellFollowerTest, AsksWhereAnAnnouncementIsMissingAfterAMoment) {
  CellFollower follower({});
  follower.SetHeard("west", {geo::MapCell::At(kTown)});
  follower.TakeDue(0, KnowsUpTo7);
  follower.NoteAnswer("west", geo::MapCell::At(kTown), 1);
  EXPECT_TRUE(follower.TakeDue(12, HasGap).empty()) << "it may come yet";
  EXPECT_TRUE(follower.TakeDue(12.5, KnowsUpTo7).empty()) << "it came";
  EXPECT_TRUE(follower.TakeDue(13, HasGap).empty());
  EXPECT_EQ(follower.TakeDue(14, HasGap).size(), 1U);
  EXPECT_TRUE(follower.TakeDue(15.1, HasGap).empty()) << "the answer is on its way";
}

TEST(CellFollowerTest, AGapThatTheAnswerLeavesOpenIsNotAskedAboutAtOnce) {
  CellFollower follower({});
  follower.SetHeard("west", {geo::MapCell::At(kTown)});
  follower.TakeDue(0, HasGap);
  std::size_t questions = 0;
  for (double now_s = 0.5; now_s < 60; now_s += 0.5) {
    follower.NoteAnswer("west", geo::MapCell::At(kTown), now_s);
    for (double later_s = now_s; later_s < now_s + 4.9; later_s += 0.5) {
      questions += follower.TakeDue(later_s, HasGap).size();
    }
  }
  EXPECT_EQ(questions, 0U);
}

TEST(CellFollowerTest, AsksForAllAfterTheConnectionWasLost) {
  CellFollower follower({});
  const std::vector<geo::MapCell> cells{geo::MapCell::At(kTown)};
  follower.SetHeard("west", cells);
  follower.TakeDue(0, KnowsUpTo7);
  follower.NoteAnswer("west", cells.front(), 1);
  follower.SetHeard("west", cells);
  EXPECT_TRUE(follower.TakeDue(2, KnowsUpTo7).empty()) << "nothing was lost";
  follower.SetHeard("west", {});
  EXPECT_TRUE(follower.TakeDue(3, KnowsUpTo7).empty());
  follower.SetHeard("west", cells);
  EXPECT_EQ(follower.TakeDue(4, KnowsUpTo7).size(), 1U);
}

TEST(CellFollowerTest, AsksAgainWhereTheZoneWantsIt) {
  CellFollower follower({});
  const std::vector<geo::MapCell> cells{geo::MapCell::At(kTown)};
  follower.SetHeard("west", cells);
  EXPECT_EQ(follower.TakeDue(0, KnowsUpTo7).size(), 1U);
  follower.AskAgain("west");
  EXPECT_TRUE(follower.TakeDue(4.9, KnowsUpTo7).empty()) << "it has just asked";
  follower.NoteAnswer("west", cells.front(), 1);
  follower.AskAgain("east");
  EXPECT_TRUE(follower.TakeDue(2, KnowsUpTo7).empty());
  follower.AskAgain("west");
  EXPECT_TRUE(follower.TakeDue(5.9, KnowsUpTo7).empty())
      << "a zone cannot make it ask all the time";
  EXPECT_EQ(follower.TakeDue(6, KnowsUpTo7).size(), 1U);
  follower.NoteAnswer("west", cells.front(), 7);
  follower.AskAgain("west");
  EXPECT_EQ(follower.TakeDue(20, KnowsUpTo7).size(), 1U) << "long after the answer at once";
}

TEST(CellFollowerTest, AZoneThatLostAQuestionIsAskedAgainSoonerThanOneThatIsSlow) {
  CellFollower follower({});
  follower.SetHeard("west", {geo::MapCell::At(kTown)});
  EXPECT_EQ(follower.TakeDue(0, KnowsUpTo7).size(), 1U);
  follower.AskAgain("west");
  follower.AskAgain("west");
  EXPECT_TRUE(follower.TakeDue(4.9, KnowsUpTo7).empty());
  EXPECT_EQ(follower.TakeDue(5, KnowsUpTo7).size(), 1U);
  EXPECT_TRUE(follower.TakeDue(14.9, KnowsUpTo7).empty()) << "nobody wants to be asked any more";
}

TEST(CellFollowerTest, EachZoneIsAskedForItself) {
  CellFollower follower({});
  const std::vector<geo::MapCell> cells{geo::MapCell::At(kTown)};
  follower.SetHeard("west", cells);
  follower.SetHeard("east", cells);
  const auto requests = follower.TakeDue(0, KnowsUpTo7);
  ASSERT_EQ(requests.size(), 2U);
  EXPECT_EQ(requests[0].zone, "east");
  EXPECT_EQ(requests[1].zone, "west");
  follower.NoteAnswer("east", cells.front(), 1);
  EXPECT_EQ(follower.unanswered(), 1U);
  EXPECT_EQ(follower.heard(), 2U);
}

TEST(CellFollowerTest, AZoneThatWasLeftIsNotAskedUntilTheVehicleIsBack) {
  CellFollower follower({});
  const std::vector<geo::MapCell> cells{geo::MapCell::At(kTown)};
  follower.SetHeard("west", cells);
  follower.SetHeard("east", cells);
  follower.SetZones({"east"});
  const auto requests = follower.TakeDue(0, KnowsUpTo7);
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_EQ(requests.front().zone, "east");
  follower.SetZones({"east", "west"});
  EXPECT_EQ(follower.TakeDue(1, KnowsUpTo7).size(), 1U);
}

TEST(CellFollowerTest, ImpossibleConfigurationsAreRefused) {
  CellFollower::Config config;
  config.refresh_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(CellFollower{config}, Error);
  config = {};
  config.max_cells = 65;
  EXPECT_THROW(CellFollower{config}, Error);
}

}  // namespace
}  // namespace livemap::vehicle
