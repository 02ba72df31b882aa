#include "receiver/gpsd_client.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "common/mutex.h"

namespace livemap::receiver {
namespace {

using testing::HasSubstr;

constexpr double kPatienceS = 120;
const char* const kGreeting =
    R"({"class":"VERSION","release":"3.22","rev":"3.22","proto_major":3,"proto_minor":14})"
    "\r\n";
const char* const kDevices =
    R"({"class":"DEVICES","devices":[{"class":"DEVICE","path":"/dev/ttyACM0",)"
    R"("activated":"2026-11-26T00:45:34.194Z"},{"class":"DEVICE","path":"/dev/ttyUSB0"}]})"
    "\r\n";
const char* const kFixReport =
    R"({"class":"TPV","device":"/dev/ttyACM0","mode":3,"time":"2026-11-26T00:45:34.190Z",)"
    R"("lat":-27.6,"lon":-48.5,"altHAE":15.0,"epx":2.0,"epy":3.0,"epv":34.5,"track":45.0,)"
    R"("speed":10.001,"climb":0.1,"eps":0.7,"epc":138.0,"eph":17.1})"
    "\r\n";

/// A program at a port that says what the test wants.
class FakeGpsd {
 public:
  FakeGpsd() : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    if (bind(listener_, any, size) != 0 || getsockname(listener_, any, &size) != 0 ||
        listen(listener_, 10) != 0) {
      throw Error("no free TCP port");
    }
    port_ = ntohs(address.sin_port);
  }
  ~FakeGpsd() {
    HangUp();
    close(listener_);
  }
  FakeGpsd(const FakeGpsd&) = delete;
  FakeGpsd& operator=(const FakeGpsd&) = delete;

  int port() const { return port_; }

