#include "orders/desk/order_book.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

namespace livemap::orders {
namespace {

constexpr std::int64_t kBookNowNs = 1'700'000'000'000'000'000;
constexpr std::int64_t kMinuteNs = 60'000'000'000;

class OrderBookTest : public testing::Test {
 protected:
  OrderBookTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "livemap_book_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    Open();
  }
  ~OrderBookTest() override {
    book_.reset();
    std::filesystem::remove_all(folder_);
  }
  /// As after a kill: nothing is told to the book of before.
  void Open() {
    book_.reset();
    book_ = std::make_unique<OrderBook>(folder_ + "/orders.sqlite3", ++seed_);
  }
  static OrderStep StepWith(const Uuid& hazard, const std::string& official = "miller") {
    OrderStep step;
    OrderContent content;
    content.hazard = hazard;
    content.class_name = "pothole";
    content.label = "Pothole";
    content.position = {40.44, -79.94};
    content.official = official;
    step.made.push_back({"roads", content, kBookNowNs});
    return step;
  }
  static OrderStep Cancel(const Uuid& hazard, bool only_by_officials) {
    OrderStep step;
    step.cancelled = hazard;
    step.only_by_officials = only_by_officials;
    return step;
  }
  static SendResult Result(SendResult::Outcome outcome) {
    SendResult result;
    result.outcome = outcome;
    if (outcome != SendResult::Outcome::kSent) result.error = "no route";
    return result;
  }
  void EndAttempt(const Order& order, SendResult::Outcome outcome) {
    book_->EndAttempt(order.id, Result(outcome), kBookNowNs, kBookNowNs + kMinuteNs,
                      kBookNowNs + 10 * kMinuteNs);
  }
  Order Newest() { return book_->List({UINT64_MAX, 1, {}, {}, {}}).at(0); }

  std::string folder_;
  std::uint64_t seed_ = 0;
  std::unique_ptr<OrderBook> book_;
  const Uuid hazard_ = *Uuid::Parse("11111111-2222-4333-8444-555555555555");
};

TEST_F(OrderBookTest, KeepsOrdersAndHowFarTheHistoryWasReadTogether) {
  EXPECT_FALSE(book_->Cursor());
  book_->Plan({StepWith(hazard_)}, {7, 90}, kBookNowNs);
  const Uuid uuid = Newest().uuid;
  Open();
  ASSERT_TRUE(book_->Cursor());
  EXPECT_EQ(book_->Cursor()->decision, 7U);
  EXPECT_EQ(book_->Cursor()->sequence, 90U);
  EXPECT_EQ(Newest().uuid, uuid);
  EXPECT_EQ(Newest().content.label, "Pothole");
  EXPECT_EQ(Newest().content.position.longitude_deg, -79.94);
}

TEST_F(OrderBookTest, OnlyItsOwnerMayReadIt) {
  struct stat status {};
  ASSERT_EQ(stat((folder_ + "/orders.sqlite3").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(OrderBookTest, AHazardHasOneOpenOrderAtARecipient) {
  book_->Plan({StepWith(hazard_), StepWith(hazard_)}, {1, 1}, kBookNowNs);
  book_->Plan({StepWith(hazard_)}, {2, 1}, kBookNowNs);
  EXPECT_EQ(book_->List({UINT64_MAX, 10, {}, {}, {}}).size(), 1U);
  const Order order = Newest();
  book_->BeginAttempt(order.id, kBookNowNs);
  EndAttempt(order, SendResult::Outcome::kSent);
  ASSERT_TRUE(book_->Close(order.uuid, "miller", kBookNowNs));
  book_->Plan({StepWith(hazard_)}, {3, 1}, kBookNowNs);
  EXPECT_EQ(book_->List({UINT64_MAX, 10, {}, {}, {}}).size(), 2U) << "it is there again";
}

TEST_F(OrderBookTest, AnAttemptThatAKillCutOffMayHaveArrived) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  const auto order = book_->FindDue("roads", kBookNowNs);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->uncertain_ns, 0);
  book_->BeginAttempt(order->id, kBookNowNs);
  Open();
  const auto again = book_->FindDue("roads", kBookNowNs);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->uuid, order->uuid);
  EXPECT_EQ(again->attempts, 1U);
  EXPECT_EQ(again->uncertain_ns, kBookNowNs);
  // The second one was refused: of the first one that says nothing.
  book_->BeginAttempt(order->id, kBookNowNs + kMinuteNs);
  EndAttempt(*again, SendResult::Outcome::kRefused);
  EXPECT_EQ(Newest().uncertain_ns, kBookNowNs);
  EXPECT_EQ(Newest().error, "no route");
}

TEST_F(OrderBookTest, ARefusedAttemptIsKnownNotToHaveArrived) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  book_->BeginAttempt(Newest().id, kBookNowNs);
  EndAttempt(Newest(), SendResult::Outcome::kRefused);
  EXPECT_EQ(Newest().uncertain_ns, 0);
  EXPECT_EQ(Newest().state, OrderState::kWaiting);
  EXPECT_FALSE(book_->FindDue("roads", kBookNowNs));
  EXPECT_TRUE(book_->FindDue("roads", kBookNowNs + kMinuteNs));
  EXPECT_FALSE(book_->FindDue("others", kBookNowNs + kMinuteNs));
}

