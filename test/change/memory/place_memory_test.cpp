#include "change/memory/place_memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/change/memory/place_fixture.h"
#include "test/support/temporary_directory.h"

namespace livemap::change {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

constexpr geo::GeoPoint kHere{40.4433, -79.9436};

geo::GeoPoint East(double metres) { return geo::LocalFrame(kHere).ToGeo({metres, 0}); }

class PlaceMemoryTest : public testing::Test {
 protected:
  PlaceMemory::Config Config() const {
    PlaceMemory::Config config;
    config.directory = folder_.path() + "/places";
    return config;
  }
  std::string IndexPath() const { return Config().directory + "/places.sqlite3"; }
  std::vector<std::string> Files(const std::string& inside = "frames") const {
    std::vector<std::string> files;
    const std::string folder = Config().directory + "/" + inside;
    if (!fs::exists(folder)) return files;
    for (const auto& item : fs::recursive_directory_iterator(folder)) {
      if (item.is_regular_file()) files.push_back(item.path().string());
    }
    return files;
  }
  static std::vector<std::int64_t> Ids(const std::vector<PlaceMatch>& candidates) {
    std::vector<std::int64_t> ids;
    for (const auto& candidate : candidates) ids.push_back(candidate.id);
    return ids;
  }
  void FillStreet(int frames) const {
    PlaceMemory memory(Config(), 1);
    for (int i = 0; i < frames; ++i) memory.Add(MakePlace(East(2.0 * i), i));
  }

  test::TemporaryDirectory folder_;
};

TEST_F(PlaceMemoryTest, FindsTheNearestThatLookTheSameWay) {
  PlaceMemory memory(Config(), 1);
  const auto near = memory.Add(MakePlace(East(1), 1, 1.0));
  const auto backwards = memory.Add(MakePlace(East(2), 2, 1.0 + 3.14));
  const auto further = memory.Add(MakePlace(East(-4), 3, 0.6));
  const auto outside = memory.Add(MakePlace(East(40), 4, 1.0));
  const auto own = memory.Add(MakePlace(East(0), 5, 1.0, "today"));
  ASSERT_TRUE(near && backwards && further && outside && own);
  const auto found = memory.Nearest({kHere, 1.0, "today"});
  EXPECT_THAT(Ids(found), testing::ElementsAre(*near, *further));
  EXPECT_NEAR(found[0].distance_m, 1, 1e-6);
  EXPECT_NEAR(found[1].heading_difference_rad, 0.4, 1e-6);
  EXPECT_EQ(Ids(memory.Nearest({kHere, 1.0, ""}))[0], *own);
  EXPECT_TRUE(memory.Nearest({{95, 0}, 1.0, ""}).empty());
  EXPECT_TRUE(memory.Nearest({kHere, std::nan(""), ""}).empty());
}

TEST_F(PlaceMemoryTest, HeadingsMeetAcrossNorth) {
  PlaceMemory memory(Config(), 1);
  const auto id = memory.Add(MakePlace(kHere, 1, 6.2));
  EXPECT_THAT(Ids(memory.Nearest({kHere, 0.1, ""})), testing::ElementsAre(*id));
}

TEST_F(PlaceMemoryTest, AgreesWithASearchThroughAllOfThem) {
  PlaceMemory::Config config = Config();
  config.reach.max_distance_m = 30;
  PlaceMemory memory(config, 1);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-60, 60);
  std::uniform_real_distribution<double> heading(0, 6.28);
  const geo::LocalFrame frame(kHere);
  std::vector<std::pair<std::int64_t, PlaceFrame>> all;
  for (int i = 0; i < 150; ++i) {
    const PlaceRecord record =
        MakePlace(frame.ToGeo({place(random), place(random)}), i, heading(random));
    all.emplace_back(*memory.Add(record), record.frame);
  }
  for (int i = 0; i < 30; ++i) {
    const PlaceQuery query{frame.ToGeo({place(random), place(random)}), heading(random), ""};
    std::vector<std::pair<double, std::int64_t>> expected;
    for (const auto& [id, remembered] : all) {
      const double distance_m = geo::GeodesicDistanceM(remembered.position, query.position);
      const double turn = std::abs(
          std::remainder(remembered.heading_rad - query.heading_rad, 2 * 3.14159265358979323846));
      if (distance_m <= 30 && turn <= config.reach.max_heading_difference_rad) {
        expected.emplace_back(distance_m, id);
      }
    }
    std::sort(expected.begin(), expected.end());
    expected.resize(std::min<std::size_t>(expected.size(), config.reach.candidates));
    const auto found = memory.Nearest(query);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t j = 0; j < found.size(); ++j) EXPECT_EQ(found[j].id, expected[j].second);
  }
}

