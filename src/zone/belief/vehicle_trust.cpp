#include "zone/belief/vehicle_trust.h"

#include <algorithm>
#include <cmath>

#include "common/checks.h"
#include "common/log_odds.h"
#include "common/number_text.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxVouchersBytes = 200;

}  // namespace

VehicleTrust::VehicleTrust(const Config& config) : config_(config) {
  CheckRange("malicious_share", config.malicious_share, 0.001, 0.4);
  CheckRange("trust_memory_s", config.memory_s, 60, 1e10);
  CheckRange("max_suspicion", config.max_suspicion, 0.1, 20);
  CheckRange("max_vehicles", static_cast<double>(config.max_vehicles), 1, 1e9);
  prior_log_odds_ = LogOddsOf(config.malicious_share);
}

double VehicleTrust::Faded(const TrustRecord& record, std::int64_t now_ns) const {
  const double age_s = std::max(0.0, Seconds(now_ns) - Seconds(record.at_ns));
  return record.suspicion * std::exp(-age_s / config_.memory_s);
}

double VehicleTrust::MaliciousProbability(std::uint64_t vehicle, std::int64_t now_ns) const {
  const auto found = records_.find(vehicle);
  const double suspicion = found == records_.end() ? 0 : Faded(found->second, now_ns);
  return ProbabilityOf(prior_log_odds_ + suspicion);
}

TrustRecord& VehicleTrust::Find(std::uint64_t vehicle, std::int64_t now_ns) {
  const auto found = records_.find(vehicle);
  if (found != records_.end()) return found->second;
  if (records_.size() >= config_.max_vehicles) {
    records_.erase(
        std::min_element(records_.begin(), records_.end(), [&](const auto& a, const auto& b) {
          return Faded(a.second, now_ns) < Faded(b.second, now_ns);
        }));
  }
  return records_[vehicle];
}

void VehicleTrust::Judge(const Verdict& verdict, std::int64_t now_ns) {
  if (verdict.vehicle == 0 || !std::isfinite(verdict.log_ratio)) return;
  // Nothing is held against it, and more trust than a newcomer's there is not.
  if (verdict.log_ratio <= 0 && records_.count(verdict.vehicle) == 0) return;
  TrustRecord& record = Find(verdict.vehicle, now_ns);
  record.suspicion = Faded(record, now_ns);
  record.at_ns = std::max(record.at_ns, now_ns);
  if (verdict.log_ratio < 0 && verdict.voucher != 0) {
    auto& vouchers = record.vouchers;
    if (std::find(vouchers.begin(), vouchers.end(), verdict.voucher) != vouchers.end()) return;
    vouchers[record.next] = verdict.voucher;
    record.next = static_cast<std::uint8_t>((record.next + 1) % vouchers.size());
  }
  record.suspicion = std::clamp(record.suspicion + verdict.log_ratio, 0.0, config_.max_suspicion);
}

double VehicleTrust::Suspicion(std::uint64_t vehicle, std::int64_t now_ns) const {
  const auto found = records_.find(vehicle);
  return found == records_.end() ? 0 : Faded(found->second, now_ns);
}

void VehicleTrust::TakeBack(std::uint64_t vehicle, double added, std::int64_t at_ns,
                            std::int64_t now_ns) {
  if (vehicle == 0 || !std::isfinite(added)) return;
  const double age_s = std::max(0.0, Seconds(now_ns) - Seconds(at_ns));
  const double left = added * std::exp(-age_s / config_.memory_s);
  if (left >= 0 && records_.count(vehicle) == 0) return;
  TrustRecord& record = Find(vehicle, now_ns);
  record.suspicion = std::clamp(Faded(record, now_ns) - left, 0.0, config_.max_suspicion);
  record.at_ns = std::max(record.at_ns, now_ns);
}

void VehicleTrust::Distrust(std::uint64_t vehicle, std::int64_t now_ns) {
  if (vehicle == 0) return;
  TrustRecord& record = Find(vehicle, now_ns);
  record.suspicion = config_.max_suspicion;
  record.at_ns = std::max(record.at_ns, now_ns);
}

TrustRecord VehicleTrust::Get(std::uint64_t vehicle) const {
  const auto found = records_.find(vehicle);
  return found == records_.end() ? TrustRecord{} : found->second;
}

void VehicleTrust::Forget(std::uint64_t vehicle, std::uint64_t pseudonym) {
  records_.erase(vehicle);
  for (auto& [other, record] : records_) {
    std::replace(record.vouchers.begin(), record.vouchers.end(), vehicle, pseudonym);
  }
}

std::size_t VehicleTrust::Count(double malicious_above, std::int64_t now_ns) const {
  return static_cast<std::size_t>(
      std::count_if(records_.begin(), records_.end(), [&](const auto& record) {
        return MaliciousProbability(record.first, now_ns) >= malicious_above;
      }));
}

bool VehicleTrust::Restore(std::uint64_t vehicle, const TrustRecord& record) {
  const bool sound = vehicle != 0 && record.suspicion >= 0 && record.suspicion <= 100 &&
                     record.at_ns >= 0 && record.next < record.vouchers.size();
  if (!sound) return false;
  TrustRecord taken = record;
  taken.suspicion = std::min(taken.suspicion, config_.max_suspicion);
  Find(vehicle, record.at_ns) = taken;
  return true;
}

std::string PackTrust(const TrustRecord& record) {
  std::string line;
  AppendNumber(line, record.suspicion);
  AppendNumber(line, record.at_ns);
  return line + " " + PackVouchers(record);
}

std::optional<TrustRecord> UnpackTrust(const std::string& text) {
  const std::size_t second = text.find(' ');
  const std::size_t third = second == std::string::npos ? second : text.find(' ', second + 1);
  if (third == std::string::npos) return std::nullopt;
  const std::string numbers = text.substr(0, third);
  NumberReader reader(numbers);
  TrustRecord record;
  reader.Read(record.suspicion);
  reader.Read(record.at_ns);
  const bool sound = reader.good() && reader.done() && record.suspicion >= 0 &&
                     record.suspicion <= 100 && record.at_ns >= 0 &&
                     UnpackVouchers(text.substr(third + 1), record);
  return sound ? std::optional<TrustRecord>(record) : std::nullopt;
}

std::string PackVouchers(const TrustRecord& record) {
  std::string line;
  AppendNumber(line, static_cast<unsigned>(record.next));
  for (const std::uint64_t voucher : record.vouchers) AppendNumber(line, voucher);
  return line;
}

bool UnpackVouchers(const std::string& text, TrustRecord& record) {
  if (text.size() > kMaxVouchersBytes) return false;
  NumberReader reader(text);
  unsigned next = 0;
  auto vouchers = record.vouchers;
  reader.Read(next);
  for (std::uint64_t& voucher : vouchers) reader.Read(voucher);
  if (!reader.good() || !reader.done() || next >= vouchers.size()) return false;
  record.next = static_cast<std::uint8_t>(next);
  record.vouchers = vouchers;
  return true;
}

}  // namespace livemap::zone
