#include "perception/privacy/privacy_networks.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "common/error.h"
#include "common/text_file.h"
#include "test/perception/privacy/placed_networks.h"

namespace livemap::perception {
namespace {

std::string Shipped() { return std::string(LIVEMAP_SOURCE_DIR) + "/models/privacy.yaml"; }

std::string With(std::string yaml, const std::string& from, const std::string& to) {
  const std::size_t at = yaml.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return yaml.replace(at, from.size(), to);
}

TEST(PrivacyNetworks, TheShippedManifestNamesThreeFilesBesideIt) {
  const PrivacyNetworks networks = ReadPrivacyNetworks(Shipped());
  EXPECT_EQ(networks.faces.input.width, 320);
  EXPECT_EQ(networks.faces.input.channels, ChannelOrder::kRgb);
  EXPECT_EQ(networks.road_users.input.width, 416);
  for (const auto* each : {&networks.faces, &networks.plates, &networks.road_users}) {
    EXPECT_EQ(std::filesystem::path(each->file).parent_path(),
              std::string(LIVEMAP_SOURCE_DIR) + "/models/privacy");
    EXPECT_EQ(each->origin.rfind("https://", 0), 0U);
    EXPECT_FALSE(each->licence.empty());
    EXPECT_GT(each->found, 0);
  }
  EXPECT_GE(networks.faces.sure, networks.faces.found);
  EXPECT_GE(networks.plates.sure, networks.plates.found);
}

TEST(PrivacyNetworks, AMistakeInTheManifestIsNamed) {
  const std::string yaml = ReadTextFile(Shipped(), 100000);
  const auto why = [](const std::string& text) -> std::string {
    try {
      ParsePrivacyNetworks(text, "a.yaml", "");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(why(yaml), "");
  EXPECT_NE(why(With(yaml, "kind: privacy", "kind: change")).find("kind is 'change'"),
            std::string::npos);
  EXPECT_NE(why(With(yaml, "licence: MIT", "license: MIT")).find("'license'"), std::string::npos);
  EXPECT_NE(why(With(yaml, "sha256: 34cd", "sha256: XXcd")).find("faces.sha256"),
            std::string::npos);
  EXPECT_NE(why(With(yaml, "sure: ", "sure: 0.")).find("thresholds.sure"), std::string::npos)
      << "less than found";
  EXPECT_NE(why("{").find("YAML"), std::string::npos);
  EXPECT_NE(why(std::string(100000, ' ')).find("bytes"), std::string::npos);
}

TEST(PrivacyNetworks, AnythingWhereAFileBelongsCountsAsPlaced) {
  for (std::size_t which = 0; which < 3; ++which) {
    PlacedNetworks placed;
    placed.WriteManifest();
    const PrivacyNetworks networks = ReadPrivacyNetworks(placed.Manifest());
    EXPECT_FALSE(IsAnyPlaced(networks));
    std::filesystem::create_symlink("/nowhere", placed.File(which));
    EXPECT_TRUE(IsAnyPlaced(networks)) << which;
  }
}

}  // namespace
}  // namespace livemap::perception
