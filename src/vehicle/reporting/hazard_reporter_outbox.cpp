// The reports' way out: made, kept, sent until the zone has answered.
#include <algorithm>
#include <cstddef>
#include <utility>

#include "common/time.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::vehicle {
namespace {

constexpr std::size_t kMaxWaitingNotices = 20000;

}  // namespace

void HazardReporter::AddNotice(const protocol::Notice& notice) {
  ++counters_.notices;
  notices_.push_back(notice);
  if (notices_.size() > kMaxWaitingNotices) notices_.pop_front();
}

void HazardReporter::AddReceipt(const protocol::Receipt& receipt) {
  try {
    if (!map_.Apply(receipt)) return;
  } catch (const StoreError& error) {
    // The report stays unfinished and is sent again; so the zone answers again.
    TellStoreError(error);
    return;
  }
  schedule_.Remove(receipt.report_uuid);
  ++(receipt.status == protocol::Receipt::Status::kCommitted ? counters_.committed
                                                             : counters_.refused);
}

void HazardReporter::ApplyNotices() {
  if (notices_.empty()) return;
  try {
    counters_.invalid_notices += map_.Apply({notices_.begin(), notices_.end()});
    notices_.clear();
    store_error_.clear();
  } catch (const StoreError& error) {
    TellStoreError(error);  // They stay and are tried again.
  }
}

/// Once a minute of the stamps' clock.
void HazardReporter::ForgetUnannounced(double now_s) {
  constexpr double kPeriodS = 60.0;
  if (forgot_s_ && now_s >= *forgot_s_ && now_s - *forgot_s_ < kPeriodS) return;
  forgot_s_ = now_s;
  try {
    counters_.forgotten_unannounced +=
        map_.ForgetUnannounced(static_cast<std::int64_t>(now_s * 1e9));
  } catch (const StoreError& error) {
    TellStoreError(error);
  }
}

bool HazardReporter::IsCheap(double steady_s) const {
  if (link_ != LinkCost::kUnknown) return link_ == LinkCost::kCheap;
  const bool waits = held_at_start_ && steady_s - start_steady_s_ < config_.link_wait_s;
  return config_.unknown_link_is_cheap && !waits;
}

/// How long a report of this rank may wait for a cheap link.
double HazardReporter::HoldS(int urgency) const {
  const int rank = std::clamp(urgency, 1, static_cast<int>(config_.hold_s.size()));
  return config_.hold_s[static_cast<std::size_t>(rank - 1)];
}

std::int64_t HazardReporter::UtcNs(double steady_s) const {
  return start_ns_ + Nanoseconds(steady_s - start_steady_s_);
}

protocol::Report HazardReporter::MakeReport(const WaitingFrame& waiting,
                                            const PlacedSighting& candidate) {
  protocol::Report report;
  report.uuid = Uuid::Random(random_);
  report.drive_id = config_.drive_id;
  report.stamp_ns = waiting.frame.stamp_ns;
  report.class_name = candidate.sighting.class_name;
  report.confidence = candidate.sighting.confidence;
  report.box = candidate.sighting.box;
  report.position = candidate.place.position;
  report.covariance_m2 = candidate.place.covariance_m2;
  report.image_width = waiting.frame.image_width;
  report.image_height = waiting.frame.image_height;
  report.image_frame_id = waiting.frame.frame_id;
  AttachPicture(waiting, report);
  return report;
}

/// The surroundings of the report's box; the whole of a picture that is not of the image's size.
void HazardReporter::AttachPicture(const WaitingFrame& waiting, protocol::Report& report) {
  const cv::Mat& bgr = waiting.picture.bgr;
  const bool fits = bgr.cols == static_cast<int>(report.image_width) &&
                    bgr.rows == static_cast<int>(report.image_height);
  imaging::CroppedPicture cropped =
      imaging::CropPicture(waiting.picture, fits ? report.box : imaging::Box{}, config_.picture);
  if (cropped.jpeg.empty()) return;
  if (!cropped.legible) ++counters_.pictures_illegible;
  report.image_format = "jpeg";
  report.image = std::move(cropped.jpeg);
  if (fits) report.shown = cropped.shown;
}

void HazardReporter::ReportCandidates(const WaitingFrame& waiting, double steady_s) {
  for (const PlacedSighting& candidate : waiting.candidates) {
    if (map_.Find(candidate.sighting.class_name, candidate.place.position)) {
      ++counters_.duplicates_suppressed;
      continue;
    }
    const protocol::Report report = MakeReport(waiting, candidate);
    const int urgency = catalogue_.Get(report.class_name).urgency;
    const double hold_until_s = steady_s + HoldS(urgency);
    try {
      if (map_.Add(report, UtcNs(hold_until_s)) == LocalHazardMap::AddResult::kFull) {
        ++counters_.refused_map_full;
        continue;
      }
      store_error_.clear();
    } catch (const StoreError& error) {
      TellStoreError(error);  // Not known either: the next sight of it tries again.
      continue;
    }
    ++counters_.reports_created;
    if (report.image.empty()) ++counters_.reports_without_picture;
    schedule_.Add(report.uuid, urgency, report.stamp_ns, steady_s, hold_until_s);
  }
}

std::vector<protocol::Report> HazardReporter::TakeDue(double steady_s, std::size_t limit) {
  std::vector<protocol::Report> reports;
  schedule_.SetCheapLink(IsCheap(steady_s));
  try {
    for (const Uuid& uuid : schedule_.TakeDue(steady_s, limit)) {
      auto report = map_.LoadPending(uuid);
      if (!report) continue;
      if (schedule_.WasSent(uuid)) {
        ++counters_.resends;
      } else {
        map_.MarkSent(uuid);
        schedule_.MarkSent(uuid);
        ++counters_.reports_sent;
      }
      reports.push_back(std::move(*report));
    }
  } catch (const StoreError& error) {
    TellStoreError(error);
  }
  return reports;
}

void HazardReporter::TellStoreError(const StoreError& error) {
  ++counters_.store_errors;
  store_error_ = error.what();
}

}  // namespace livemap::vehicle
