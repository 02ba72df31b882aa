#include "orders/desk/order_planner.h"

#include <gtest/gtest.h>

#include "test/zone/zone_fixture.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kAllOrders = 100;

/// A real zone, of whose potholes and deer the recipient "roads" gets orders.
class OrderPlannerTest : public zone::ZoneTest {
 protected:
  OrderPlannerTest() { Restart(); }

  void Restart(OrderRule::When when = OrderRule::When::kConfirmed) {
    planner_.reset();
    book_.reset();
    zone_.reset();
    zone_ = std::make_unique<zone::ZoneService>(Config(), Clock(), ++seed_);
    OpenBook(when);
  }
  void OpenBook(OrderRule::When when = OrderRule::When::kConfirmed) {
    planner_.reset();
    book_ = std::make_unique<OrderBook>(directory_ + "/zone/orders.sqlite3", ++seed_);
    OrderRule rule;
    rule.recipient = "roads";
    rule.classes = {"pothole"};
    rule.when = when;
    rule.delay_s = 60;
    planner_ =
        std::make_unique<OrderPlanner>(std::vector<OrderRule>{rule}, *zone_, catalogue_, *book_);
  }
  Uuid AddHazard(double longitude_deg = -79.94, const std::string& class_name = "pothole") {
    protocol::Report report = zone::MakeReport({40.44, longitude_deg});
    report.class_name = class_name;
    return zone_->Handle(report).hazard_uuid;
  }
  void Plan() {
    while (planner_->Plan(zone::kNowNs)) {
    }
  }
  std::vector<Order> Orders(std::optional<OrderState> state = std::nullopt) const {
    return book_->List({UINT64_MAX, kAllOrders, state, {}, {}});
  }

  std::uint64_t seed_ = 0;
  protocol::HazardCatalogue catalogue_ = OneVehicleSuffices();
  std::unique_ptr<zone::ZoneService> zone_;
  std::unique_ptr<OrderBook> book_;
  std::unique_ptr<OrderPlanner> planner_;
};

TEST_F(OrderPlannerTest, AConfirmationMakesOneOrderHoweverOftenTheZoneStarts) {
  const Uuid hazard = AddHazard();
  Plan();
  EXPECT_TRUE(Orders().empty()) << "no official has confirmed it";
  const auto decision = zone_->Confirm(hazard, "miller", "seen on my way");
  ASSERT_TRUE(decision);
  // The zone is killed between its decision and the order.
  Restart();
  Plan();
  ASSERT_EQ(Orders().size(), 1U);
  const Order order = Orders()[0];
  EXPECT_EQ(order.content.hazard, hazard);
  EXPECT_EQ(order.content.official, "miller");
  EXPECT_EQ(order.content.reason, "seen on my way");
  EXPECT_EQ(order.content.confirmed_ns, zone::kNowNs);
  EXPECT_EQ(order.next_ns, zone::kNowNs + 60 * zone::kOneSecond);
  Restart();
  Plan();
  zone_->Confirm(hazard, "jones");
  Plan();
  EXPECT_EQ(Orders().size(), 1U) << "the order of before is open";
}

TEST_F(OrderPlannerTest, ANewBookBeginsWithWhatHappensFromNowOn) {
  zone_->Confirm(AddHazard(), "miller");
  std::filesystem::remove(directory_ + "/zone/orders.sqlite3");
  OpenBook();
  Plan();
  EXPECT_TRUE(Orders().empty());
}

TEST_F(OrderPlannerTest, WhatNoRuleWantsMakesNoOrder) {
  zone_->Confirm(AddHazard(-79.94, "deer"), "miller");
  Plan();
  EXPECT_TRUE(Orders().empty());
}

TEST_F(OrderPlannerTest, ADecisionThatWasUndoneOrAHazardThatWasRejectedSendsNothing) {
  const Uuid undone = AddHazard();
  zone_->Confirm(undone, "miller");
  Plan();
  zone_->Undo(undone, "miller");
  Plan();
  EXPECT_EQ(Orders(OrderState::kCancelled).size(), 1U);
  const Uuid rejected = AddHazard(-79.90);
  zone_->Confirm(rejected, "miller");
  Plan();
  zone_->Reject(rejected, "jones", "a shadow");
  Plan();
  EXPECT_EQ(Orders(OrderState::kCancelled).size(), 2U);
  // Decided and undone before anybody looked.
  zone_->Confirm(rejected, "miller");
  zone_->Undo(rejected, "miller");
  Plan();
  EXPECT_EQ(Orders().size(), 2U);
}

TEST_F(OrderPlannerTest, AHazardThatIsThereAgainByNowKeepsItsOrder) {
  const Uuid hazard = AddHazard();
  zone_->Confirm(hazard, "miller");
  zone_->Reject(hazard, "jones", "a shadow");
  zone_->Confirm(hazard, "miller", "no, look");
  Plan();
  EXPECT_EQ(Orders(OrderState::kWaiting).size(), 1U);
}

TEST_F(OrderPlannerTest, ARuleForActiveHazardsNeedsNoOfficial) {
  Restart(OrderRule::When::kActive);
  const Uuid hazard = AddHazard();
  Plan();
  ASSERT_EQ(Orders().size(), 1U);
  EXPECT_EQ(Orders()[0].content.official, "");
  // An official's word about it and its undoing change nothing.
  zone_->Confirm(hazard, "miller");
  zone_->Undo(hazard, "miller");
  Plan();
  EXPECT_EQ(Orders(OrderState::kWaiting).size(), 1U);
}

TEST_F(OrderPlannerTest, ABookThatIsAheadOfTheZoneGoesOnFromWhereTheZoneIs) {
  zone_->Confirm(AddHazard(), "miller");
  Plan();
  book_->Plan({}, {1000, 100'000}, zone::kNowNs);
  OpenBook();
  zone_->Confirm(AddHazard(-79.90), "miller");
  Plan();
  EXPECT_EQ(Orders().size(), 2U);
}

TEST_F(OrderPlannerTest, AClosedOrdersHazardIsVerifiedAndNoLongerAnOfficials) {
  const Uuid hazard = AddHazard();
  zone_->Confirm(hazard, "miller");
  ASSERT_TRUE(zone_->Verify(hazard, "work order to roads closed by jones"));
  const zone::Hazard now = *zone_->Find(hazard);
  EXPECT_EQ(now.state, zone::HazardState::kVerifying);
  EXPECT_NEAR(now.presence, 0.5F, 1e-3F);
  EXPECT_EQ(zone_->Events(hazard, 10).back().reason, "work order to roads closed by jones");
  // Confirmed anew it is active, and has an order again once the first one is closed.
  ASSERT_TRUE(zone_->Confirm(hazard, "miller"));
  EXPECT_EQ(zone_->Find(hazard)->state, zone::HazardState::kActive);
  zone_->Reject(hazard, "miller", "gone");
  EXPECT_FALSE(zone_->Verify(hazard, "closed")) << "nobody is told of it";
}

}  // namespace
}  // namespace livemap::orders
