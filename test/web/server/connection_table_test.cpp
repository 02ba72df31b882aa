#include "web/server/connection_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

namespace livemap::web {
namespace {

using Phase = ConnectionTable::Phase;
using Id = ConnectionTable::Id;

constexpr std::int64_t kSecondNs = 1'000'000'000;

class ConnectionTableTest : public testing::Test {
 protected:
  /// Lets a connection in that the table may end; 0 when there is no place.
  Id Admit(const std::string& client, std::int64_t now_ns = 0) {
    const auto id = table_.Admit(client, now_ns);
    if (!id) return 0;
    table_.SetEnd(*id, [this, id = *id] { ended_.push_back(id); });
    return *id;
  }
  std::vector<Id> Fill(const std::string& client, int count, Phase phase, std::int64_t now_ns = 0) {
    std::vector<Id> ids;
    for (int i = 0; i < count; ++i) {
      ids.push_back(Admit(client, now_ns + i));
      table_.SetPhase(ids.back(), phase, now_ns + i);
    }
    return ids;
  }

  // Twelve of sixteen are for everybody.
  ConnectionTable table_{{16, 8, 4, {"10.0.0.1"}}};
  std::vector<Id> ended_;
};

TEST_F(ConnectionTableTest, AClientBeyondItsShareLosesItsLongestWaitingConnection) {
  const auto own = Fill("a", 8, Phase::kWaiting);
  EXPECT_NE(Admit("a", kSecondNs), 0U);
  EXPECT_EQ(ended_, std::vector<Id>{own.front()});
}

TEST_F(ConnectionTableTest, OneThatIsBeingServedIsNotEndedForItsOwnClient) {
  Fill("a", 8, Phase::kWorking);
  const Id on_reserve = Admit("a");
  EXPECT_FALSE(table_.MayServe(on_reserve));
  EXPECT_TRUE(ended_.empty());
}

TEST_F(ConnectionTableTest, AnAnswerThatIsNotReadCountsAsWaiting) {
  Fill("a", 8, Phase::kWriting);
  EXPECT_FALSE(table_.MayServe(Admit("a", kSecondNs)));
  const Id late = Admit("a", 10 * kSecondNs);
  EXPECT_TRUE(table_.MayServe(late));
  EXPECT_EQ(ended_.size(), 1U);
}

TEST_F(ConnectionTableTest, AFullTableEndsWhatWaitsOfTheClientWithTheMost) {
  const auto many = Fill("a", 8, Phase::kWaiting, 5 * kSecondNs);
  Fill("b", 4, Phase::kWaiting);
  EXPECT_TRUE(table_.MayServe(Admit("c", 10 * kSecondNs)));
  EXPECT_EQ(ended_, std::vector<Id>{many.front()});
}

TEST_F(ConnectionTableTest, AFullTableWhereNobodyWaitsStillHasAPlaceForANewcomer) {
  for (const char* client : {"a", "b"}) {
    Fill(client, 4, Phase::kStream);
    Fill(client, 2, Phase::kWorking);
  }
  EXPECT_TRUE(table_.MayServe(Admit("c")));
  EXPECT_EQ(ended_.size(), 1U);
}

TEST_F(ConnectionTableTest, StreamsOfAllTogetherLeaveRoomForRequests) {
  // Each from another network: none has more than another one.
  for (int i = 0; i < 9; ++i) {
    ASSERT_TRUE(table_.BecomeStream(Admit("reader-" + std::to_string(i)), 0));
  }
  const Id tenth = Admit("reader-10");
  EXPECT_TRUE(table_.MayServe(tenth));
  EXPECT_FALSE(table_.BecomeStream(tenth, kSecondNs));
  EXPECT_TRUE(table_.MayServe(Admit("reader-11")));
  EXPECT_TRUE(ended_.empty());
}

TEST_F(ConnectionTableTest, StreamsTakeTurnsWhereMoreWantOneThanThereAre) {
  std::vector<Id> streams;
  for (int i = 0; i < 9; ++i) {
    streams.push_back(Admit("reader-" + std::to_string(i)));
    ASSERT_TRUE(table_.BecomeStream(streams.back(), i));
  }
  const Id tenth = Admit("reader-10");
  EXPECT_FALSE(table_.BecomeStream(tenth, ConnectionTable::kStreamTurnNs - 1));
  EXPECT_TRUE(table_.BecomeStream(tenth, ConnectionTable::kStreamTurnNs));
  EXPECT_EQ(ended_, std::vector<Id>{streams.front()});
}

TEST_F(ConnectionTableTest, StreamsOfOneSiteInManyNetworksMakeRoomForAReader) {
  std::vector<Id> crowd;
  for (int i = 0; i < 9; ++i) {
    crowd.push_back(Admit("2001:db8:0:1" + std::to_string(i) + "::"));  // One /56.
    ASSERT_TRUE(table_.BecomeStream(crowd.back(), i));
  }
  EXPECT_TRUE(table_.BecomeStream(Admit("2001:db8:ffff::"), 20));
  EXPECT_TRUE(table_.BecomeStream(Admit("10.0.0.9"), 20));
  // Beside the crowd in its own /48, but not in its /56.
  EXPECT_TRUE(table_.BecomeStream(Admit("2001:db8:0:4400::"), 20));
  EXPECT_EQ(ended_, std::vector<Id>(crowd.begin(), crowd.begin() + 3));
  // One more of the crowd takes nothing from those.
  EXPECT_FALSE(table_.BecomeStream(Admit("2001:db8:0:1f::"), 30));
}

TEST_F(ConnectionTableTest, ACrowdInOneSiteTakesNoPlaceThatAReaderNeeds) {
  std::vector<Id> crowd;
  for (int i = 0; i < 12; ++i) {
    crowd.push_back(Admit("2001:db8:0:1" + std::to_string(i % 10) + std::to_string(i / 10) + "::"));
    table_.SetPhase(crowd.back(), Phase::kWorking, i);
  }
  for (const char* reader : {"2001:db8:1::", "10.0.0.9", "2001:db8:0:4400::"}) {
    const Id id = Admit(reader);
    EXPECT_TRUE(table_.MayServe(id)) << reader;
    table_.SetPhase(id, Phase::kWorking, 20);
  }
  EXPECT_EQ(ended_.size(), 3U);
}

TEST_F(ConnectionTableTest, AFullTableEndsWhatWaitsOfTheSiteWithTheMost) {
  Fill("10.0.0.9", 3, Phase::kWaiting);
  std::vector<Id> crowd;
  for (int i = 0; i < 9; ++i) crowd.push_back(Admit("2001:db8:0:1" + std::to_string(i) + "::", 9));
  EXPECT_TRUE(table_.MayServe(Admit("10.0.0.10", 10 * kSecondNs)));
  EXPECT_EQ(ended_, std::vector<Id>{crowd.front()});
}

TEST_F(ConnectionTableTest, EveryNewcomerIsServedHoweverManyConnectionsOneClientOpens) {
  std::size_t removed = 0;  // Sockets that are ended are gone soon.
  for (int i = 0; i < 1000; ++i) {
    Admit("attacker", i);
    for (; removed < ended_.size(); ++removed) table_.Remove(ended_[removed]);
  }
  for (int i = 0; i < 3; ++i) {
    const Id honest = Admit("honest-" + std::to_string(i), 2000 + i);
    EXPECT_TRUE(table_.MayServe(honest));
    table_.SetPhase(honest, Phase::kWorking, 2000 + i);
  }
}

TEST_F(ConnectionTableTest, AnOfficialGetsInWhenAllPlacesAreTakenAndIsNeverEnded) {
  Fill("a", 6, Phase::kWorking);
  Fill("b", 6, Phase::kWorking);
  const Id official = Admit("b");
  ASSERT_NE(official, 0U);
  EXPECT_FALSE(table_.MayServe(official));
  table_.MakeOfficial(official);
  EXPECT_TRUE(table_.MayServe(official));
  for (int i = 0; i < 100; ++i) Admit("c", i);
  EXPECT_EQ(std::count(ended_.begin(), ended_.end(), official), 0);
}

TEST_F(ConnectionTableTest, WaitingOnTheReserveIsEndedForTheNextOne) {
  Fill("a", 6, Phase::kWorking);
  Fill("b", 6, Phase::kWorking);
  std::vector<Id> on_reserve;
  for (int i = 0; i < 4; ++i) on_reserve.push_back(Admit("b", i));
  EXPECT_NE(Admit("b", 10), 0U);
  EXPECT_EQ(ended_, std::vector<Id>{on_reserve.front()});
}

TEST_F(ConnectionTableTest, WhoLeavesTheReserveMakesRoomAnOfficialToo) {
  Fill("a", 6, Phase::kWorking);
  Fill("b", 6, Phase::kWorking);
  std::vector<Id> officials;
  for (int i = 0; i < 4; ++i) {
    officials.push_back(Admit("b", i));
    table_.MakeOfficial(officials.back());
    table_.SetPhase(officials.back(), Phase::kWriting, i);
  }
  EXPECT_EQ(Admit("b", 10), 0U);
  table_.SetPhase(officials[2], Phase::kLeaving, 20);
  EXPECT_NE(Admit("b", 30), 0U);
  EXPECT_EQ(ended_, std::vector<Id>{officials[2]});
}

TEST_F(ConnectionTableTest, WhoLeavesMakesRoomForItsOwnClient) {
  const auto own = Fill("a", 8, Phase::kWorking);
  table_.SetPhase(own[3], Phase::kLeaving, kSecondNs);
  EXPECT_TRUE(table_.MayServe(Admit("a", kSecondNs)));
  EXPECT_EQ(ended_, std::vector<Id>{own[3]});
}

TEST_F(ConnectionTableTest, LiveStreamsLeaveAClientRoomForRequests) {
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(table_.BecomeStream(Admit("a"), 0));
  const Id next = Admit("a");
  EXPECT_FALSE(table_.BecomeStream(next, 0));
  EXPECT_TRUE(table_.MayServe(next));
}

TEST_F(ConnectionTableTest, AProxyHasNoShare) {
  for (int i = 0; i < 12; ++i) {
    const Id id = Admit("10.0.0.1");
    EXPECT_TRUE(table_.MayServe(id));
    EXPECT_EQ(table_.BecomeStream(id, 0), i < 9);  // As many as all together.
  }
  EXPECT_TRUE(ended_.empty());
}

TEST_F(ConnectionTableTest, BehindAProxyEveryClientHasItsOwnShare) {
  const std::vector<Id> ids = Fill("10.0.0.1", 10, Phase::kWorking);
  for (const Id id : ids) table_.SetClient(id, id == ids.back() ? "b" : "a", 0);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(table_.MayServe(ids[i]), i < 8 || i == 9) << "the share of a is 8, " << i;
  }
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(table_.BecomeStream(ids[static_cast<std::size_t>(i)], 0));
  EXPECT_FALSE(table_.BecomeStream(ids[6], 0));
  EXPECT_TRUE(table_.BecomeStream(ids[9], 0));
  table_.SetClient(ids[7], "10.0.0.1", 0);
  EXPECT_TRUE(table_.MayServe(ids[8])) << "what a proxy has open between requests is no share";
  EXPECT_TRUE(ended_.empty());
}

TEST_F(ConnectionTableTest, AProxysConnectionIsAnOfficialsForTheOfficialAlone) {
  const Id id = Admit("10.0.0.1");
  Fill("c", 8, Phase::kWorking);
  table_.SetClient(id, "official", 0);
  table_.MakeOfficial(id);
  EXPECT_TRUE(table_.MayServe(id));
  table_.SetClient(id, "c", 0);
  EXPECT_FALSE(table_.MayServe(id));
}

TEST_F(ConnectionTableTest, RemovedConnectionsGiveTheirPlacesBack) {
  const auto ids = Fill("a", 8, Phase::kWorking);
  for (const Id id : ids) table_.Remove(id);
  EXPECT_EQ(table_.size(), 0U);
  for (const Id id : Fill("a", 8, Phase::kWorking)) EXPECT_TRUE(table_.MayServe(id));
  EXPECT_TRUE(ended_.empty());
}

TEST_F(ConnectionTableTest, OneThatWasEndedBeforeItCouldBeIsEndedThen) {
  // Nothing to call yet: it stays until there is.
  const auto id = table_.Admit("a", 0);
  ASSERT_TRUE(id);
  Fill("a", 7, Phase::kWorking);
  EXPECT_FALSE(table_.MayServe(Admit("a")));
}

}  // namespace
}  // namespace livemap::web