TEST_F(PlaceMemoryTest, GivesBackFramesAfterARestart) {
  const PlaceRecord record = MakePlace(kHere, 1);
  std::int64_t id = 0;
  {
    PlaceMemory memory(Config(), 1);
    id = *memory.Add(record);
    EXPECT_EQ(memory.Add(record), id) << "the same frame twice";
    EXPECT_EQ(memory.size(), 1U);
  }
  PlaceMemory memory(Config(), 2);
  EXPECT_EQ(memory.size(), 1U);
  EXPECT_EQ(memory.recovery().orphan_files, 0U);
  const auto loaded = memory.Load(id);
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->picture, record.picture);
  EXPECT_FALSE(memory.Load(id + 1));
}

TEST_F(PlaceMemoryTest, RanksByTheNumberOfMatches) {
  PlaceMemory memory(Config(), 1);
  const auto other = memory.Add(MakePlace(East(1), 1));
  const PlaceRecord same = MakePlace(East(3), 2);
  const auto match = memory.Add(same);
  const auto ranked = memory.Rank(same.features, memory.Nearest({kHere, 1.0, ""}));
  ASSERT_EQ(ranked.size(), 2U);
  EXPECT_EQ(ranked[0].candidate.id, *match);
  EXPECT_EQ(ranked[0].matches, same.features.points.size());
  EXPECT_EQ(ranked[1].candidate.id, *other);
}

TEST_F(PlaceMemoryTest, CachedFeaturesStayWithinTheirBound) {
  PlaceMemory::Config config = Config();
  config.max_cached_bytes = 3.5 * static_cast<double>(MakePlace(kHere, 0).features.Bytes());
  PlaceMemory memory(config, 1);
  for (int i = 0; i < 8; ++i) memory.Add(MakePlace(East(i), i));
  const ImageFeatures features = MakePlace(kHere, 3).features;
  const auto nearest = memory.Nearest({kHere, 1.0, ""});
  EXPECT_EQ(memory.Rank(features, nearest).size(), 8U);
  EXPECT_LE(memory.cached_bytes(), config.max_cached_bytes);
  EXPECT_GT(memory.cached_bytes(), 0.5 * config.max_cached_bytes);
  EXPECT_EQ(memory.Rank(features, nearest)[0].matches, features.points.size());
}

TEST_F(PlaceMemoryTest, ACellKeepsItsNewestAndItsBest) {
  PlaceMemory::Config config = Config();
  const auto bytes = static_cast<double>(SerialisePlaceRecord(MakePlace(kHere, 0)).size());
  config.max_cell_bytes = 3.3 * std::max(bytes, 10000.0 / 3.3);
  ASSERT_GT(bytes, 3100) << "the fixture's frames are too small for this test";
  config.cell_m = 1000;
  PlaceMemory memory(config, 1);
  PlaceRecord best = MakePlace(kHere, 0);
  PlaceRecord good = MakePlace(East(1), 1);
  good.frame.position_sigma_m = 1;
  PlaceRecord poor = MakePlace(East(2), 2);
  poor.frame.position_sigma_m = 9;
  PlaceRecord poorer = MakePlace(East(3), 3);
  poorer.frame.position_sigma_m = 30;
  const auto best_id = memory.Add(best);
  const auto good_id = memory.Add(good);
  const auto poor_id = memory.Add(poor);
  ASSERT_EQ(memory.size(), 3U);
  // The newest stays though it is the worst; the worst of the others goes.
  const auto newest_id = memory.Add(poorer);
  ASSERT_TRUE(newest_id);
  EXPECT_THAT(Ids(memory.Nearest({kHere, 1.0, ""})),
              testing::ElementsAre(*best_id, *good_id, *newest_id));
  EXPECT_FALSE(memory.Load(*poor_id));
  // An old frame that is no better than what is there does not come in.
  PlaceRecord old = MakePlace(East(4), 4);
  old.frame.stamp_ns -= 400 * kDayNs;
  EXPECT_FALSE(memory.Add(old));
  // Half a year later the best has lost most of its worth.
  PlaceRecord later = MakePlace(East(5), 5);
  later.frame.stamp_ns += 180 * kDayNs;
  const auto later_id = memory.Add(later);
  EXPECT_THAT(Ids(memory.Nearest({kHere, 1.0, ""})),
              testing::ElementsAre(*best_id, *good_id, *later_id));
  EXPECT_EQ(Files().size(), 3U);
  EXPECT_LE(memory.bytes(), config.max_cell_bytes);
  // Another way of looking is another cell.
  ASSERT_TRUE(memory.Add(MakePlace(kHere, 6, 4.0)));
  EXPECT_EQ(memory.size(), 4U);
}

