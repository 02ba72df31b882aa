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

TEST(DirectoryOffersTest, AllAreTakenOnceAsTheyCame) {
  DirectoryOffers offers;
  EXPECT_EQ(offers.Put("west", View("forged")), std::nullopt);
  EXPECT_EQ(offers.Put("east", View("other")), std::nullopt);
  EXPECT_EQ(offers.Put("west", View("true")), std::nullopt);
  EXPECT_THAT(offers.Take(),
              ElementsAre(Pair("west", "forged"), Pair("east", "other"), Pair("west", "true")));
  EXPECT_THAT(offers.Take(), IsEmpty());
}

TEST(DirectoryOffersTest, AZoneThatSendsTooManyPushesOutNoOtherZones) {
  DirectoryOffers offers;
  for (std::size_t i = 0; i < DirectoryOffers::kMostOfAZone; ++i) {
    EXPECT_EQ(offers.Put("west", View("one of many")), std::nullopt);
  }
  EXPECT_THAT(offers.Put("west", View("one too many")), Optional(HasSubstr("at most 4")));
  EXPECT_EQ(offers.Put("east", View("other")), std::nullopt);
  EXPECT_EQ(offers.Take().size(), DirectoryOffers::kMostOfAZone + 1);
  EXPECT_EQ(offers.Put("west", View("again")), std::nullopt);
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
