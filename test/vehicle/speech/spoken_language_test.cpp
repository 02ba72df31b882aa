#include "vehicle/speech/spoken_language.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/error.h"

namespace livemap::vehicle {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kSource = LIVEMAP_SOURCE_DIR;

constexpr char kSpoken[] =
    "# comment\n"
    "language = en\r\n"
    "ahead = {hazard} in {distance} metres.\n"
    "left = {hazard} in {distance} metres, on the left.\n"
    "right = {hazard} in {distance} metres, on the right.\n"
    "near = {hazard} right ahead.\n"
    "\n"
    "class other = Hazard\n"
    "class pothole = Pothole\n";

HazardAlert SpokenAlert(const std::string& class_name, double distance_m,
                        HazardAlert::Side side = HazardAlert::Side::kAhead) {
  HazardAlert alert;
  alert.class_name = class_name;
  alert.distance_m = distance_m;
  alert.side = side;
  return alert;
}

SpokenLanguage ParseSpoken(const std::string& text) {
  return SpokenLanguage::Parse(text, "words.txt", protocol::HazardCatalogue());
}

std::string SpokenRefusal(const std::string& text, const std::string& catalogue = "") {
  try {
    SpokenLanguage::Parse(text, "words.txt",
                          catalogue.empty()
                              ? protocol::HazardCatalogue()
                              : protocol::HazardCatalogue::Parse(catalogue, "hazards.yaml"));
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SpokenLanguage, SaysClassSideAndDistance) {
  const SpokenLanguage language = ParseSpoken(kSpoken);
  EXPECT_EQ(language.code(), "en");
  EXPECT_EQ(language.SentenceOf(SpokenAlert("pothole", 203)), "Pothole in 200 metres.");
  EXPECT_EQ(language.SentenceOf(SpokenAlert("pothole", 80, HazardAlert::Side::kLeft)),
            "Pothole in 80 metres, on the left.");
  EXPECT_EQ(language.SentenceOf(SpokenAlert("pothole", 80, HazardAlert::Side::kRight)),
            "Pothole in 80 metres, on the right.");
  EXPECT_EQ(language.SentenceOf(SpokenAlert("pothole", 24)), "Pothole right ahead.");
  EXPECT_EQ(language.SentenceOf(SpokenAlert("sinkhole", 100)), "Hazard in 100 metres.");
}

TEST(SpokenLanguage, RoundsDistancesAsPeopleSayThem) {
  EXPECT_EQ(SpokenDistanceM(34.9), 30);
  EXPECT_EQ(SpokenDistanceM(96), 100);
  EXPECT_EQ(SpokenDistanceM(137), 150);
  EXPECT_EQ(SpokenDistanceM(320), 300);
  EXPECT_EQ(SpokenDistanceM(1260), 1300);
  EXPECT_EQ(SpokenDistanceM(-3), 0);
}

TEST(SpokenLanguage, ShippedLanguagesNameEveryClass) {
  const auto catalogue = protocol::HazardCatalogue::Load(kSource + "/config/hazards.yaml");
  for (const std::string code : {"en", "de", "pt"}) {
    const SpokenLanguage language =
        SpokenLanguage::Load(kSource + "/config/languages/" + code + ".txt", catalogue);
    EXPECT_EQ(language.code(), code);
    EXPECT_THAT(language.SentenceOf(SpokenAlert("deer", 150)), HasSubstr("150"));
  }
}

TEST(SpokenLanguage, RefusesAMissingClassByName) {
  EXPECT_THAT(SpokenRefusal(kSpoken, "classes: {deer: {label: Deer}}"),
              AllOf(HasSubstr("words.txt"), HasSubstr("class deer = TEXT")));
  EXPECT_THAT(SpokenRefusal("language = en\n"), HasSubstr("class other = TEXT"));
}

TEST(SpokenLanguage, RefusesMistakesByLine) {
  const std::string spoken = kSpoken;
  EXPECT_THAT(SpokenRefusal(spoken + "class deer\n"),
              AllOf(HasSubstr("line 10"), HasSubstr("'class deer'"), HasSubstr("KEY = TEXT")));
  EXPECT_THAT(SpokenRefusal(spoken + "behind = {hazard}\n"),
              AllOf(HasSubstr("line 10"), HasSubstr("'behind'")));
  EXPECT_THAT(SpokenRefusal(spoken + "class pothole = Hole\n"), HasSubstr("again"));
  EXPECT_THAT(SpokenRefusal("ahead = {hazard} soon\n"),
              AllOf(HasSubstr("line 1"), HasSubstr("{distance}")));
  EXPECT_THAT(SpokenRefusal("near = {hazard} {hazard}\n"), HasSubstr("once"));
  EXPECT_THAT(SpokenRefusal("left = {hazard} {distance} {speed}\n"), HasSubstr("line 1"));
  EXPECT_THAT(SpokenRefusal("class deer = {hazard}\n"), HasSubstr("without braces"));
  EXPECT_THAT(SpokenRefusal("language = en; rm\n"), HasSubstr("a code such as"));
  EXPECT_THAT(SpokenRefusal("class deer =\n"), HasSubstr("1 to 200 bytes"));
}

}  // namespace
}  // namespace livemap::vehicle
