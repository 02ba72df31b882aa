#include "zone/places/place_book.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

const geo::GeoPoint kPlaceBookOrigin{40.44, -79.94};
/// Sixteen hours from Pittsburgh at the greatest speed.
const geo::GeoPoint kLondon{51.51, -0.13};

class PlaceBookTest : public ZoneTest {
 protected:
  PlaceBookTest() {
    std::filesystem::create_directories(directory_ + "/zone");
    store_ = std::make_unique<ZoneStore>(Database());
  }

  /// Whether the vehicle can have been there, for a batch that is committed.
  bool Reports(PlaceBook& book, const std::string& vehicle, std::int64_t stamp_ns,
               const geo::GeoPoint& place = kPlaceBookOrigin) {
    const PlaceBook::Drafts drafts(book);
    const bool accepted = !book.Challenge(vehicle, {stamp_ns, place, 1});
    Commit(book, stamp_ns);
    return accepted;
  }
  void Commit(PlaceBook& book, std::int64_t now_ns) {
    store_->Begin();
    book.Save(now_ns);
    store_->Commit();
    book.Keep(now_ns);
  }
  /// A position is believed.
  static bool IsAt(PlaceBook& book, const std::string& vehicle, std::int64_t stamp_ns,
                   const geo::GeoPoint& place = kPlaceBookOrigin) {
    return !book.ChallengePosition({vehicle, "", place, 0, 0, stamp_ns, stamp_ns, 1});
  }
  std::size_t Rows(const std::string& vehicle) { return store_->FindPlaces(vehicle, 1000).size(); }
  void WriteRow(const std::string& vehicle, std::int64_t stamp_ns) {
    store_->WritePlace(vehicle, {{stamp_ns, kPlaceBookOrigin, 1}, 1, true});
  }

  PlaceBook::Config config_;
  std::unique_ptr<ZoneStore> store_;
};

TEST_F(PlaceBookTest, APositionThatComesWhileABatchIsCommittedIsKnownAfterIt) {
  PlaceBook book(config_, *store_);
  {
    const PlaceBook::Drafts drafts(book);
    EXPECT_FALSE(book.Challenge("car-1", {kNowNs - 20 * kOneHour, kPlaceBookOrigin, 1}));
    EXPECT_TRUE(IsAt(book, "car-1", kNowNs));
    Commit(book, kNowNs);
  }
  // The report is twenty hours away, the position a second.
  EXPECT_FALSE(Reports(book, "car-1", kNowNs + kOneSecond, kLondon));
}

TEST_F(PlaceBookTest, AFailedCommitLosesTheBatchesPlacesAndNoPosition) {
  PlaceBook book(config_, *store_);
  {
    const PlaceBook::Drafts drafts(book);
    EXPECT_FALSE(book.Challenge("car-1", {kNowNs - 20 * kOneHour, kPlaceBookOrigin, 1}));
    EXPECT_TRUE(IsAt(book, "car-1", kNowNs));
  }
  EXPECT_FALSE(Reports(book, "car-1", kNowNs + kOneSecond, kLondon));
  EXPECT_TRUE(Reports(book, "car-1", kNowNs - 20 * kOneHour + kOneSecond, kLondon));
}

TEST_F(PlaceBookTest, APositionIsComparedWithWhatTheBatchHasTriedSoFar) {
  PlaceBook book(config_, *store_);
  const PlaceBook::Drafts drafts(book);
  EXPECT_FALSE(book.Challenge("car-1", {kNowNs, kPlaceBookOrigin, 1}));
  EXPECT_FALSE(IsAt(book, "car-1", kNowNs + kOneSecond, kLondon));
}

TEST_F(PlaceBookTest, TheStoredPastOfAForgottenVehicleCountsAlsoWhenItsPositionCameFirst) {
  config_.max_vehicles = 1;
  PlaceBook book(config_, *store_);
  EXPECT_TRUE(Reports(book, "car-1", kNowNs - 40 * kOneHour));
  EXPECT_TRUE(Reports(book, "car-2", kNowNs - 30 * kOneHour)) << "in the place of car-1";
  EXPECT_TRUE(IsAt(book, "car-1", kNowNs - 20 * kOneHour));
  // The position is twenty hours away, what is stored a second.
  EXPECT_FALSE(Reports(book, "car-1", kNowNs - 40 * kOneHour + kOneSecond, kLondon));
  EXPECT_TRUE(Reports(book, "car-1", kNowNs - 20 * kOneHour + kOneSecond));
}