TEST_F(PlaceMemoryTest, TheOldestGoWhenTheWholeIsFull) {
  PlaceMemory::Config config = Config();
  config.max_cell_bytes = 2e4;
  config.max_bytes = 4e4;
  config.cell_m = 5;
  PlaceMemory memory(config, 1);
  for (int i = 0; i < 40; ++i) memory.Add(MakePlace(East(10.0 * i), i));
  EXPECT_LE(memory.bytes(), config.max_bytes);
  EXPECT_GT(memory.bytes(), 0.7 * config.max_bytes);
  EXPECT_EQ(memory.Nearest({East(390), 1.0, ""}).size(), 2U);
  EXPECT_TRUE(memory.Nearest({East(0), 1.0, ""}).empty());
  EXPECT_EQ(Files().size(), memory.size());
}

TEST_F(PlaceMemoryTest, AFrameThatNoCellHoldsIsRefused) {
  PlaceMemory::Config config = Config();
  config.max_cell_bytes = 1e4;
  PlaceMemory memory(config, 1);
  PlaceRecord large = MakePlace(kHere, 1);
  large.features.descriptors = cv::Mat::zeros(100, 128, CV_8UC1);
  large.features.points.assign(100, {1, 1});
  EXPECT_THROW(memory.Add(large), Error);
  EXPECT_EQ(Files().size(), 0U);
}

TEST_F(PlaceMemoryTest, NoRowIsWithoutItsFileNorFileWithoutRow) {
  FillStreet(5);
  const std::vector<std::string> files = Files();
  ASSERT_EQ(files.size(), 5U);
  fs::remove(files[1]);
  const std::string orphan(64, '0');
  fs::create_directories(Config().directory + "/frames/00");
  fs::copy_file(files[0], Config().directory + "/frames/00/" + orphan + ".jpg");
  std::ofstream(files[2] + ".tmp") << "half";
  PlaceMemory memory(Config(), 2);
  EXPECT_EQ(memory.size(), 4U);
  EXPECT_EQ(memory.recovery().lost_files, 1U);
  EXPECT_EQ(memory.recovery().orphan_files, 1U);
  EXPECT_EQ(Files().size(), 4U);
}

