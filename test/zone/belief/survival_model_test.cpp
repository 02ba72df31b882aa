#include "zone/belief/survival_model.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

#include "common/error.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kDayS = 86400;

protocol::HazardCatalogue LivesCatalogue() {
  return protocol::HazardCatalogue::Parse("classes: {cone: {expected_life_s: 172800}}", "test");
}

TEST(ClassSurvival, FallsFromOneToNothingAndNeverRises) {
  const ClassSurvival survival{3, 2 * kDayS};
  double before = 1;
  EXPECT_EQ(survival.Survival(0, 0), 1);
  EXPECT_EQ(survival.Survival(0, -5), 1);
  for (double dt_s = 1; dt_s < 1e9; dt_s *= 3) {
    const double standing = survival.Survival(kDayS, dt_s);
    EXPECT_LT(standing, before);
    EXPECT_GT(standing, 0);
    before = standing;
  }
  EXPECT_LT(before, 1e-6);
}

TEST(ClassSurvival, ManyShortStepsGiveWhatOneLongStepGives) {
  const ClassSurvival survival{3, 2 * kDayS};
  double product = 1;
  for (int i = 0; i < 1000; ++i) product *= survival.Survival(i * 100.0, 100.0);
  EXPECT_NEAR(product, survival.Survival(0, 1e5), 1e-12);
}

TEST(ClassSurvival, WhatStoodForLongIsExpectedToStandForLonger) {
  const ClassSurvival survival{3, 2 * kDayS};
  EXPECT_GT(survival.Survival(30 * kDayS, kDayS), survival.Survival(0, kDayS));
}

TEST(ClassSurvival, TimeToIsTheInverseOfSurvival) {
  const ClassSurvival survival{2.5, 500};
  for (const double probability : {1.0, 0.9, 0.5, 0.01}) {
    EXPECT_NEAR(survival.Survival(70, survival.TimeTo(probability, 70)), probability, 1e-12);
  }
}

TEST(ClassSurvival, ExpectedTimeStandingIsTheIntegralOfSurvival) {
  const ClassSurvival survival{4, 1000};
  double integral = 0;
  for (int i = 0; i < 200000; ++i) integral += survival.Survival(50, (i + 0.5) * 0.01) * 0.01;
  EXPECT_NEAR(survival.ExpectedTimeStanding(50, 2000), integral, 1e-3);
  EXPECT_NEAR(survival.ExpectedTimeStanding(0, 1e15), survival.MeanLifeS(), 1e-3);
}

TEST(SurvivalModel, StartsFromTheCataloguesExpectedLife) {
  const SurvivalModel model(LivesCatalogue());
  EXPECT_NEAR(model.Of("cone").MeanLifeS(), 2 * kDayS, 1e-6);
  EXPECT_NEAR(model.Of("meteorite").MeanLifeS(), kDayS, 1e-6) << "the defaults' life";
}

TEST(SurvivalModel, LearnsTheTrueLifeAlsoFromOnesThatStillStand) {
  SurvivalModel model(LivesCatalogue());
  std::mt19937_64 generator(1);
  std::exponential_distribution<double> life(1 / (6 * kDayS));
  // Watched for three days each: four in ten end in this time, the others still stand.
  for (int i = 0; i < 3000; ++i) {
    const double life_s = life(generator);
    model.Learn("cone", {std::min(life_s, 3 * kDayS), life_s < 3 * kDayS});
  }
  // 50 remembered lives: a standard error of a seventh.
  EXPECT_NEAR(model.Of("cone").MeanLifeS(), 6 * kDayS, 0.3 * 6 * kDayS);
}

TEST(SurvivalModel, StandingHazardsLengthenTheLifeWithoutAnyEnd) {
  SurvivalModel model(LivesCatalogue());
  model.Learn("cone", {20 * kDayS, false});
  EXPECT_GT(model.Of("cone").MeanLifeS(), 6 * kDayS);
  EXPECT_EQ(model.Of("cone").shape, SurvivalModel(LivesCatalogue()).Of("cone").shape);
}

TEST(SurvivalModel, RemembersABoundedNumberOfLivesAndFollowsNewHabits) {
  SurvivalModel model(LivesCatalogue(), {4, 50});
  for (int i = 0; i < 500; ++i) model.Learn("cone", {2 * kDayS, true});
  for (int i = 0; i < 500; ++i) model.Learn("cone", {8 * kDayS, true});
  EXPECT_LE(model.learned().at("cone").ended, 50);
  EXPECT_NEAR(model.Of("cone").MeanLifeS(), 8 * kDayS, 0.8 * kDayS);
}

TEST(SurvivalModel, RestoredGivesTheSameSurvival) {
  SurvivalModel model(LivesCatalogue());
  model.Learn("cone", {3 * kDayS, true});
  SurvivalModel restored(LivesCatalogue());
  restored.Restore("cone", model.learned().at("cone"));
  EXPECT_EQ(restored.Of("cone").shape, model.Of("cone").shape);
  EXPECT_EQ(restored.Of("cone").scale_s, model.Of("cone").scale_s);
}

TEST(SurvivalModel, RefusesStoredNumbersThatCannotBe) {
  SurvivalModel model(LivesCatalogue());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const LearnedLifetime& learned : {LearnedLifetime{-1, 0}, LearnedLifetime{nan, 0},
                                         LearnedLifetime{1, nan}, LearnedLifetime{0, -5}}) {
    EXPECT_THAT([&] { model.Restore("cone", learned); }, ThrowsMessage<Error>(HasSubstr("'cone'")));
  }
}

TEST(SurvivalModel, IgnoresLessonsThatCannotBe) {
  SurvivalModel model(LivesCatalogue());
  model.Learn("cone", {std::numeric_limits<double>::quiet_NaN(), true});
  model.Learn("cone", {-1, true});
  model.Learn("cone", {0, false});
  EXPECT_TRUE(model.learned().empty());
}

}  // namespace
}  // namespace livemap::zone
