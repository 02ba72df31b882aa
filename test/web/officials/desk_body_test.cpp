#include "web/officials/desk_body.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace livemap::web {
namespace {

using testing::HasSubstr;

std::string WhyNoAction(Decision decision, const std::string& body) {
  try {
    ParseDeskAction(decision, body);
  } catch (const BadRequest& mistake) {
    return mistake.what();
  }
  return "";
}

TEST(DeskBody, ADayIsOneOfTheCalendar) {
  EXPECT_EQ(ParseDay("1970-01-01"), 0);
  EXPECT_EQ(ParseDay("2024-02-29"), 1'709'164'800'000'000'000);
  EXPECT_EQ(ParseDay("2026-12-01"), 1'796'083'200'000'000'000);
  for (const char* wrong : {"2023-02-29", "2026-13-01", "2026-00-10", "2026-01-00", "26-01-01",
                            "2026-1-1", "2026/01/01", "1969-12-31", "2106-01-01", "+026-01-01"}) {
    EXPECT_FALSE(ParseDay(wrong)) << wrong;
  }
}

TEST(DeskBody, ACommentIsBoundedTextWithoutControlCharacters) {
  EXPECT_EQ(ParseDeskAction(Decision::kComment, R"({"text": "<b>asked</b>"})").text,
            "<b>asked</b>");
  EXPECT_THAT(WhyNoAction(Decision::kComment, R"({"text": "a\nb"})"), HasSubstr("printable"));
  EXPECT_THAT(WhyNoAction(Decision::kComment, R"({"text": "   "})"), HasSubstr("not accepted"));
  EXPECT_THAT(WhyNoAction(Decision::kComment, R"({"text": ")" + std::string(501, 'a') + R"("})"),
              HasSubstr("501 bytes"));
  EXPECT_THAT(WhyNoAction(Decision::kComment, R"({"words": "a"})"), HasSubstr("unknown key"));
  EXPECT_THAT(WhyNoAction(Decision::kComment, "[]"), HasSubstr("no JSON object"));
}

TEST(DeskBody, AnAssignmentHasATeamAndPerhapsADay) {
  const zone::DeskAction action =
      ParseDeskAction(Decision::kAssign, R"({"team": " Roads ", "due": "2026-12-01"})");
  EXPECT_EQ(action.team, "Roads");
  EXPECT_EQ(action.due_ns, *ParseDay("2026-12-01"));
  EXPECT_EQ(ParseDeskAction(Decision::kAssign, R"({"team": null})").team, "");
  EXPECT_THAT(WhyNoAction(Decision::kAssign, R"({"due": "2026-12-01"})"), HasSubstr("no team"));
  EXPECT_THAT(WhyNoAction(Decision::kAssign, R"({"team": null, "due": "2026-12-01"})"),
              HasSubstr("due day"));
  EXPECT_THAT(WhyNoAction(Decision::kAssign, R"({"team": "Roads", "due": "tomorrow"})"),
              HasSubstr("due day"));
}

TEST(DeskBody, APlaceIsLongitudeAndLatitude) {
  const geo::GeoPoint place =
      ParseDeskAction(Decision::kMove, R"({"position": [-79.9, 40.4]})").position;
  EXPECT_EQ(place.latitude_deg, 40.4);
  EXPECT_EQ(place.longitude_deg, -79.9);
  for (const char* wrong :
       {R"({"position": [-79.9]})", R"({"position": [0, 91]})", R"({"position": "here"})", "{}"}) {
    EXPECT_THAT(WhyNoAction(Decision::kMove, wrong), HasSubstr("position")) << wrong;
  }
}

TEST(DeskBody, AMergeNamesTheOtherHazard) {
  EXPECT_THAT(WhyNoAction(Decision::kMerge, R"({"other": "me"})"), HasSubstr("no UUID"));
  EXPECT_THAT(WhyNoAction(Decision::kMerge, "{}"), HasSubstr("no other"));
  EXPECT_EQ(WhyNoAction(Decision::kMerge, R"({"other": "00000000-0000-4000-8000-000000000001"})"),
            "");
}

TEST(DeskBody, StatisticsReachBackSomeWeeks) {
  RequestTarget target;
  EXPECT_EQ(ParseStatisticsQuery(target).weeks, 12U);
  target.parameters = {{"weeks", "520"}};
  EXPECT_EQ(ParseStatisticsQuery(target).weeks, 520U);
  for (const char* wrong : {"0", "521", "-1", "", "many", "00001"}) {
    target.parameters = {{"weeks", wrong}};
    EXPECT_THROW(ParseStatisticsQuery(target), BadRequest) << wrong;
  }
}

}  // namespace
}  // namespace livemap::web
