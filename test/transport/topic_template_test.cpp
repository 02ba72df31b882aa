#include "transport/topic_template.h"

#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::transport {
namespace {

const char kReport[] = "livemap/v1/{zone}/vehicle/{vehicle}/report";

TEST(TopicTemplate, ExpandsZoneAndVehicle) {
  EXPECT_EQ(TopicTemplate(kReport).Expand({"demo", "car-1"}),
            "livemap/v1/demo/vehicle/car-1/report");
}

TEST(TopicTemplate, SubscribesToEveryVehicleOrToOne) {
  const TopicTemplate report(kReport);
  EXPECT_EQ(report.SubscriptionFilter({"demo", ""}), "livemap/v1/demo/vehicle/+/report");
  EXPECT_EQ(report.SubscriptionFilter({"demo", "car-1"}), "livemap/v1/demo/vehicle/car-1/report");
}

TEST(TopicTemplate, ExtractsTheNamesOfAMatchingTopic) {
  const auto names = TopicTemplate(kReport).Match("livemap/v1/demo/vehicle/car-1/report");
  ASSERT_TRUE(names);
  EXPECT_EQ(names->zone, "demo");
  EXPECT_EQ(names->vehicle, "car-1");
}

TEST(TopicTemplate, MatchesNothingElse) {
  const TopicTemplate report(kReport);
  for (const std::string topic :
       {"livemap/v1/demo/vehicle/car-1/position", "livemap/v1/demo/vehicle/car-1/report/more",
        "livemap/v1/demo/vehicle/car-1", "livemap/v1/demo/vehicle//report",
        "livemap/v1/demo/vehicle/../report", "livemap/v1/demo/vehicle/a b/report",
        "livemap/v1/demo/vehicle/caf\xc3\xa9/report", "/livemap/v1/demo/vehicle/a/report", ""}) {
    EXPECT_FALSE(report.Match(topic)) << topic;
  }
  EXPECT_FALSE(report.Match(std::string(100000, '/')));
}

TEST(TopicTemplate, HasALevelForACell) {
  const TopicTemplate notice("livemap/v1/{zone}/notice/{cell}");
  EXPECT_TRUE(notice.has_cell());
  EXPECT_FALSE(TopicTemplate(kReport).has_cell());
  EXPECT_EQ(notice.Expand({"demo", "", "0123"}), "livemap/v1/demo/notice/0123");
  EXPECT_EQ(notice.SubscriptionFilter({"demo", "", ""}), "livemap/v1/demo/notice/+");
  const auto names = notice.Match("livemap/v1/demo/notice/0123");
  ASSERT_TRUE(names);
  EXPECT_EQ(names->zone, "demo");
  EXPECT_EQ(names->cell, "0123");
  EXPECT_FALSE(notice.Match("livemap/v1/demo/notice"));
  EXPECT_THROW(notice.Expand({"demo", "", "+"}), Error);
  EXPECT_THROW(notice.Expand({"demo", "", ""}), Error);
}

TEST(TopicTemplate, RefusesToExpandNamesThatWouldReachOtherTopics) {
  const TopicTemplate report(kReport);
  for (const std::string id : {"+", "#", "a/b", "", "..", "a b", "x\n"}) {
    EXPECT_THROW(report.Expand({"demo", id}), Error) << id;
    EXPECT_THROW(report.Expand({id, "car-1"}), Error) << id;
  }
  EXPECT_THROW(report.Expand({"demo", std::string(65, 'a')}), Error);
  EXPECT_NO_THROW(report.Expand({"demo", std::string(64, 'a')}));
}

TEST(TopicTemplate, RefusesTextsThatAreNoTemplate) {
  for (const std::string text :
       {"", "livemap/+/x", "livemap/#", "livemap/{car}/x", "livemap//x", "x/{zone}{vehicle}",
        "{zone}/{zone}", "{vehicle}/{vehicle}", "livemap/a b", "$SYS/x"}) {
    EXPECT_THROW(TopicTemplate{text}, Error) << text;
  }
  EXPECT_THROW(TopicTemplate(std::string(2000, 'a')), Error);
}

TEST(TopicTemplate, KnowsWhetherItNamesAVehicle) {
  EXPECT_TRUE(TopicTemplate(kReport).has_vehicle());
  EXPECT_FALSE(TopicTemplate("livemap/v1/{zone}/notice").has_vehicle());
}

}  // namespace
}  // namespace livemap::transport
