#include "region/region_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "test/region/told_hazards.h"
#include "test/support/temporary_directory.h"

namespace livemap::region {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class RegionStoreTest : public testing::Test {
 protected:
  std::string path() const { return folder_.path() + "/region.sqlite3"; }

  test::TemporaryDirectory folder_;
  const protocol::HazardCatalogue catalogue_{};
};

TEST_F(RegionStoreTest, HasWhatWasKeptOfEachZone) {
  {
    RegionStore store(path(), catalogue_, kNowNs);
    store.Save("north", {IdOf(9), 5, kNowNs}, {Told(1, 4), Told(2, 5)}, {});
    store.Save("south", {IdOf(8), 7, kNowNs - 1}, {Told(1, 7)}, {});
    store.Save("north", {IdOf(9), 7, kNowNs}, {ToldGone(1, 6), Told(3, 7)}, {IdOf(2)});
  }
  const RegionStore store(path(), catalogue_, kNowNs);
  const auto north = store.Load("north", kNowNs);
  EXPECT_EQ(north.place.log, IdOf(9));
  EXPECT_EQ(north.place.sequence, 7U);
  EXPECT_EQ(north.place.heard_ns, kNowNs);
  ASSERT_THAT(north.hazards, SizeIs(1));
  EXPECT_EQ(north.hazards[0].hazard.uuid, IdOf(3));
  EXPECT_EQ(north.hazards[0].words.street, "Forbes Ave");
  EXPECT_THAT(store.Load("south", kNowNs).hazards, SizeIs(1));
  EXPECT_THAT(store.Load("east", kNowNs).hazards, IsEmpty());
  EXPECT_EQ(store.Load("east", kNowNs).place.heard_ns, 0);
}

TEST_F(RegionStoreTest, AZoneWithARowThatNoZoneCanHaveToldIsReadAnew) {
  RegionStore store(path(), catalogue_, kNowNs);
  store.Save("north", {IdOf(9), 5, kNowNs}, {Told(1, 4), Told(2, 5)}, {});
  SqliteDatabase other(path(), false);
  other.Execute("UPDATE hazards SET feature = '{}' WHERE uuid = '" + IdOf(1).ToString() + "'");
  const auto north = store.Load("north", kNowNs);
  EXPECT_TRUE(north.place.log.IsNil());
  EXPECT_THAT(north.hazards, SizeIs(1));
}

TEST_F(RegionStoreTest, NobodyWasHeardInTheFuture) {
  RegionStore store(path(), catalogue_, kNowNs);
  store.Save("north", {IdOf(9), 5, kNowNs + 1}, {}, {});
  EXPECT_EQ(store.Load("north", kNowNs).place.heard_ns, 0);
}

TEST_F(RegionStoreTest, ADamagedFileIsPutAsideAndBegunAnew) {
  std::ofstream(path()) << std::string(8192, 'x');
  RegionStore store(path(), catalogue_, kNowNs);
  EXPECT_THAT(store.damage(), HasSubstr("all zones are read anew"));
  store.Save("north", {IdOf(9), 5, kNowNs}, {Told(1, 4)}, {});
  EXPECT_THAT(store.Load("north", kNowNs).hazards, SizeIs(1));
}

}  // namespace
}  // namespace livemap::region
