#include "streets/turn_habit.h"

#include <gtest/gtest.h>

namespace livemap::streets {
namespace {

TEST(TurnHabitTest, BeforeAnyJunctionADriverIsLikeAllOthers) {
  EXPECT_DOUBLE_EQ(TurnHabit({}).factor(), 1);
}

TEST(TurnHabitTest, WhoPassesCrossingAfterCrossingIsExpectedToGoOnStraight) {
  TurnHabit habit({});
  for (int i = 0; i < 100; ++i) habit.Passed(false);
  EXPECT_LT(habit.factor(), 0.3);
  EXPECT_GT(habit.factor(), 0.05) << "anyone may turn";
}

TEST(TurnHabitTest, WhoTurnsAsOftenAsOthersIsExpectedToDoSo) {
  TurnHabit habit({});
  for (int i = 0; i < 96; ++i) habit.Passed(i % 8 == 1 || i % 8 == 4 || i % 8 == 6);
  EXPECT_NEAR(habit.factor(), 1, 0.25);
}

TEST(TurnHabitTest, LaterJunctionsCountMore) {
  TurnHabit first_turns({});
  TurnHabit last_turns({});
  for (int i = 0; i < 10; ++i) {
    first_turns.Passed(i < 5);
    last_turns.Passed(i >= 5);
  }
  EXPECT_LT(first_turns.factor(), last_turns.factor());
}

TEST(TurnHabitTest, ANewBeginForgetsTheJunctions) {
  TurnHabit habit({});
  habit.Passed(true);
  EXPECT_GT(habit.factor(), 1);
  habit.Reset();
  EXPECT_DOUBLE_EQ(habit.factor(), 1);
}

}  // namespace
}  // namespace livemap::streets
