#include "protocol/hazard_catalogue.h"

#include <gmock/gmock.h>

#include <fstream>

#include "common/error.h"
#include "test/support/temporary_directory.h"

namespace livemap::protocol {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(HazardCatalogue, ShippedFileNamesEveryClassOfTheDesign) {
  const auto catalogue = HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml");
  for (const char* name : {"pothole", "traffic_cone", "road_work_sign", "barrier", "debris", "deer",
                           "construction_machine", "stopped_accident"}) {
    ASSERT_EQ(catalogue.classes().count(name), 1u) << name;
    const HazardClass entry = catalogue.Get(name);
    EXPECT_EQ(entry.name, name);
    EXPECT_NE(entry.label, name) << "a label is for people";
    EXPECT_EQ(entry.duplicate_radius_m, 5.0) << name;
  }
  EXPECT_LT(catalogue.Get("deer").expected_life_s, catalogue.Get("pothole").expected_life_s);
  EXPECT_LT(catalogue.Get("stopped_accident").urgency, catalogue.Get("pothole").urgency);
  EXPECT_GT(catalogue.Get("pothole").half_depth_m, 0);
  EXPECT_LT(catalogue.Get("pothole").half_depth_m, 1);
  EXPECT_GT(catalogue.Get("stopped_accident").half_depth_m, 3);
}

TEST(HazardCatalogue, ShippedFileTellsDriversOfDeerAndAccidentsByOneVehicleAndOfTheRestByTwo) {
  const auto catalogue = HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml");
  for (const auto& [name, entry] : catalogue.classes()) {
    const bool urgent = name == "deer" || name == "stopped_accident";
    EXPECT_EQ(entry.confirmations, urgent ? 1 : 2) << name;
    EXPECT_GT(entry.hit_rate, entry.false_rate) << name;
  }
  EXPECT_EQ(catalogue.Get("meteorite").confirmations, 2);
}

TEST(HazardCatalogue, RatesAndConfirmationsOfAClassOverrideTheDefaults) {
  const auto catalogue = HazardCatalogue::Parse(
      "defaults: {confirmations: 3, hit_rate: 0.6}\n"
      "classes: {deer: {confirmations: 1, false_rate: 0.2}}",
      "test");
  EXPECT_EQ(catalogue.Get("deer").confirmations, 1);
  EXPECT_EQ(catalogue.Get("deer").hit_rate, 0.6);
  EXPECT_EQ(catalogue.Get("deer").false_rate, 0.2);
  EXPECT_EQ(catalogue.Get("meteorite").confirmations, 3);
}

TEST(HazardCatalogue, UnknownClassGetsTheDefaultsUnderItsOwnName) {
  const auto catalogue = HazardCatalogue::Parse(
      "defaults: {duplicate_radius_m: 8, urgency: 3}\nclasses: {deer: {label: Deer}}", "test");
  const HazardClass entry = catalogue.Get("meteorite");
  EXPECT_EQ(entry.name, "meteorite");
  EXPECT_EQ(entry.label, "meteorite");
  EXPECT_EQ(entry.duplicate_radius_m, 8.0);
  EXPECT_EQ(entry.urgency, 3);
  EXPECT_EQ(catalogue.Get("deer").duplicate_radius_m, 8.0) << "classes start from the defaults";
}

TEST(HazardCatalogue, LargestRadiusCountsTheDefaultToo) {
  EXPECT_EQ(HazardCatalogue().MaxDuplicateRadiusM(), 5.0);
  const auto catalogue = HazardCatalogue::Parse(
      "classes: {deer: {duplicate_radius_m: 40}, cone: {duplicate_radius_m: 2}}", "test");
  EXPECT_EQ(catalogue.MaxDuplicateRadiusM(), 40.0);
  EXPECT_EQ(catalogue.DuplicateRadiusM("cone"), 2.0);
  EXPECT_EQ(catalogue.DuplicateRadiusM("meteorite"), 5.0);
}

struct BadCatalogue {
  std::string yaml;
  std::string must_name;
};

class HazardCatalogueRefuses : public ::testing::TestWithParam<BadCatalogue> {};

TEST_P(HazardCatalogueRefuses, WithASentenceThatNamesFileAndFault) {
  EXPECT_THAT([] { HazardCatalogue::Parse(GetParam().yaml, "my.yaml"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("my.yaml"), HasSubstr(GetParam().must_name))));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, HazardCatalogueRefuses,
    ::testing::Values(BadCatalogue{"", "must be a map"}, BadCatalogue{"a: [", "no YAML"},
                      BadCatalogue{"classes: 3", "map of class names"},
                      BadCatalogue{"defaults: {}", "classes"},
                      BadCatalogue{"classes: {}\nclases: {}", "'clases'"},
                      BadCatalogue{"classes: {deer: 4}", "class 'deer'"},
                      BadCatalogue{"classes: {Deer: {}}", "class 'Deer'"},
                      BadCatalogue{"classes: {deer: {}, deer: {}}", "twice"},
                      BadCatalogue{"classes: {deer: {radius: 4}}", "'radius'"},
                      BadCatalogue{"classes: {deer: {duplicate_radius_m: -1}}", "'-1'"},
                      BadCatalogue{"classes: {deer: {duplicate_radius_m: .nan}}",
                                   "'duplicate_radius_m'"},
                      BadCatalogue{"classes: {deer: {duplicate_radius_m: wide}}", "'wide'"},
                      BadCatalogue{"classes: {deer: {expected_life_s: .inf}}", "'expected_life_s'"},
                      BadCatalogue{"classes: {deer: {urgency: 1.5}}", "'1.5'"},
                      BadCatalogue{"classes: {deer: {urgency: [1]}}", "'urgency'"},
                      BadCatalogue{"classes: {deer: {confirmations: 0}}", "'confirmations'"},
                      BadCatalogue{"classes: {deer: {confirmations: 6}}", "'6'"},
                      BadCatalogue{"classes: {deer: {hit_rate: 0.4}}", "'hit_rate'"},
                      BadCatalogue{"classes: {deer: {false_rate: .nan}}", "'false_rate'"},
                      BadCatalogue{"classes: {deer: {colour: red}}", "'red'"},
                      BadCatalogue{"classes: {deer: {icon: ../x}}", "'../x'"},
                      BadCatalogue{"classes: {deer: {label: <b>}}", "'<b>'"}));

TEST(HazardCatalogue, AByteOrderMarkIsSkippedOrNamed) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/hazards.yaml";
  std::ofstream(path) << "\xef\xbb\xbf"
                      << ReadFile(LIVEMAP_SOURCE_DIR "/config/hazards.yaml", 1U << 20U);
  EXPECT_EQ(HazardCatalogue::Load(path).classes().count("pothole"), 1U);
  std::ofstream(path) << "\xff\xfe";
  EXPECT_THAT([&] { HazardCatalogue::Load(path); },
              ThrowsMessage<Error>(AllOf(HasSubstr(path), HasSubstr("UTF-16"))));
}

TEST(HazardCatalogue, MissingFileIsNamed) {
  EXPECT_THAT([] { HazardCatalogue::Load("/nowhere/hazards.yaml"); },
              ThrowsMessage<Error>(HasSubstr("/nowhere/hazards.yaml")));
}

}  // namespace
}  // namespace livemap::protocol
