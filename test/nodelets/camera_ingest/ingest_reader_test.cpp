#include "nodelets/camera_ingest/ingest_reader.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/error.h"
#include "imaging/camera_device.h"
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

/// A camera that is unplugged for a while after its first picture.
class UnpluggedForAWhile : public imaging::CameraDevice {
 public:
  void Open() override {
    if (++opened_ == 2) throw Error("the camera device is not there");
  }
  std::optional<imaging::DevicePicture> Read() override {
    if (++read_ == 2) return std::nullopt;
    imaging::DevicePicture picture;
    picture.encoded = {1};
    picture.age_s = 0.25;
    return picture;
  }

 private:
  int opened_ = 0, read_ = 0;
};

TEST_F(IngestReaderTest, ACameraComesBackAfterUnpluggingAndItsFramesAreStampedWhenTheyWereTaken) {
  config_.source = ros_io::IngestSource::kDevice;
  std::mutex mutex;
  std::vector<std::string> missed;
  std::vector<double> ages_s;
  {
    IngestReader reader(
        config_, imaging::MakeDeviceSource(std::make_unique<UnpluggedForAWhile>()),
        [&](const IngestFrame& frame) {
          const std::lock_guard<std::mutex> lock(mutex);
          ages_s.push_back((ros::Time::now() - frame.header().stamp).toSec());
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        },
        [&](const std::string& reason) {
          const std::lock_guard<std::mutex> lock(mutex);
          missed.push_back(reason);
        });
    const auto back = [&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return ages_s.size() > 1;
    };
    while (!back()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_THAT(missed, ElementsAre(HasSubstr("gives no image"), HasSubstr("is not there")));
  EXPECT_GE(ages_s.front(), 0.25);
  EXPECT_LT(ages_s.front(), 5);
}

}  // namespace
}  // namespace livemap::nodelets
