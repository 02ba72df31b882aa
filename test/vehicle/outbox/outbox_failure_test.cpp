// The outbox of a vehicle on a disk that is full, read-only or damaged: real failures of a real
// file system, in a process of their own.
#include <gmock/gmock.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>

#include "imaging/report_picture.h"
#include "test/support/child_process.h"
#include "test/support/temporary_directory.h"
#include "test/vehicle/reporting/known_reports.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

using AddResult = LocalHazardMap::AddResult;

constexpr char kNoMounts[] = "no mounts";

LocalHazardMap OpenStore(const std::string& path) {
  LocalHazardMap::Config config;
  config.path = path;
  return LocalHazardMap(config, protocol::HazardCatalogue(), kNowNs);
}

protocol::Report LargeReport(int number) {
  protocol::Report report = MakeReport(number, East(10.0 * number));
  report.image.assign(20000, static_cast<std::uint8_t>(number));
  return report;
}

/// Adds reports until the store refuses one; how many it took.
int FillStore(LocalHazardMap& map) {
  for (int i = 0; i < 1000; ++i) {
    try {
      if (map.Add(LargeReport(i)) != AddResult::kAdded) return -1;
    } catch (const StoreError&) {
      return i;
    }
  }
  return -1;
}

/// What is wrong with a store that must hold exactly the first `count` large reports.
std::string WhatIsMissing(const LocalHazardMap& map, int count) {
  if (!map.set_aside().empty()) return "the store was taken for corrupt";
  if (map.pending_count() != static_cast<std::size_t>(count)) {
    return "holds " + std::to_string(map.pending_count()) + " of " + std::to_string(count);
  }
  for (int i = 0; i < count; ++i) {
    const auto report = map.LoadPending(Id(i));
    if (!report || report->image != LargeReport(i).image) {
      return "report " + std::to_string(i) + " is damaged";
    }
  }
  return "";
}

/// Fills the store at `path`, checks that what it took is whole, then lets `make_room` end the
/// shortage and checks that it takes reports again, also after a restart.
std::string FillAndRecover(const std::string& path, const std::function<void()>& make_room) {
  int accepted = 0;
  {
    LocalHazardMap map = OpenStore(path);
    accepted = FillStore(map);
    if (accepted < 5) return "took " + std::to_string(accepted) + " reports";
    if (map.Find("pothole", East(10.0 * accepted))) return "knows what it did not take";
    if (auto fault = WhatIsMissing(map, accepted); !fault.empty()) return "when full: " + fault;
    make_room();
    if (map.Add(LargeReport(accepted)) != AddResult::kAdded) return "takes nothing any more";
    if (auto fault = WhatIsMissing(map, accepted + 1); !fault.empty()) return "later: " + fault;
  }
  return WhatIsMissing(OpenStore(path), accepted + 1);
}

TEST(OutboxFailure, AFullFileSystemRefusesNewReportsAndHarmsNoneThatItTook) {
  test::TemporaryDirectory directory;
  const std::string& path = directory.path();
  const std::string fault = test::RunInChild([&path]() -> std::string {
    const bool own_mounts = unshare(CLONE_NEWNS) == 0 || unshare(CLONE_NEWUSER | CLONE_NEWNS) == 0;
    if (!own_mounts || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", path.c_str(), "tmpfs", 0, "size=1m") != 0) {
      return kNoMounts;
    }
    std::ofstream(path + "/ballast") << std::string(300000, 'x');
    return FillAndRecover(path + "/local.sqlite3",
                          [&path] { std::filesystem::remove(path + "/ballast"); });
  });
  if (fault == kNoMounts) GTEST_SKIP() << "skipped, this user may not mount a file system";
  EXPECT_EQ(fault, "");
}

TEST(OutboxFailure, AFileThatMayNotGrowRefusesNewReportsAndHarmsNoneThatItTook) {
  test::TemporaryDirectory directory;
  const std::string& path = directory.path();
  EXPECT_EQ("", test::RunInChild([&path]() -> std::string {
              signal(SIGXFSZ, SIG_IGN);
              rlimit limit{};
              getrlimit(RLIMIT_FSIZE, &limit);
              const rlim_t whole = limit.rlim_cur;
              limit.rlim_cur = 400000;
              setrlimit(RLIMIT_FSIZE, &limit);
              return FillAndRecover(path + "/local.sqlite3", [&limit, whole] {
                limit.rlim_cur = whole;
                setrlimit(RLIMIT_FSIZE, &limit);
              });
            }));
}

