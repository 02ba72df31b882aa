// Two processes of one zone on one server of PostgreSQL: who may write, and what becomes of who may
// no longer. That the time of a lease passes is written into its row.
#include "zone/store/zone_lease.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <memory>
#include <string>
#include <utility>

#include "common/error.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kLongS = 3600;

class ZoneLeaseTest : public PostgresqlZoneTest {
 protected:
  std::shared_ptr<ZoneLease> MakeLease(const std::string& holder) const {
    return std::make_shared<ZoneLease>(ZoneLease::Config{url_, holder, kLongS});
  }
  /// As the database's clock does it.
  void LetLeaseEnd() {
    StoreProbe(url_).Execute("UPDATE livemap_lease SET valid_until = clock_timestamp()");
  }
  std::unique_ptr<ZoneService> MakeZone(const std::string& name,
                                        std::shared_ptr<const ZoneLease> lease) const {
    ZoneService::Config config = Config();
    config.directory = directory_ + "/" + name;
    config.store_url = url_;
    config.lease = std::move(lease);
    return std::make_unique<ZoneService>(config, Clock(), 9);
  }
  double Count(const std::string& table) const {
    return StoreProbe(url_).Number("SELECT count(*) FROM " + table);
  }
};

std::string WhyHandlingFailed(ZoneService& zone, const protocol::Report& report) {
  try {
    zone.Handle(report);
  } catch (const StoreError& error) {
    return error.what();
  }
  return "";
}

TEST_F(ZoneLeaseTest, OfTwoProcessesOneTakesTheLease) {
  const auto first = MakeLease("first");
  const auto second = MakeLease("second");
  EXPECT_FALSE(first->IsHeld());
  EXPECT_TRUE(first->TryTake());
  EXPECT_FALSE(second->TryTake());
  EXPECT_TRUE(first->IsHeld());
  EXPECT_FALSE(second->IsHeld());
  const ZoneLease::Row row = second->Read();
  EXPECT_EQ(row.holder, "first");
  EXPECT_EQ(row.epoch, first->epoch());
  EXPECT_GT(row.valid_s, kLongS / 2);
}

TEST_F(ZoneLeaseTest, ALeaseThatIsOverIsTakenUnderTheNextEpochAndRenewedNoMore) {
  const auto first = MakeLease("first");
  const auto second = MakeLease("second");
  ASSERT_TRUE(first->TryTake());
  EXPECT_TRUE(first->Renew());
  LetLeaseEnd();
  EXPECT_TRUE(second->TryTake());
  EXPECT_EQ(second->epoch(), first->epoch() + 1);
  EXPECT_FALSE(first->Renew());
  EXPECT_FALSE(first->IsHeld());
  EXPECT_TRUE(second->Renew());
}

TEST_F(ZoneLeaseTest, ALeaseThatIsOverAndThatNobodyTookIsRenewed) {
  const auto lease = MakeLease("first");
  ASSERT_TRUE(lease->TryTake());
  LetLeaseEnd();
  EXPECT_TRUE(lease->Renew());
  EXPECT_FALSE(MakeLease("second")->TryTake());
}

TEST_F(ZoneLeaseTest, ALeaseThatWasGivenBackIsTakenAtOnce) {
  const auto first = MakeLease("first");
  ASSERT_TRUE(first->TryTake());
  first->GiveBack();
  EXPECT_FALSE(first->IsHeld());
  EXPECT_TRUE(MakeLease("second")->TryTake());
}

TEST_F(ZoneLeaseTest, AHolderThatDoesNotRenewKnowsByItsOwnClockThatTheLeaseIsOver) {
  ZoneLease lease({url_, "first", 0.05});
  ASSERT_TRUE(lease.TryTake());
  while (lease.IsHeld()) {
  }
  EXPECT_GE(lease.AgeS(), 0.05);
}

TEST_F(ZoneLeaseTest, AHolderRenewsItsLeaseAfterTheServerWasKilled) {
  const auto lease = MakeLease("first");
  ASSERT_TRUE(lease->TryTake());
  server_->Kill(SIGKILL);
  EXPECT_THROW(lease->Renew(), StoreError);
  EXPECT_TRUE(lease->IsHeld()) << "nobody can have taken it";
  server_->Start();
  EXPECT_TRUE(lease->Renew());
}