TEST_F(PlaceMemoryTest, ACorruptIndexIsSetAsideAndBuiltAgain) {
  FillStreet(300);
  {
    std::fstream file(IndexPath(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4096 * 3);
    file << std::string(4096 * 4, '\xa5');
  }
  PlaceMemory memory(Config(), 77);
  EXPECT_EQ(memory.recovery().set_aside, IndexPath() + ".corrupt-77");
  EXPECT_TRUE(fs::exists(IndexPath() + ".corrupt-77"));
  EXPECT_EQ(memory.recovery().rebuilt, 300U);
  EXPECT_EQ(memory.recovery().unreadable, 0U);
  EXPECT_EQ(memory.size(), 300U);
  EXPECT_EQ(memory.Nearest({East(400), 1.0, ""}).size(), 15U);
}

TEST_F(PlaceMemoryTest, AFileThatIsNoDatabaseAndAMissingOneAreBuiltAgain) {
  FillStreet(3);
  std::ofstream(IndexPath(), std::ios::trunc) << std::string(5000, 'x');
  for (const char* companion : {"-wal", "-shm"}) fs::remove(IndexPath() + companion);
  EXPECT_EQ(PlaceMemory(Config(), 2).recovery().rebuilt, 3U);
  for (const char* companion : {"", "-wal", "-shm"}) fs::remove(IndexPath() + companion);
  const PlaceMemory memory(Config(), 3);
  EXPECT_EQ(memory.recovery().rebuilt, 3U);
  EXPECT_EQ(memory.recovery().set_aside, "");
  EXPECT_EQ(Files().size(), 3U);
}

TEST_F(PlaceMemoryTest, ARebuildLeavesOutFilesThatAreDamaged) {
  FillStreet(4);
  std::fstream(Files()[2], std::ios::in | std::ios::out | std::ios::binary) << "damage";
  fs::remove(IndexPath());
  const PlaceMemory memory(Config(), 3);
  EXPECT_EQ(memory.recovery().rebuilt, 3U);
  EXPECT_EQ(memory.recovery().unreadable, 1U);
  EXPECT_EQ(Files().size(), 3U);
  EXPECT_EQ(Files("set_aside").size(), 1U);
}

TEST_F(PlaceMemoryTest, ADamagedFrameIsSetAsideWhenItIsRead) {
  FillStreet(4);
  std::fstream(Files()[0], std::ios::in | std::ios::out | std::ios::binary) << "damage";
  PlaceMemory memory(Config(), 2);
  EXPECT_EQ(memory.size(), 4U);
  const auto nearest = memory.Nearest({kHere, 1.0, ""});
  ASSERT_EQ(nearest.size(), 4U);
  EXPECT_EQ(memory.Rank(MakePlace(kHere, 2).features, nearest).size(), 3U);
  EXPECT_EQ(memory.damaged(), 1U);
  EXPECT_EQ(memory.size(), 3U);
  EXPECT_EQ(memory.Nearest({kHere, 1.0, ""}).size(), 3U);
  EXPECT_EQ(Files("set_aside").size(), 1U);
}

TEST_F(PlaceMemoryTest, RefusesWhatItCannotUse) {
  const auto why = [](const PlaceMemory::Config& config) -> std::string {
    try {
      PlaceMemory(config, 1);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  PlaceMemory::Config config = Config();
  config.cell_m = 0;
  EXPECT_THAT(why(config), HasSubstr("cell_m"));
  config = Config();
  config.half_life_days = std::nan("");
  EXPECT_THAT(why(config), HasSubstr("half_life_days"));
  config.directory = "";
  config.half_life_days = 1;
  EXPECT_THAT(why(config), HasSubstr("empty"));
  const PlaceMemory memory(Config(), 1);
  EXPECT_THAT(why(Config()), HasSubstr("in use"));
  config = Config();
  config.directory = folder_.path() + "/file";
  std::ofstream(config.directory) << "a file";
  EXPECT_THAT(why(config), HasSubstr("cannot be made"));
}

TEST_F(PlaceMemoryTest, RefusesAnIndexOfALaterProgramAndLeavesItAlone) {
  FillStreet(2);
  SqliteDatabase(IndexPath(), true).Execute("PRAGMA user_version=99");
  EXPECT_THROW(PlaceMemory(Config(), 1), StoreError);
  EXPECT_EQ(Files().size(), 2U);
}

TEST_F(PlaceMemoryTest, AFrameWhoseRowCannotBeWrittenLeavesNoFile) {
  PlaceMemory memory(Config(), 1);
  memory.Add(MakePlace(kHere, 0));
  SqliteDatabase saboteur(IndexPath(), true);
  saboteur.Execute(
      "CREATE TRIGGER full BEFORE INSERT ON frames BEGIN SELECT RAISE(ABORT, 'no space left'); "
      "END");
  EXPECT_THROW(memory.Add(MakePlace(East(1), 1)), StoreError);
  EXPECT_EQ(memory.size(), 1U);
  EXPECT_EQ(Files().size(), 1U);
  saboteur.Execute("DROP TRIGGER full");
  EXPECT_TRUE(memory.Add(MakePlace(East(1), 1)));
}

/// Adds frames along a street, over and over in the same few cells, and tells each by its number
/// once Add has returned, until it is killed.
[[noreturn]] void AddUntilKilled(const PlaceMemory::Config& config, int first, int pipe) {
  PlaceMemory memory(config, 1);
  for (int i = first;; ++i) {
    memory.Add(MakePlace(East(i % 37), i));
    if (write(pipe, &i, sizeof(i)) != sizeof(i)) _exit(1);
  }
}

TEST_F(PlaceMemoryTest, SurvivesBeingKilledAtAnyMoment) {
  PlaceMemory::Config config = Config();
  config.max_cell_bytes = 6e4;
  int next = 0;
  for (int round = 0; round < 12; ++round) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) AddUntilKilled(config, next, ends[1]);
    close(ends[1]);
    int number = 0;
    int count = 0;
    while (count < 10 + 5 * round && read(ends[0], &number, sizeof(number)) == sizeof(number)) {
      ++count;
      next = number + 1;
    }
    usleep(static_cast<useconds_t>(700 * round));
    kill(child, SIGKILL);
    while (read(ends[0], &number, sizeof(number)) == sizeof(number)) next = number + 1;
    close(ends[0]);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));
    next += 1;  // One more may have been committed without a word.

    PlaceMemory memory(config, round + 2);
    EXPECT_EQ(memory.recovery().set_aside, "");
    EXPECT_EQ(memory.recovery().lost_files, 0U) << "a row without its file";
    EXPECT_EQ(Files().size(), memory.size());
    EXPECT_LE(memory.recovery().orphan_files, 3U);
    ASSERT_GT(memory.size(), 0U);
    // The newest frame of a cell is never the one to go: what was told last is there, or what was
    // committed after it without a word.
    const auto found = memory.Nearest({East(number % 37), 1.0, ""});
    ASSERT_FALSE(found.empty());
    const auto is_last = [&](const auto& candidate) {
      return memory.Load(candidate.id)->frame.stamp_ns >= MakePlace(kHere, number).frame.stamp_ns;
    };
    EXPECT_TRUE(std::any_of(found.begin(), found.end(), is_last)) << number;
  }
}

}  // namespace
}  // namespace livemap::change
