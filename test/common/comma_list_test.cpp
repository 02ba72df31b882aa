#include "common/comma_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace livemap {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(SplitAtCommas, PartsHaveNoBlanksAround) {
  EXPECT_THAT(SplitAtCommas("10.0.0.1,10.0.0.2"), ElementsAre("10.0.0.1", "10.0.0.2"));
  EXPECT_THAT(SplitAtCommas(" a b ,\tc\n"), ElementsAre("a b", "c"));
}

TEST(SplitAtCommas, AnEmptyPartIsKeptSoThatWhoReadsItCanRefuseIt) {
  EXPECT_THAT(SplitAtCommas(",a, ,b"), ElementsAre("", "a", "", "b"));
}

TEST(SplitAtCommas, NothingFollowsTheLastComma) {
  EXPECT_THAT(SplitAtCommas("a,"), ElementsAre("a"));
  EXPECT_THAT(SplitAtCommas("a, "), ElementsAre("a"));
  EXPECT_THAT(SplitAtCommas(","), ElementsAre(""));
}

TEST(SplitAtCommas, NothingHasNoParts) {
  EXPECT_THAT(SplitAtCommas(""), IsEmpty());
  EXPECT_THAT(SplitAtCommas(" \n"), IsEmpty());
}

}  // namespace
}  // namespace livemap