TEST_F(ZoneLeaseTest, AZoneThatLostItsLeaseCommitsNoMoreAndNoSequenceComesTwice) {
  const auto first = MakeLease("first");
  const auto second = MakeLease("second");
  ASSERT_TRUE(first->TryTake());
  const auto former = MakeZone("first", first);
  former->Handle(MakeReport({40, 8}));
  LetLeaseEnd();
  ASSERT_TRUE(second->TryTake());
  const auto present = MakeZone("second", second);
  EXPECT_EQ(present->Sequence(), former->Sequence()) << "the state was loaded";
  const protocol::Report report = MakeReport({40.01, 8});
  present->Handle(report);
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(WhyHandlingFailed(*former, MakeReport({40.02, 8})),
                AllOf(HasSubstr("lease"), HasSubstr("lost")));
  }
  EXPECT_EQ(Count("reports"), 2);
  EXPECT_EQ(Count("events"), 2);
  EXPECT_EQ(present->Handle(report).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(present->Statistics().repeated, 1U);
}

TEST_F(ZoneLeaseTest, ATransactionThatStoodStillWhileTheLeaseWasTakenWritesNothing) {
  const auto first = MakeLease("first");
  const auto second = MakeLease("second");
  ASSERT_TRUE(first->TryTake());
  ZoneStore former(url_, first->epoch());
  former.Begin();
  former.WriteTrust(1, {});
  // To the server, where the row is locked from now on.
  former.LoadAssignmentsForWriter();
  LetLeaseEnd();
  ASSERT_TRUE(second->TryTake());
  ZoneStore present(url_, second->epoch());
  present.Begin();
  present.WriteTrust(1, {});
  present.Commit();
  EXPECT_THROW(former.Commit(), StoreError);
  former.Rollback();
  EXPECT_THROW(former.Begin(), LeaseLost);
  EXPECT_EQ(Count("trust"), 1);
}

TEST_F(ZoneLeaseTest, ACommitOfAFormerHolderWhoseConnectionStandsIsRefused) {
  const auto first = MakeLease("first");
  ASSERT_TRUE(first->TryTake());
  ZoneStore former(url_, first->epoch());
  former.Begin();
  former.WriteTrust(1, {});
  StoreProbe(url_).Execute("UPDATE livemap_lease SET epoch = epoch + 1, holder = 'second'");
  EXPECT_THROW(former.Commit(), LeaseLost);
  former.Rollback();
  EXPECT_EQ(Count("trust"), 0);
}

TEST_F(ZoneLeaseTest, AZoneContinuesUnderItsLeaseAfterTheServerWasKilled) {
  const auto lease = MakeLease("first");
  ASSERT_TRUE(lease->TryTake());
  const auto zone = MakeZone("first", lease);
  zone->Handle(MakeReport({40, 8}));
  server_->Kill(SIGKILL);
  EXPECT_NE(WhyHandlingFailed(*zone, MakeReport({40.01, 8})), "");
  server_->Start();
  ASSERT_TRUE(lease->Renew());
  zone->Handle(MakeReport({40.01, 8}));
  EXPECT_EQ(Count("events"), 2);
}

TEST_F(ZoneLeaseTest, AZoneWithoutALeaseAndOneWithALeaseNeverShareADatabase) {
  const auto lease = MakeLease("first");
  ASSERT_TRUE(lease->TryTake());
  {
    const auto zone = MakeZone("first", lease);
    EXPECT_THROW(MakeZone("second", nullptr), StoreError);
  }
  const auto zone = MakeZone("second", nullptr);
  EXPECT_THROW(MakeZone("first", lease), StoreError);
}

TEST_F(ZoneLeaseTest, ALeaseOfAFileOrWithoutAHolderIsRefused) {
  EXPECT_THROW(ZoneLease({directory_ + "/zone.sqlite3", "first", 3}), Error);
  EXPECT_THROW(ZoneLease({url_, "", 3}), Error);
  EXPECT_THROW(ZoneLease({url_, std::string(201, 'a'), 3}), Error);
  EXPECT_THROW(ZoneLease({url_, "first", 0}), Error);
  EXPECT_THROW(ZoneStore(directory_ + "/other.sqlite3", 1), StoreError);
}

}  // namespace
}  // namespace livemap::zone
