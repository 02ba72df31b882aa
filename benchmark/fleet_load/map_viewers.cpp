#include "fleet_load/map_viewers.h"

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <charconv>
#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "common/error.h"

namespace livemap::bench {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;

constexpr std::chrono::seconds kConnectPatience{30};
constexpr std::chrono::seconds kSlowPause{10};
constexpr std::chrono::seconds kDrainTime{2};
/// What the system may hold for a slow one: little, so that the zone feels how slow it is.
constexpr int kSlowBufferBytes = 4096;

/// Of a hazard's event; 0 for another message. The zone writes the key once, behind the type.
std::uint64_t SequenceOf(std::string_view message) {
  constexpr std::string_view kKey = "\"sequence\":";
  if (message.find("\"type\":\"hazard\"") == std::string_view::npos) return 0;
  const std::size_t key = message.find(kKey);
  if (key == std::string_view::npos) return 0;
  std::uint64_t sequence = 0;
  std::from_chars(message.data() + key + kKey.size(), message.data() + message.size(), sequence);
  return sequence;
}

}  // namespace

class MapViewers::Crowd {
 public:
  explicit Crowd(const Config& config) : config_(config) {
    for (std::size_t i = 0; i < config.viewers; ++i) {
      viewers_.push_back(std::make_unique<Viewer>(context_));
      viewers_.back()->is_slow = i < config.slow;
      Connect(*viewers_.back());
    }
    thread_ = std::thread([this] { context_.run(); });
    const auto deadline = std::chrono::steady_clock::now() + kConnectPatience;
    while (ready_ < config.viewers && failed_ == 0 && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    if (ready_ == config.viewers) return;
    const std::size_t ready = ready_;
    const Result result = End();
    throw Error("of " + std::to_string(config.viewers) + " viewers of the map " +
                std::to_string(ready) + " could connect" +
                (result.first_loss.empty() ? "" : ": " + result.first_loss));
  }
  ~Crowd() { Stop(); }

  void StartCounting() { counting_ = true; }

  Result End() {
    // What the slow ones have not taken yet ends with the zone's goodbye, if it said that.
    asio::post(context_, [this] {
      is_draining_ = true;
      for (const auto& viewer : viewers_) viewer->pause.cancel();
    });
    std::this_thread::sleep_for(kDrainTime);
    Stop();
    for (const auto& viewer : viewers_) {
      if (viewer->is_open && !viewer->is_slow) ++result_.connected;
    }
    return std::move(result_);
  }

 private:
  struct Viewer {
    explicit Viewer(asio::io_context& context) : stream(context), pause(context) {}
    websocket::stream<asio::ip::tcp::socket> stream;
    asio::steady_timer pause;
    beast::flat_buffer message;
    bool is_slow = false;
    bool is_open = false;
  };

  void Stop() {
    context_.stop();
    if (thread_.joinable()) thread_.join();
  }

  void Connect(Viewer& viewer) {
    asio::ip::tcp::socket& socket = viewer.stream.next_layer();
    socket.open(asio::ip::tcp::v4());
    if (viewer.is_slow) socket.set_option(asio::socket_base::receive_buffer_size(kSlowBufferBytes));
    const asio::ip::tcp::endpoint server(asio::ip::address_v4::loopback(),
                                         static_cast<unsigned short>(config_.port));
    socket.async_connect(server, [this, &viewer](const beast::error_code& error) {
      if (error) return Lose(viewer, error);
      viewer.stream.async_handshake("127.0.0.1:" + std::to_string(config_.port), "/ws",
                                    [this, &viewer](const beast::error_code& refused) {
                                      if (refused) return Lose(viewer, refused);
                                      viewer.is_open = true;
                                      ++ready_;
                                      Read(viewer);
                                    });
    });
  }

  void Read(Viewer& viewer) {
    viewer.stream.async_read(
        viewer.message, [this, &viewer](const beast::error_code& error, std::size_t size) {
          if (error) return Lose(viewer, error);
          if (viewer.is_slow) {
            viewer.message.clear();
            return is_draining_ ? Read(viewer) : ReadLater(viewer);
          }
          if (counting_) {
            const auto* text = static_cast<const char*>(viewer.message.data().data());
            const std::uint64_t sequence = SequenceOf({text, size});
            if (sequence != 0) result_.heard.push_back({sequence, SteadyNs()});
          }
          viewer.message.clear();
          Read(viewer);
        });
  }

  void ReadLater(Viewer& viewer) {
    viewer.pause.expires_after(kSlowPause);
    viewer.pause.async_wait([this, &viewer](const beast::error_code&) { Read(viewer); });
  }

  void Lose(Viewer& viewer, const beast::error_code& error) {
    if (!viewer.is_open) ++failed_;
    viewer.is_open = false;
    // A connection that the zone cuts off loses what was not taken, and the reason with it.
    if (viewer.is_slow && ready_ == config_.viewers) {
      ++result_.slow_closed;
      return;
    }
    const std::string reason = error == websocket::error::closed
                                   ? std::string(viewer.stream.reason().reason.c_str())
                                   : error.message();
    if (result_.lost++ == 0) result_.first_loss = reason;
  }

  const Config config_;
  asio::io_context context_{1};
  std::vector<std::unique_ptr<Viewer>> viewers_;
  std::atomic<std::size_t> ready_{0};
  std::atomic<std::size_t> failed_{0};
  std::atomic<bool> counting_{false};
  bool is_draining_ = false;  ///< The thread's.
  Result result_;             ///< The thread's, until that has ended.
  std::thread thread_;
};

MapViewers::MapViewers(const Config& config) : crowd_(std::make_unique<Crowd>(config)) {}
MapViewers::~MapViewers() = default;
void MapViewers::StartCounting() { crowd_->StartCounting(); }
MapViewers::Result MapViewers::End() { return crowd_->End(); }

}  // namespace livemap::bench
