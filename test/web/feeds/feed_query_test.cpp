#include "web/feeds/feed_query.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace livemap::web {
namespace {

FeedQuery ParseFeed(const std::string& parameters, const FeedParameters& accepted) {
  return ParseFeedQuery(ParseTarget("/feeds/x?" + parameters), accepted);
}

std::string FeedComplaint(const std::string& parameters, const FeedParameters& accepted) {
  try {
    ParseFeed(parameters, accepted);
  } catch (const BadRequest& mistake) {
    return mistake.what();
  }
  return "";
}

TEST(ParseFeedQuery, ReadsWhatTheFeedTakes) {
  const FeedQuery query =
      ParseFeed("bbox=-80,40,-79,41&class=pothole,deer&state=active", {true, false});
  EXPECT_EQ(query.box->south_west.longitude_deg, -80);
  EXPECT_THAT(query.classes, testing::ElementsAre("deer", "pothole"));
  EXPECT_THAT(query.states, testing::ElementsAre(zone::HazardState::kActive));
  EXPECT_EQ(ParseFeed("since=7", {false, true}).since, 7U);
}

TEST(ParseFeedQuery, RefusesWhatTheFeedDoesNotTake) {
  EXPECT_THAT(FeedComplaint("state=active", {}),
              testing::HasSubstr("'state' is unknown, accepted are bbox and class"));
  EXPECT_THAT(FeedComplaint("since=7", {true, false}), testing::HasSubstr("bbox, class and state"));
  EXPECT_THAT(FeedComplaint("limit=7", {false, true}), testing::HasSubstr("bbox, class and since"));
}

TEST(ParseFeedQuery, RefusesBadValues) {
  const FeedParameters all{true, true};
  for (const char* parameters : {"bbox=1,2,3", "class=", "class=a,,b", "class=a,a", "state=gone",
                                 "state=", "since=-1", "since=x", "bbox=1,2,3,4&bbox=1,2,3,4"}) {
    EXPECT_NE(FeedComplaint(parameters, all), "") << parameters;
  }
  EXPECT_NE(FeedComplaint("class=" + std::string(65, 'a'), all), "");
}

}  // namespace
}  // namespace livemap::web
