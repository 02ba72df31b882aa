#include "zone_load/fleet.h"

#include <livemap/HazardNotice.h>
#include <livemap/HazardReport.h>
#include <livemap/ReportReceipt.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "ros/conversions/hazard_conversions.h"
#include "zone_messages.h"

namespace livemap::bench {
namespace {

constexpr std::chrono::seconds kPatience{10};
constexpr std::chrono::milliseconds kPaceStep{2};
constexpr std::int64_t kFirstStampAgeNs = 5LL * 86400 * 1'000'000'000;

double MillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

Fleet::Fleet(const Config& config)
    : config_(config), street_(config.vehicles, SystemNs() - kFirstStampAgeNs) {
  const std::string base = "livemap/v1/" + config_.zone;
  listener_ = Connect("listener", base + "/notice",
                      [this](const transport::MqttMessage& message) { OnNotice(message); });
  for (std::uint32_t i = 0; i < config_.vehicles; ++i) {
    vehicles_.push_back(std::make_unique<Vehicle>());
    Vehicle& vehicle = *vehicles_.back();
    vehicle.id = "car-" + std::to_string(i);
    vehicle.random.seed(std::random_device{}());
    vehicle.next_step = config_.first_step;
    vehicle.client =
        Connect(vehicle.id, base + "/vehicle/" + vehicle.id + "/receipt",
                [this, i](const transport::MqttMessage& message) { OnReceipt(i, message); });
  }
  const auto deadline = Clock::now() + kPatience;
  const auto is_ready = [](const transport::MqttClient& client) {
    return client.statistics().subscriptions_granted > 0;
  };
  while (!is_ready(*listener_) || !std::all_of(vehicles_.begin(), vehicles_.end(),
                                               [&](auto& v) { return is_ready(*v->client); })) {
    if (Clock::now() > deadline) throw Error("not every vehicle could log in and subscribe");
    std::this_thread::sleep_for(kPaceStep);
  }
}

Fleet::~Fleet() { sending_ = false; }

std::unique_ptr<transport::MqttClient> Fleet::Connect(
    const std::string& id, const std::string& topic,
    std::function<void(const transport::MqttMessage&)> on_message) const {
  transport::MqttConfig options;
  options.host = config_.host;
  options.port = config_.port;
  options.client_id = options.user = id;
  options.password = PasswordOf(config_.credentials + "/" + id);
  options.clean_start = true;
  options.max_inflight = static_cast<int>(config_.window);
  transport::MqttCallbacks callbacks;
  callbacks.on_message = std::move(on_message);
  return std::make_unique<transport::MqttClient>(
      options, std::vector<transport::MqttSubscription>{{topic, 1}}, std::move(callbacks));
}

/// False when the vehicle's window is full.
bool Fleet::SendNext(std::uint32_t index) {
  Vehicle& vehicle = *vehicles_[index];
  const MutexLock lock(vehicle.mutex);
  if (!sending_ || vehicle.waiting.size() >= config_.window) return false;
  const Uuid uuid = Uuid::Random(vehicle.random);
  const std::uint32_t step = vehicle.next_step++;
  const auto now = Clock::now();
  vehicle.waiting[uuid] = {step, now, now};
  if (step % 2 == 1) {
    const MutexLock result_lock(result_mutex_);
    confirmed_[street_.PlaceOf(index, step).Key()] = now;
  }
  Send(vehicle, index, uuid, step);
  if (counting_) {
    const MutexLock result_lock(result_mutex_);
    ++result_.sent;
  }
  return true;
}

void Fleet::Send(Vehicle& vehicle, std::uint32_t index, const Uuid& uuid, std::uint32_t step) {
  protocol::Report report = street_.ReportOf(index, step);
  report.uuid = uuid;
  vehicle.client->Publish("livemap/v1/" + config_.zone + "/vehicle/" + vehicle.id + "/report",
                          Enclose(ros_io::ToMessage(report)), 1, 0);
}

void Fleet::OnReceipt(std::uint32_t index, const transport::MqttMessage& message) {
  const protocol::Receipt receipt = ros_io::FromMessage(Open<ReportReceipt>(message));
  answered_ = true;
  Vehicle& vehicle = *vehicles_[index];
  {
    const MutexLock lock(vehicle.mutex);
    const auto waiting = vehicle.waiting.find(receipt.report_uuid);
    if (waiting == vehicle.waiting.end()) return;  // A second receipt, for a resend.
    if (counting_) {
      const MutexLock result_lock(result_mutex_);
      ++(receipt.status == protocol::Receipt::Status::kCommitted ? result_.committed
                                                                 : result_.refused);
      result_.receipt_ms.push_back(MillisecondsSince(waiting->second.first_sent));
    }
    vehicle.waiting.erase(waiting);
  }
  if (config_.rate == 0) SendNext(index);
}

void Fleet::OnNotice(const transport::MqttMessage& message) {
  const protocol::Notice notice = ros_io::FromMessage(Open<HazardNotice>(message));
  if (notice.sightings != 2) return;  // Of a first report, or said again.
  const auto place = street_.PlaceAt(notice.position);
  if (!place) return;
  const MutexLock lock(result_mutex_);
  const auto sent = confirmed_.find(place->Key());
  if (sent == confirmed_.end()) return;
  if (counting_) result_.notice_ms.push_back(MillisecondsSince(sent->second));
  confirmed_.erase(sent);
}

/// Sends at the configured rate, the vehicles in turn, until then; resends what is overdue.
void Fleet::Pace(Clock::time_point until) {
  const auto start = Clock::now();
  auto next_look = start + std::chrono::seconds(1);
  double done = 0;
  std::uint32_t turn = 0;
  for (auto now = start; now < until; now = Clock::now()) {
    const double due = config_.rate * std::chrono::duration<double>(now - start).count();
    for (; done + 1 <= due; done += 1) {
      if (SendNext(turn++ % config_.vehicles) || !counting_) continue;
      const MutexLock lock(result_mutex_);
      ++result_.behind;
    }
    if (now >= next_look) {
      ResendOverdue(kPatience);
      next_look = now + std::chrono::seconds(1);
    }
    std::this_thread::sleep_for(kPaceStep);
  }
}

/// The zone's bridge may come after its map page: what is sent before goes nowhere.
void Fleet::WaitForZone() {
  const auto deadline = Clock::now() + kPatience;
  SendNext(0);
  while (!answered_) {
    if (Clock::now() > deadline) throw Error("the zone does not answer");
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    ResendOverdue({});
  }
}

void Fleet::ResendOverdue(Clock::duration patience) {
  const auto now = Clock::now();
  for (std::uint32_t i = 0; i < config_.vehicles; ++i) {
    Vehicle& vehicle = *vehicles_[i];
    const MutexLock lock(vehicle.mutex);
    for (auto& [uuid, waiting] : vehicle.waiting) {
      if (now - waiting.last_sent < patience) continue;
      waiting.last_sent = now;
      Send(vehicle, i, uuid, waiting.step);
      if (!counting_) continue;
      const MutexLock result_lock(result_mutex_);
      ++result_.resent;
    }
  }
}

Fleet::Result Fleet::Run(double warm_up_s, double seconds) {
  const auto as_duration = [](double s) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
  };
  WaitForZone();
  if (config_.rate == 0) {
    for (std::uint32_t i = 0; i < config_.vehicles; ++i) {
      while (SendNext(i)) {
      }
    }
  }
  Pace(Clock::now() + as_duration(warm_up_s));
  counting_ = true;
  const auto start = Clock::now();
  Pace(start + as_duration(seconds));
  counting_ = false;
  sending_ = false;
  std::uint32_t next_step = 0;
  for (const auto& vehicle : vehicles_) {
    const MutexLock vehicle_lock(vehicle->mutex);
    next_step = std::max(next_step, (vehicle->next_step + 1) / 2 * 2);
  }
  const MutexLock lock(result_mutex_);
  result_.next_step = next_step;
  result_.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  return std::move(result_);
}

}  // namespace livemap::bench
