#include "common/text.h"

#include <gtest/gtest.h>

#include "common/log_odds.h"

namespace livemap {
namespace {

TEST(CutUtf8, ShortTextStaysAsItIs) {
  EXPECT_EQ(CutUtf8("", 3), "");
  EXPECT_EQ(CutUtf8("cone", 4), "cone");
}

TEST(CutUtf8, LongTextIsCutWhereACharacterBegins) {
  EXPECT_EQ(CutUtf8("cones", 4), "cone");
  const std::string text = "a\xc3\xa4\xe2\x82\xac\xf0\x9f\x9a\xa7";  // Of 1, 2, 3 and 4 bytes.
  EXPECT_EQ(CutUtf8(text, 2), "a");
  EXPECT_EQ(CutUtf8(text, 3), "a\xc3\xa4");
  EXPECT_EQ(CutUtf8(text, 5), "a\xc3\xa4");
  EXPECT_EQ(CutUtf8(text, 9), "a\xc3\xa4\xe2\x82\xac");
  EXPECT_EQ(CutUtf8(text, 10), text);
}

TEST(CutUtf8, TextThatIsNoUtf8MayVanish) { EXPECT_EQ(CutUtf8("\x80\x80\x80\x80", 2), ""); }

TEST(LogOdds, AreTheInverseOfTheirProbability) {
  EXPECT_DOUBLE_EQ(ProbabilityOf(0), 0.5);
  EXPECT_NEAR(LogOddsOf(0.95), std::log(19), 1e-12);
  for (const double p : {0.001, 0.3, 0.5, 0.999})
    EXPECT_NEAR(ProbabilityOf(LogOddsOf(p)), p, 1e-12);
}

}  // namespace
}  // namespace livemap