  /// Waits for the client and reads its wish to watch, which it returns. The probe before it says
  /// nothing.
  std::string Accept() {
    while (true) {
      HangUp();
      peer_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      std::string wish = ReadLine();
      if (!wish.empty()) return wish;
    }
  }
  std::string ReadLine() const {
    std::string line;
    char byte = 0;
    while (recv(peer_, &byte, 1, 0) == 1) {
      if (byte == '\n') return line;
      line += byte;
    }
    return "";
  }
  void Say(const std::string& text) const {
    ASSERT_EQ(send(peer_, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }
  /// Says the text again and again; ends when the client hangs up.
  void SayUntilHungUp(const std::string& text) const {
    while (send(peer_, text.data(), text.size(), MSG_NOSIGNAL) > 0) {
    }
  }
  void HangUp() {
    if (peer_ >= 0) close(peer_);
    peer_ = -1;
  }

 private:
  int listener_;
  int port_ = 0;
  int peer_ = -1;
};

/// What a client told so far.
class Told {
 public:
  GpsdCallbacks Callbacks() {
    GpsdCallbacks callbacks;
    callbacks.on_connection = [this](bool connected, const std::string& reason) {
      const MutexLock lock(mutex_);
      connections_.push_back(connected ? "connected" : reason);
      changed_.NotifyAll();
    };
    callbacks.on_devices = [this](const std::vector<GpsdDevice>& devices) {
      const MutexLock lock(mutex_);
      devices_ = devices;
      changed_.NotifyAll();
    };
    callbacks.on_satellites = [this](const std::string& device, int used, int visible) {
      const MutexLock lock(mutex_);
      satellites_ = device + " " + std::to_string(used) + " of " + std::to_string(visible);
      changed_.NotifyAll();
    };
    callbacks.on_report = [this](const ReceiverReport& report) {
      const MutexLock lock(mutex_);
      reports_.push_back(report);
      changed_.NotifyAll();
    };
    return callbacks;
  }

  /// The connection's so-manyth change, from 0; empty when patience ends.
  std::string Connection(std::size_t index) {
    const MutexLock lock(mutex_);
    WaitUntil([&] { return connections_.size() > index; });
    return connections_.size() > index ? connections_[index] : "";
  }
  std::vector<GpsdDevice> Devices(std::size_t count) {
    const MutexLock lock(mutex_);
    WaitUntil([&] { return devices_ && devices_->size() == count; });
    return devices_.value_or(std::vector<GpsdDevice>{});
  }
  std::vector<ReceiverReport> Reports(std::size_t count) {
    const MutexLock lock(mutex_);
    WaitUntil([&] { return reports_.size() >= count; });
    return reports_;
  }
  std::string Satellites() {
    const MutexLock lock(mutex_);
    WaitUntil([&] { return !satellites_.empty(); });
    return satellites_;
  }

 private:
  template <typename Condition>
  void WaitUntil(Condition condition) REQUIRES(mutex_) {
    const auto deadline = SteadyDeadline(kPatienceS);
    while (!condition() && changed_.WaitUntil(mutex_, deadline)) {
    }
  }

  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<std::string> connections_;
  std::optional<std::vector<GpsdDevice>> devices_;
  std::vector<ReceiverReport> reports_;
  std::string satellites_;
};

class GpsdClientTest : public testing::Test {
 protected:
  void Start(GpsdConfig config = {}) {
    config.port = gpsd_.port();
    config.reconnect_min_s = 0.01;
    config.reconnect_max_s = 0.05;
    client_ = std::make_unique<GpsdClient>(config, told_.Callbacks());
  }
  void Greet() {
    gpsd_.Accept();
    gpsd_.Say(kGreeting);
  }

  FakeGpsd gpsd_;
  Told told_;
  std::unique_ptr<GpsdClient> client_;
};

TEST_F(GpsdClientTest, HandsOnReportsDevicesAndSatellites) {
  Start();
  EXPECT_THAT(gpsd_.Accept(), HasSubstr(R"("json":true)"));
  gpsd_.Say(std::string(kGreeting) + kDevices + kFixReport +
            R"({"class":"SKY","device":"/dev/ttyACM0","nSat":2,"uSat":1,"satellites":[)"
            R"({"PRN":1,"el":1,"az":1,"ss":30,"used":true},)"
            R"({"PRN":2,"el":1,"az":1,"ss":30,"used":false}]})"
            "\r\n");
  EXPECT_EQ(told_.Connection(0), "connected");
  const std::vector<GpsdDevice> devices = told_.Devices(2);
  EXPECT_EQ(devices[0].path, "/dev/ttyACM0");
  EXPECT_TRUE(devices[0].is_open);
  EXPECT_EQ(devices[1].path, "/dev/ttyUSB0");
  EXPECT_FALSE(devices[1].is_open);
  const ReceiverReport report = told_.Reports(1).front();
  EXPECT_EQ(report.device, "/dev/ttyACM0");
  EXPECT_EQ(report.mode, ReceiverReport::kSpace);
  EXPECT_EQ(report.stamp_ns, 1'795'653'934'190'000'000);
  EXPECT_EQ(report.latitude_deg, -27.6);
  EXPECT_EQ(report.longitude_deg, -48.5);
  EXPECT_EQ(report.height_m, 15);
  EXPECT_EQ(report.east_error_m, 2);
  EXPECT_EQ(report.north_error_m, 3);
  EXPECT_EQ(report.radial_error_m, 17.1);
  EXPECT_EQ(report.up_error_m, 34.5);
  EXPECT_EQ(report.speed_mps, 10.001);
  EXPECT_EQ(report.course_deg, 45);
  EXPECT_EQ(report.climb_mps, 0.1);
  EXPECT_EQ(report.speed_error_mps, 0.7);
  EXPECT_EQ(report.climb_error_mps, 138);
  EXPECT_TRUE(std::isnan(report.course_error_deg));
  EXPECT_EQ(told_.Satellites(), "/dev/ttyACM0 1 of 2");
}

TEST_F(GpsdClientTest, TakesALineThatComesInPieces) {
  Start();
  Greet();
  const std::string line = kFixReport;
  gpsd_.Say(line.substr(0, 40));
  usleep(50'000);
  gpsd_.Say(line.substr(40) + line);
  EXPECT_EQ(told_.Reports(2).size(), 2U);
}

TEST_F(GpsdClientTest, AsksForOneReceiverAloneWhenToldTo) {
  GpsdConfig config;
  config.device = "/dev/ttyACM0";
  Start(config);
  EXPECT_THAT(gpsd_.Accept(), HasSubstr(R"("device":"/dev/ttyACM0")"));
}

TEST_F(GpsdClientTest, AsksWhichReceiversThereAreWhenOneComesOrGoes) {
  Start();
  Greet();
  gpsd_.Say("{\"class\":\"DEVICE\",\"path\":\"/dev/ttyACM0\",\"activated\":0}\r\n");
  EXPECT_THAT(gpsd_.ReadLine(), HasSubstr("?DEVICES;"));
  gpsd_.Say("{\"class\":\"DEVICES\",\"devices\":[]}\r\n");
  EXPECT_TRUE(told_.Devices(0).empty());
}

TEST_F(GpsdClientTest, ConnectsAgainAfterALossEvenInMidLine) {
  Start();
  Greet();
  EXPECT_EQ(told_.Connection(0), "connected");
  gpsd_.Say(R"({"class":"TPV","device)");
  gpsd_.HangUp();
  EXPECT_THAT(told_.Connection(1), HasSubstr("is lost"));
  Greet();
  EXPECT_EQ(told_.Connection(2), "connected");
  gpsd_.Say(kFixReport);
  EXPECT_EQ(told_.Reports(1).size(), 1U);
}

TEST_F(GpsdClientTest, FindsOutThatGpsdDoesNotAnswerAnyMore) {
  GpsdConfig config;
  config.silence_s = 0.1;
  Start(config);
  Greet();
  EXPECT_EQ(told_.Connection(0), "connected");
  EXPECT_THAT(gpsd_.ReadLine(), HasSubstr("?DEVICES;"));
  EXPECT_THAT(told_.Connection(1), HasSubstr("does not answer any more"));
}

TEST_F(GpsdClientTest, FindsOutThatAnotherProgramHasThePort) {
  GpsdConfig config;
  config.connect_timeout_s = 0.1;
  Start(config);
  gpsd_.Accept();
  gpsd_.Say("220 mail.example.org ESMTP\r\n");
  EXPECT_THAT(told_.Connection(0), HasSubstr("does not speak as gpsd does"));
}

TEST_F(GpsdClientTest, SurvivesNonsense) {
  Start();
  Greet();
  gpsd_.Say("\r\n{\r\n{}\r\n{\"class\":\"TPV\"\r\n{\"class\":\"TPV\",\"mode\":\"x\"}\r\n" +
            std::string(5000, '[') + "\r\n" + std::string("\0\xff\xfe\r\n", 5) +
            "{\"class\":\"TPV\",\"device\":\"" + std::string(4000, 'd') + "\",\"mode\":3}\r\n");
  gpsd_.Say(kFixReport);
  EXPECT_EQ(told_.Reports(1).back().latitude_deg, -27.6);
}

TEST_F(GpsdClientTest, HangsUpOnALineWithoutEnd) {
  Start();
  Greet();
  EXPECT_EQ(told_.Connection(0), "connected");
  gpsd_.SayUntilHungUp("xxxxxxxxxxxxxxxx");
  EXPECT_THAT(told_.Connection(1), HasSubstr("is lost"));
  Greet();
  EXPECT_EQ(told_.Connection(2), "connected");
}

TEST_F(GpsdClientTest, EndsWhileGpsdTalksWithoutPause) {
  Start();
  Greet();
  EXPECT_EQ(told_.Connection(0), "connected");
  std::thread talker([this] { gpsd_.SayUntilHungUp(kFixReport); });
  EXPECT_GE(told_.Reports(1000).size(), 1000U);
  client_.reset();
  talker.join();
}

TEST(GpsdClient, SaysWhyNobodyAnswersAndEndsAtOnce) {
  Told told;
  GpsdConfig config;
  {
    const FakeGpsd gone;
    config.port = gone.port();
  }
  const GpsdClient client(config, told.Callbacks());
  EXPECT_THAT(told.Connection(0), HasSubstr("refused"));
}

TEST(GpsdClient, RefusesDelaysThatAreNone) {
  GpsdConfig config;
  config.reconnect_min_s = 0;
  Told told;
  EXPECT_THROW(GpsdClient(config, told.Callbacks()), Error);
}

}  // namespace
}  // namespace livemap::receiver
