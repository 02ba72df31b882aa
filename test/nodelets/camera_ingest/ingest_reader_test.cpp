#include "nodelets/camera_ingest/ingest_reader.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "test/support/temporary_directory.h"

namespace livemap::nodelets {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A folder that is read to its end, as fast as the test runs.
class IngestReaderTest : public ::testing::Test {
 protected:
  IngestReaderTest() {
    ros::Time::init();
    config_.source = ros_io::IngestSource::kFolder;
    config_.uri = folder_.path();
    config_.stamps = "file_order";
    config_.rate_hz = 1000;
    config_.max_megapixels = 1e-3;
  }

  void Write(const std::string& name, int bytes) {
    std::ofstream(folder_.path() + "/" + name) << std::string(static_cast<std::size_t>(bytes), 'x');
  }

  /// Reads all; the frames' numbers, by their stamps, after the first one's.
  std::vector<int> ReadNumbers() {
    std::vector<ros::Time> stamps;
    IngestReader reader(
        config_, OpenSource(config_),
        [&](const IngestFrame& frame) { stamps.push_back(frame.header().stamp); },
        [&](const std::string& reason) { missed_.push_back(reason); });
    while (!reader.ended()) std::this_thread::yield();
    std::vector<int> numbers;
    for (const ros::Time& stamp : stamps) {
      numbers.push_back(
          static_cast<int>(std::lround((stamp - stamps.front()).toSec() * config_.rate_hz)));
    }
    return numbers;
  }

  test::TemporaryDirectory folder_;
  ros_io::IngestConfig config_;
  std::vector<std::string> missed_;
};

TEST_F(IngestReaderTest, AnUnreadablePictureAfterAGapLeavesLaterStampsWhereTheyBelong) {
  for (const char* name : {"10.png", "11.png", "12.png", "17.png", "18.png"}) Write(name, 10);
  Write("16.png", 20000);
  EXPECT_THAT(ReadNumbers(), ElementsAre(0, 1, 2, 7, 8));
  EXPECT_THAT(missed_, ElementsAre(HasSubstr("/16.png")));
}

}  // namespace
}  // namespace livemap::nodelets