TEST_F(PlaceBookTest, AForgottenVehicleHasNoMorePlacesStoredThanOneThatIsKnown) {
  config_.max_vehicles = 1;
  PlaceBook book(config_, *store_);
  for (int round = 0; round < 3; ++round) {
    const std::int64_t start_ns = kNowNs + round * 10 * kOneHour;
    for (int i = 0; i < 200; ++i) {
      EXPECT_TRUE(Reports(book, "car-1", start_ns + i * 10 * kOneSecond));
    }
    EXPECT_TRUE(Reports(book, "car-2", start_ns + 9 * kOneHour)) << "in the place of car-1";
    EXPECT_TRUE(IsAt(book, "car-1", start_ns + 9 * kOneHour));
    EXPECT_LE(Rows("car-1"), ReportTrack::kMaxPlaces);
  }
}

TEST_F(PlaceBookTest, OfTooManyStoredPlacesTheNewestAreLoadedAndTheOthersAreDropped) {
  config_.limits.max_age_s = 1e9;
  store_->Begin();
  for (int i = 0; i < 200; ++i) WriteRow("car-1", kNowNs + i * kOneHour);
  store_->Commit();
  PlaceBook book(config_, *store_);
  book.Load();
  EXPECT_FALSE(IsAt(book, "car-1", kNowNs + 199 * kOneHour + kOneSecond, kLondon));
  book.ForgetOld(kNowNs + 200 * kOneHour);
  EXPECT_EQ(Rows("car-1"), ReportTrack::kMaxPlaces);
  EXPECT_EQ(store_->FindPlaces("car-1", 1000).back().fix.stamp_ns, kNowNs + 72 * kOneHour);
}

TEST_F(PlaceBookTest, OldPlacesAreForgottenButTheNewestOfEachVehicle) {
  store_->Begin();
  for (int i = 0; i < 250; ++i) {
    const std::string vehicle = "car-" + std::to_string(i);
    WriteRow(vehicle, kNowNs - 40 * kOneDay);
    WriteRow(vehicle, kNowNs - 35 * kOneDay);
    if (i % 2 == 0) WriteRow(vehicle, kNowNs - kOneDay);
  }
  store_->Commit();
  PlaceBook book(config_, *store_);
  book.Load();
  for (int call = 0; call < 3; ++call) book.ForgetOld(kNowNs);
  for (int i = 0; i < 250; ++i) {
    const std::string vehicle = "car-" + std::to_string(i);
    const auto places = store_->FindPlaces(vehicle, 10);
    ASSERT_EQ(places.size(), 1U) << vehicle;
    EXPECT_EQ(places[0].fix.stamp_ns, kNowNs - (i % 2 == 0 ? 1 : 35) * kOneDay);
    EXPECT_TRUE(book.HasHeardOf(vehicle));
  }
  EXPECT_TRUE(Reports(book, "car-1", kNowNs));
  EXPECT_EQ(Rows("car-1"), 1U) << "the newest is another one now";
}

TEST_F(PlaceBookTest, AReportFromAKnownPlaceIsCountedWithTheNextSweep) {
  const auto count = [this] { return store_->FindPlaces("car-1", 1).at(0).count; };
  PlaceBook book(config_, *store_);
  EXPECT_TRUE(Reports(book, "car-1", kNowNs));
  EXPECT_TRUE(Reports(book, "car-1", kNowNs + kOneSecond));
  EXPECT_TRUE(Reports(book, "car-1", kNowNs + 2 * kOneSecond));
  EXPECT_EQ(count(), 1U) << "the place itself did not change";
  book.SaveCounts();
  EXPECT_EQ(count(), 3U);
  store_->WritePlace("car-1", {{kNowNs, kPlaceBookOrigin, 1}, 7, true});
  book.SaveCounts();
  EXPECT_EQ(count(), 7U) << "what is saved is not written again";
}

TEST_F(PlaceBookTest, CountsThatTheStoreDidNotTakeAreSavedByTheNextSweep) {
  PlaceBook book(config_, *store_);
  EXPECT_TRUE(Reports(book, "car-1", kNowNs));
  EXPECT_TRUE(Reports(book, "car-1", kNowNs + kOneSecond));
  {
    StoreProbe other = Probe();
    other.Refuse("UPDATE", "places", "no");
    EXPECT_THROW(book.SaveCounts(), StoreError);
    other.Accept("places");
  }
  book.SaveCounts();
  EXPECT_EQ(store_->FindPlaces("car-1", 1).at(0).count, 2U);
}

TEST_F(PlaceBookTest, AVehicleOfWhichThereAreStoredPlacesAloneWasHeardOf) {
  WriteRow("car-1", kNowNs);
  const PlaceBook book(config_, *store_);
  EXPECT_TRUE(book.HasHeardOf("car-1"));
  EXPECT_FALSE(book.HasHeardOf("car-2"));
}

}  // namespace
}  // namespace livemap::zone
