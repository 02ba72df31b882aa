#include "receiver/gpsd_client.h"

#include <fcntl.h>
#include <gps.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "common/time.h"
#include "transport/tcp_probe.h"

// Of the structs read below; older ones differ.
static_assert(GPSD_API_MAJOR_VERSION >= 10, "libgps is too old");

namespace livemap::receiver {
namespace {

// GPS_JSON_RESPONSE_MAX of libgps's own buffer, which its public header does not have.
constexpr std::size_t kMaxLineBytes = 10240;
// How many silences gpsd may let pass after it was asked.
constexpr int kUnansweredSilences = 2;

/// What goes to logs and messages: printable ASCII.
std::string Printable(std::string_view text) {
  std::string printable(text);
  std::replace_if(
      printable.begin(), printable.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return printable;
}

template <std::size_t size>
std::string TextOf(const char (&text)[size]) {
  return Printable(std::string_view(text, strnlen(text, size)));
}

/// Nanoseconds since 1970; 0 for what is no stamp.
std::int64_t StampOf(const timespec& time) {
  constexpr std::int64_t kMaxS = 4'294'967'295;
  if (time.tv_sec <= 0 || time.tv_sec >= kMaxS) return 0;
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

ReceiverReport ReportOf(const gps_data_t& data) {
  const gps_fix_t& fix = data.fix;
  ReceiverReport report;
  report.device = TextOf(data.dev.path);
  report.mode = fix.mode;
  report.status = fix.status;
  report.stamp_ns = StampOf(fix.time);
  report.latitude_deg = fix.latitude;
  report.longitude_deg = fix.longitude;
  report.height_m = fix.altHAE;
  report.east_error_m = fix.epx;
  report.north_error_m = fix.epy;
  report.radial_error_m = fix.eph;
  report.up_error_m = fix.epv;
  report.speed_mps = fix.speed;
  report.course_deg = fix.track;
  report.climb_mps = fix.climb;
  report.speed_error_mps = fix.eps;
  report.course_error_deg = fix.epd;
  report.climb_error_mps = fix.epc;
  return report;
}

std::vector<GpsdDevice> DevicesOf(const gps_data_t& data) {
  std::vector<GpsdDevice> devices;
  const int count = std::clamp(data.devices.ndevices, 0, MAXUSERDEVS);
  for (int i = 0; i < count; ++i) {
    const devconfig_t& device = data.devices.list[i];
    devices.push_back({TextOf(device.path), device.activated.tv_sec > 0});
  }
  return devices;
}

bool IsOf(const std::array<char, kMaxLineBytes + 1>& line, const char* object) {
  const std::string head = std::string(R"({"class":")") + object + "\"";
  return std::strncmp(line.data(), head.c_str(), head.size()) == 0;
}

int Milliseconds(double seconds) { return static_cast<int>(std::ceil(seconds * 1000)); }

}  // namespace

/// One connection, from its opening to its loss.
class GpsdClient::Session {
 public:
  Session(const GpsdConfig& config, const GpsdCallbacks& callbacks,
          const std::atomic<bool>& stopping)
      : config_(config),
        callbacks_(callbacks),
        stopping_(stopping),
        data_(std::make_unique<gps_data_t>()) {}
  ~Session() {
    if (open_) gps_close(data_.get());
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Why it could not be opened; empty when it is.
  std::string Open(const std::string& address) {
    if (gps_open(address.c_str(), std::to_string(config_.port).c_str(), data_.get()) != 0) {
      return std::string("cannot connect to it: ") + gps_errstr(errno);
    }
    open_ = true;
    // What gpsd does not take or send at once must not hold up the end of this.
    if (fcntl(fd(), F_SETFL, fcntl(fd(), F_GETFL) | O_NONBLOCK) != 0) return LostBecause(errno);
    unsigned flags = WATCH_ENABLE | WATCH_JSON;
    std::string device = config_.device;
    if (!device.empty()) flags |= WATCH_DEVICE;
    // libgps takes the device as void*.
    if (gps_stream(data_.get(), flags, device.empty() ? nullptr : device.data()) != 0) {
      return LostBecause(errno);
    }
    heard_ns_ = SteadyNs();
    return "";
  }

  int fd() const { return data_->gps_fd; }
  bool greeted() const { return greeted_; }

  /// Seconds until Tend wants to be called; the socket may be readable before.
  double WaitS() const {
    const double limit_s = greeted_ ? config_.silence_s * (1 + kUnansweredSilences * unanswered_)
                                    : config_.connect_timeout_s;
    return std::max(0.0, limit_s - SilentS());
  }

  /// Reads all that has come. Why the connection is lost; nothing while it holds.
  std::optional<std::string> Read() {
    while (!stopping_) {
      data_->set = 0;
      line_[0] = '\0';
      errno = 0;
      const int size = gps_read(data_.get(), line_.data(), static_cast<int>(line_.size()));
      if (size < 0) return LostBecause(errno);
      if (size == 0) return Closed();
      heard_ns_ = SteadyNs();
      unanswered_ = 0;
      Tell();
    }
    return std::nullopt;
  }

  /// Asks a silent gpsd whether it lives; the reason once it does not answer.
  std::optional<std::string> Tend() {
    if (WaitS() > 0) return std::nullopt;
    if (!greeted_) return "what answers at " + Place() + " does not speak as gpsd does";
    if (unanswered_ > 0) return "gpsd at " + Place() + " does not answer any more";
    ++unanswered_;
    return AskForDevices();
  }

 private:
  double SilentS() const { return Seconds(SteadyNs() - heard_ns_); }
  std::string Place() const { return config_.host + ":" + std::to_string(config_.port); }
  std::string LostBecause(int error) const {
    return "the connection to gpsd at " + Place() + " is lost" +
           (error == 0 ? "" : ": " + std::generic_category().message(error));
  }
  /// gps_read says 0 for "nothing now", and also where the other side has gone in mid-line.
  std::optional<std::string> Closed() const {
    char byte = 0;
    if (recv(fd(), &byte, 1, MSG_PEEK | MSG_DONTWAIT) == 0) return LostBecause(0);
    return std::nullopt;
  }
  std::optional<std::string> AskForDevices() {
    if (gps_send(data_.get(), "?DEVICES;\r\n") != 0) return LostBecause(errno);
    return std::nullopt;
  }

  void Tell() {
    if ((data_->set & VERSION_SET) != 0 && !greeted_) {
      greeted_ = true;
      callbacks_.on_connection(true, "");
    }
    if (!greeted_) return;
    if ((data_->set & DEVICELIST_SET) != 0) callbacks_.on_devices(DevicesOf(*data_));
    // libgps does not understand the word of a receiver that is gone, so the list is asked for.
    if (IsOf(line_, "DEVICE")) AskForDevices();
    if ((data_->set & SATELLITE_SET) != 0) {
      callbacks_.on_satellites(TextOf(data_->dev.path), data_->satellites_used,
                               data_->satellites_visible);
    }
    if (IsOf(line_, "TPV") && (data_->set & MODE_SET) != 0) callbacks_.on_report(ReportOf(*data_));
  }

  const GpsdConfig& config_;
  const GpsdCallbacks& callbacks_;
  const std::atomic<bool>& stopping_;
  std::unique_ptr<gps_data_t> data_;  // Larger than a stack likes.
  std::array<char, kMaxLineBytes + 1> line_{};
  bool open_ = false;
  bool greeted_ = false;  // It said that it is gpsd.
  std::int64_t heard_ns_ = 0;
  int unanswered_ = 0;  // Questions.
};

GpsdClient::GpsdClient(const GpsdConfig& config, GpsdCallbacks callbacks)
    : config_(config),
      callbacks_(std::move(callbacks)),
      backoff_(config.reconnect_min_s, config.reconnect_max_s, config.reconnect_jitter_seed),
      thread_([this] { Run(); }) {}

GpsdClient::~GpsdClient() {
  stopping_ = true;
  stop_.Signal();
  thread_.join();
}

void GpsdClient::Run() {
  while (!stopping_) {
    const std::string reason = Converse();
    if (stopping_) return;
    callbacks_.on_connection(false, reason);
    WaitToReconnect();
  }
}

void GpsdClient::WaitToReconnect() {
  pollfd stop{stop_.fd(), POLLIN, 0};
  poll(&stop, 1, Milliseconds(backoff_.NextDelayS()));
}

std::string GpsdClient::Converse() {
  const transport::TcpProbeResult probe =
      transport::ProbeTcp(config_.host, config_.port, config_.connect_timeout_s, stop_.fd());
  if (probe.numeric_address.empty()) return probe.error;
  Session session(config_, callbacks_, stopping_);
  std::string refused = session.Open(probe.numeric_address);
  if (!refused.empty()) return refused;
  while (true) {
    std::array<pollfd, 2> waited = {pollfd{session.fd(), POLLIN, 0}, pollfd{stop_.fd(), POLLIN, 0}};
    poll(waited.data(), waited.size(), Milliseconds(session.WaitS()));
    if (stopping_) return "";
    std::optional<std::string> lost;
    if (waited[0].revents != 0) lost = session.Read();
    if (session.greeted()) backoff_.Reset();
    if (!lost) lost = session.Tend();
    if (lost) return *lost;
  }
}

}  // namespace livemap::receiver
