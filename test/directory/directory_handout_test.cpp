#include "directory/directory_handout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "common/time.h"
#include "test/directory/test_authority.h"
#include "test/support/temporary_directory.h"

namespace livemap::directory {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class DirectoryHandoutTest : public testing::Test {
 protected:
  DirectoryHandoutTest() : path_(folder_.path() + "/zones.cms") {
    std::ofstream(folder_.path() + "/ca.pem") << authority_.Pem();
    config_.repeat_s = 600;
  }

  DirectoryHandout Open() {
    return {DirectoryFile(TrustedAuthority::Read(folder_.path() + "/ca.pem"), path_,
                          [this] { return now_ns_; }),
            config_};
  }
  void Write(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
    std::filesystem::last_write_time(
        path_, std::filesystem::last_write_time(path_) + std::chrono::seconds(++writes_));
  }
  void WriteVersion(std::uint64_t version) { Write(authority_.Sign(DirectoryText(version))); }
  /// Who is given the directory at the time when these were heard.
  static std::vector<std::string> GivenTo(DirectoryHandout& handout,
                                          const std::vector<std::string>& heard, double at_s) {
    for (const std::string& vehicle : heard) handout.Hear(vehicle);
    std::vector<std::string> vehicles;
    for (const auto& gift : handout.Next(Nanoseconds(at_s))) vehicles.push_back(gift.vehicle);
    return vehicles;
  }

  const TestAuthority authority_;
  const test::TemporaryDirectory folder_;
  const std::string path_;
  DirectoryHandout::Config config_;
  std::int64_t now_ns_ = kMarchNs;
  int writes_ = 0;
};

TEST_F(DirectoryHandoutTest, EachVehicleThatIsHeardIsGivenItOnceInAWhile) {
  WriteVersion(1);
  DirectoryHandout handout = Open();
  EXPECT_TRUE(handout.ReadIfChanged());
  EXPECT_EQ(handout.version(), 1U);
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 10), ElementsAre("car-1"));
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 11), ElementsAre("car-2"));
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 609.9), IsEmpty());
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 610), ElementsAre("car-1"));
  EXPECT_THAT(GivenTo(handout, {}, 2000), IsEmpty()) << "nobody was heard";
}

TEST_F(DirectoryHandoutTest, WhatIsGivenIsTheFileAsItIsSigned) {
  const std::string bytes = authority_.Sign(DirectoryText(1));
  Write(bytes);
  DirectoryHandout handout = Open();
  handout.ReadIfChanged();
  handout.Hear("car-1");
  const auto gifts = handout.Next(0);
  ASSERT_EQ(gifts.size(), 1U);
  EXPECT_EQ(*gifts.front().bytes, bytes);
}

TEST_F(DirectoryHandoutTest, ANewerOneGoesToEverybodyAndADamagedOrOlderFileToNobody) {
  WriteVersion(2);
  DirectoryHandout handout = Open();
  handout.ReadIfChanged();
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 10), ElementsAre("car-1"));
  WriteVersion(3);
  EXPECT_TRUE(handout.ReadIfChanged());
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 11), ElementsAre("car-1"));
  Write("half a file");
  EXPECT_TRUE(handout.ReadIfChanged());
  EXPECT_THAT(handout.damage(), HasSubstr("is no signed document"));
  WriteVersion(1);
  EXPECT_TRUE(handout.ReadIfChanged());
  EXPECT_EQ(handout.version(), 3U);
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 12), IsEmpty());
  EXPECT_THAT(GivenTo(handout, {"car-2"}, 13), ElementsAre("car-2")) << "the newest one is kept";
}

TEST_F(DirectoryHandoutTest, WithoutAValidDirectoryNobodyIsGivenAny) {
  DirectoryHandout handout = Open();
  EXPECT_FALSE(handout.ReadIfChanged());
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 10), IsEmpty());
  WriteVersion(1);
  handout.ReadIfChanged();
  now_ns_ += Nanoseconds(400.0 * 86400);
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 11), IsEmpty()) << "it has expired";
  EXPECT_EQ(handout.version(), 0U);
}

TEST_F(DirectoryHandoutTest, WhatCouldNotBeSentOrABrokerMayHaveLostIsGivenAgain) {
  WriteVersion(1);
  DirectoryHandout handout = Open();
  handout.ReadIfChanged();
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 10), ElementsAre("car-1", "car-2"));
  handout.TakeBack("car-2");
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 11), ElementsAre("car-2"));
  handout.TakeBackAll();
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2"}, 12), ElementsAre("car-1", "car-2"));
}

TEST_F(DirectoryHandoutTest, VehiclesWaitForTheirTurnWhenAllWouldTakeTooManyBytes) {
  WriteVersion(1);
  config_.bytes_per_s = static_cast<double>(std::filesystem::file_size(path_)) * 1.5;
  DirectoryHandout handout = Open();
  handout.ReadIfChanged();
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2", "car-3", "car-4"}, 10),
              ElementsAre("car-1", "car-2"));
  EXPECT_THAT(GivenTo(handout, {}, 10.1), IsEmpty());
  EXPECT_THAT(GivenTo(handout, {}, 11), ElementsAre("car-3"));
  EXPECT_THAT(GivenTo(handout, {}, 12), ElementsAre("car-4"));
}

TEST_F(DirectoryHandoutTest, NeitherWhoIsHeardNorWhoWasGivenItTakesMemoryWithoutEnd) {
  WriteVersion(1);
  config_.max_vehicles = 2;
  DirectoryHandout handout = Open();
  handout.ReadIfChanged();
  EXPECT_THAT(GivenTo(handout, {"car-1", "car-2", "car-3"}, 10), ElementsAre("car-1", "car-2"));
  EXPECT_THAT(GivenTo(handout, {"car-3"}, 11), ElementsAre("car-3"));
  EXPECT_THAT(GivenTo(handout, {"car-1"}, 12), ElementsAre("car-1")) << "forgotten";
}

}  // namespace
}  // namespace livemap::directory
