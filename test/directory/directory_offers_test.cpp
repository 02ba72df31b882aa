#include "directory/directory_offers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "directory/directory_keeper.h"

namespace livemap::directory {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Optional;
using testing::Pair;

transport::ByteView View(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

TEST(DirectoryOffersTest, TheLastOneOfEachZoneIsTakenOnce) {
  DirectoryOffers offers;
  EXPECT_EQ(offers.Put("west", View("first")), std::nullopt);
  EXPECT_EQ(offers.Put("east", View("other")), std::nullopt);
  EXPECT_EQ(offers.Put("west", View("second")), std::nullopt);
  EXPECT_THAT(offers.Take(), ElementsAre(Pair("east", "other"), Pair("west", "second")));
  EXPECT_THAT(offers.Take(), IsEmpty());
}

TEST(DirectoryOffersTest, WhatIsLargerThanAnyDirectoryIsRefusedAndLeavesWhatCameBefore) {
  DirectoryOffers offers;
  EXPECT_EQ(offers.Put("west", View("small")), std::nullopt);
  const std::string large(DirectoryKeeper::kMaxBytes + 1, 'x');
  EXPECT_THAT(offers.Put("west", View(large)), Optional(HasSubstr("accepted are at most 2113536")));
  EXPECT_THAT(offers.Take(), ElementsAre(Pair("west", "small")));
}

}  // namespace
}  // namespace livemap::directory