TEST(OutboxFailure, AReadOnlyFolderIsRefusedAtStartAndLeftAsItIs) {
  test::TemporaryDirectory directory;
  const std::string folder = directory.path() + "/folder";
  const std::string path = folder + "/local.sqlite3";
  std::filesystem::create_directory(folder);
  {
    LocalHazardMap map = OpenStore(path);
    for (int i = 0; i < 10; ++i) map.Add(LargeReport(i));
  }
  const auto size = std::filesystem::file_size(path);
  chmod(directory.path().c_str(), 0755);
  chmod(folder.c_str(), 0555);
  const std::string sentence = test::RunInChild([&path]() -> std::string {
    constexpr uid_t kNobody = 65534;
    if (geteuid() == 0 && seteuid(kNobody) != 0) return "cannot become another user";
    try {
      OpenStore(path);
    } catch (const Error& error) {
      return error.what();
    }
    return "opened";
  });
  EXPECT_THAT(sentence,
              ::testing::AllOf(::testing::HasSubstr(path), ::testing::HasSubstr("store")));
  EXPECT_EQ(std::filesystem::file_size(path), size);
  chmod(folder.c_str(), 0755);
  EXPECT_EQ(WhatIsMissing(OpenStore(path), 10), "");
}

TEST(OutboxFailure, BytesOfUnfinishedReportsAreBoundedAndThoseTakenStay) {
  test::TemporaryDirectory directory;
  LocalHazardMap::Config config;
  config.path = directory.path() + "/local.sqlite3";
  config.max_pending_bytes = 3 * 21100;
  LocalHazardMap map(config, protocol::HazardCatalogue(), kNowNs);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(map.Add(LargeReport(i)), AddResult::kAdded);
  EXPECT_EQ(map.Add(LargeReport(3)), AddResult::kFull);
  EXPECT_EQ(map.pending_bytes(), 3 * (20000 + LocalHazardMap::kReportBytes));
  EXPECT_EQ(WhatIsMissing(map, 3), "");
  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kCommitted;
  receipt.report_uuid = Id(1);
  receipt.hazard_uuid = Id(500);
  map.Apply(receipt);
  EXPECT_EQ(map.Add(LargeReport(3)), AddResult::kAdded) << "an answer makes room";
}

struct Damage {
  const char* name;
  double from_share;     ///< Of the file.
  std::size_t bytes;     ///< Overwritten; 0: the file ends there.
  std::size_t min_left;  ///< Reports of 200 that must come back.
  bool older = false;    ///< The file is of an older LiveMap.
};

class DamagedOutbox : public ::testing::TestWithParam<Damage> {};

TEST_P(DamagedOutbox, StartsAnewWithTheReportsThatCanStillBeRead) {
  test::TemporaryDirectory directory;
  const std::string path = directory.path() + "/local.sqlite3";
  const imaging::Picture grey{cv::Mat(120, 160, CV_8UC3, cv::Scalar(90, 120, 90)), nullptr};
  const auto jpeg = imaging::EncodeJpeg(grey, 80, 100000);
  std::map<Uuid, geo::GeoPoint> places;
  {
    LocalHazardMap map = OpenStore(path);
    for (int i = 0; i < 200; ++i) {
      protocol::Report report = MakeReport(i, East(10.0 * i));
      report.image = jpeg;
      places[report.uuid] = report.position;
      ASSERT_EQ(map.Add(report), AddResult::kAdded);
      if (i < 100) map.MarkSent(report.uuid);
    }
  }
  if (GetParam().older) MakeOlder(path);
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  const auto from = static_cast<std::streamoff>(GetParam().from_share * size);
  if (GetParam().bytes == 0) {
    std::filesystem::resize_file(path, static_cast<std::uintmax_t>(from));
  } else {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(from);
    file << std::string(GetParam().bytes, 'X');
  }
  LocalHazardMap map = OpenStore(path);
  ASSERT_NE(map.set_aside(), "");
  EXPECT_EQ(map.salvage().error, "");
  EXPECT_GE(map.pending_count(), GetParam().min_left);
  EXPECT_EQ(map.salvage().reports, map.pending_count());
  std::size_t sent = 0;
  for (const auto& pending : map.Pending()) {
    const auto report = map.LoadPending(pending.uuid);
    ASSERT_TRUE(report);
    ASSERT_EQ(places.count(report->uuid), 1u) << "nothing is invented";
    EXPECT_EQ(report->position.longitude_deg, places[report->uuid].longitude_deg);
    EXPECT_TRUE(map.Find("pothole", report->position)) << "known again as well";
    if (pending.sent) ++sent;
  }
  EXPECT_LE(sent, 100u);
  EXPECT_FALSE(std::filesystem::exists(map.set_aside() + ".salvage")) << "the working copy is gone";
  RecordProperty("came_back", static_cast<int>(map.pending_count()));
  std::cout << GetParam().name << ": " << map.pending_count() << " of 200 came back, "
            << map.salvage().unreadable << " unreadable\n";
}

INSTANTIATE_TEST_SUITE_P(Places, DamagedOutbox,
                         ::testing::Values(Damage{"first_page", 0, 4096, 200},
                                           Damage{"header", 0, 100, 200},
                                           Damage{"one_page_in_the_middle", 0.5, 4096, 190},
                                           Damage{"many_pages_in_the_middle", 0.5, 40960, 100},
                                           Damage{"cut_off_at_two_thirds", 0.67, 0, 80},
                                           Damage{"older_header", 0, 100, 200, true},
                                           Damage{"older_middle", 0.5, 4096, 190, true}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace livemap::vehicle