TEST_F(OrderBookTest, AnOrderIsGivenUpAndSentAgainByAnOfficial) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  const Order order = Newest();
  EXPECT_FALSE(book_->Retry(order.uuid, kBookNowNs));
  book_->BeginAttempt(order.id, kBookNowNs);
  book_->EndAttempt(order.id, Result(SendResult::Outcome::kRefused), kBookNowNs,
                    kBookNowNs + 2 * kMinuteNs, kBookNowNs + kMinuteNs);
  EXPECT_EQ(Newest().state, OrderState::kFailed);
  EXPECT_FALSE(book_->FindDue("roads", INT64_MAX));
  EXPECT_TRUE(book_->Retry(order.uuid, kBookNowNs + 5 * kMinuteNs));
  EXPECT_EQ(Newest().since_ns, kBookNowNs + 5 * kMinuteNs);
  EXPECT_TRUE(book_->FindDue("roads", kBookNowNs + 5 * kMinuteNs));
}

TEST_F(OrderBookTest, WhatNobodyTriedToSendIsCancelled) {
  const Uuid other = *Uuid::Parse("99999999-2222-4333-8444-555555555555");
  book_->Plan({StepWith(hazard_), StepWith(other, "")}, {1, 1}, kBookNowNs);
  book_->Plan({Cancel(hazard_, true), Cancel(other, true)}, {2, 1}, kBookNowNs);
  EXPECT_EQ(book_->Counts().by_state[4], 1U) << "an undone decision does not touch other orders";
  book_->BeginAttempt(Newest().id, kBookNowNs);
  book_->Plan({Cancel(other, false)}, {3, 1}, kBookNowNs);
  EXPECT_EQ(Newest().state, OrderState::kWaiting) << "it may have arrived";
  book_->Plan({StepWith(hazard_)}, {4, 1}, kBookNowNs);
  EXPECT_EQ(book_->List({UINT64_MAX, 10, OrderState::kWaiting, {}, {}}).size(), 2U)
      << "confirmed anew";
}

TEST_F(OrderBookTest, AClosedOrdersHazardIsToBeVerifiedUntilItWas) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  const Order order = Newest();
  EXPECT_FALSE(book_->Close(order.uuid, "miller", kBookNowNs)) << "nobody has it";
  book_->BeginAttempt(order.id, kBookNowNs);
  EndAttempt(order, SendResult::Outcome::kSent);
  EXPECT_TRUE(book_->Close(order.uuid, "miller", kBookNowNs));
  EXPECT_FALSE(book_->Close(order.uuid, "miller", kBookNowNs));
  Open();
  const auto unverified = book_->FindUnverified();
  ASSERT_TRUE(unverified);
  EXPECT_EQ(unverified->hazard, hazard_);
  EXPECT_EQ(unverified->why, "work order to roads closed by miller");
  book_->NoteVerified(unverified->id);
  EXPECT_FALSE(book_->FindUnverified());
}

TEST_F(OrderBookTest, CountsByStateAndSaysHowOldTheOldestWaitingIs) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  EXPECT_EQ(book_->Counts().by_state[0], 1U);
  EXPECT_EQ(book_->Counts().oldest_waiting_ns, kBookNowNs);
  EXPECT_TRUE(book_->List({Newest().id, 10, {}, {}, {}}).empty());
}

TEST_F(OrderBookTest, ListsThoseThatAllOfTheFilterAccepts) {
  const Uuid other = *Uuid::Parse("22222222-2222-4333-8444-555555555555");
  OrderStep step = StepWith(other);
  step.made[0].recipient = "city' OR 1";
  book_->Plan({StepWith(hazard_), step}, {1, 1}, kBookNowNs);
  OrderFilter filter;
  EXPECT_EQ(book_->List(filter).size(), 2U);
  filter.recipient = "city' OR 1";
  ASSERT_EQ(book_->List(filter).size(), 1U);
  EXPECT_EQ(book_->List(filter)[0].content.hazard, other);
  filter.hazard = hazard_;
  EXPECT_TRUE(book_->List(filter).empty()) << "no order is of both";
  filter.recipient.clear();
  filter.state = OrderState::kWaiting;
  EXPECT_EQ(book_->List(filter).size(), 1U);
  filter.state = OrderState::kSent;
  EXPECT_TRUE(book_->List(filter).empty());
}

TEST_F(OrderBookTest, SaysByWhoseWordAnOrderIsClosed) {
  book_->Plan({StepWith(hazard_)}, {1, 1}, kBookNowNs);
  book_->BeginAttempt(Newest().id, kBookNowNs);
  EndAttempt(Newest(), SendResult::Outcome::kSent);
  EXPECT_EQ(Newest().closed_by, "");
  EXPECT_TRUE(book_->Close(Newest().uuid, "miller", kBookNowNs));
  EXPECT_EQ(Newest().closed_by, "miller");
}

}  // namespace
}  // namespace livemap::orders
