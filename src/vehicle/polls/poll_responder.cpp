#include "vehicle/polls/poll_responder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace livemap::vehicle {
namespace {

constexpr std::size_t kMaxAnsweredKept = 1000;
constexpr std::size_t kMaxPollFrames = 50;
constexpr int kLuminanceGridPx = 64;
constexpr double kMinPlacePx = 32;

/// Where a place lies in an image: two standard deviations around its pixel.
imaging::Box PolledBoxOf(const placement::ProjectedPlace& view) {
  const auto half = [&view](int axis) {
    return static_cast<float>(
        std::max(kMinPlacePx / 2, 2 * std::sqrt(view.covariance_px2(axis, axis))));
  };
  const auto u = static_cast<float>(view.pixel.x());
  const auto v = static_cast<float>(view.pixel.y());
  return {u - half(0), v - half(1), u + half(0), v + half(1)};
}

}  // namespace

double PollResponder::MeanLuminance(const cv::Mat& image) {
  cv::Mat grid;
  cv::resize(image, grid, cv::Size(kLuminanceGridPx, kLuminanceGridPx), 0, 0, cv::INTER_NEAREST);
  if (grid.channels() == 3) cv::cvtColor(grid, grid, cv::COLOR_BGR2GRAY);
  return cv::mean(grid)[0];
}

void PollResponder::Add(const protocol::Poll& poll, double steady_s) {
  ++counters_.polls;
  const bool known = std::find(answered_.begin(), answered_.end(), poll.poll) != answered_.end() ||
                     std::any_of(open_.begin(), open_.end(), [&poll](const OpenPoll& open) {
                       return open.poll.poll == poll.poll;
                     });
  if (known) {
    ++counters_.repeated;
    return;
  }
  const double life_s =
      std::min(static_cast<double>(poll.expires_ns - poll.stamp_ns) * 1e-9, config_.max_life_s);
  if (!(life_s > config_.reserve_s) || open_.size() >= static_cast<std::size_t>(config_.max_open)) {
    ++counters_.not_taken;
    return;
  }
  OpenPoll open;
  open.poll = poll;
  open.answer_by_s = steady_s + life_s - config_.reserve_s;
  const bool wants_picture = poll.picture != protocol::PollPicture::kNone;
  open.no_stands_s = open.answer_by_s - (wants_picture ? config_.picture_wait_s : 0);
  open_.push_back(std::move(open));
}

void PollResponder::AddFrame(const placement::SightingFrame& frame, double now_s) {
  if (open_.empty()) return;
  waiting_.push_back({frame, now_s});
  if (waiting_.size() > kMaxPollFrames) waiting_.pop_front();
}

void PollResponder::AddLuminance(std::int64_t stamp_ns, double luminance) {
  if (open_.empty()) return;
  luminances_[stamp_ns] = luminance;
  if (luminances_.size() > 2 * kMaxPollFrames) luminances_.erase(luminances_.begin());
}

void PollResponder::AddChange(const ChangeEvidence& evidence) {
  if (!geo::IsValid(evidence.position) || !evidence.covariance_m2.allFinite() ||
      !(evidence.confidence > 0 && evidence.confidence <= 1)) {
    return;
  }
  for (OpenPoll& open : open_) {
    if (open.order != 0) continue;
    if (!MayBe(evidence.change_class, open.poll.class_name)) continue;
    const double sigma_m =
        std::sqrt((evidence.covariance_m2 + open.poll.covariance_m2).trace() / 2);
    const double gate_m =
        std::max(catalogue_.DuplicateRadiusM(open.poll.class_name), config_.gate_sigma * sigma_m);
    if (geo::GeodesicDistanceM(evidence.position, open.poll.position) > gate_m) continue;
    (evidence.vanished ? open.vanished : open.appeared) = evidence.confidence;
  }
}

void PollResponder::AddUnregistered() {
  // Before its first clear view a place is not what the picture shows.
  for (OpenPoll& open : open_) open.unregistered += open.clear_views > 0 ? 1 : 0;
}

std::vector<PictureOrder> PollResponder::TakePictureOrders() {
  return std::exchange(picture_orders_, {});
}

void PollResponder::AddPictures(std::uint64_t order,
                                std::vector<imaging::CroppedPicture> pictures) {
  for (OpenPoll& open : open_) {
    if (open.order == order) open.pictures = std::move(pictures);
  }
}

void PollResponder::Process(double now_s, double steady_s, const Vehicle& vehicle) {
  while (!waiting_.empty() && Work(waiting_.front(), now_s, steady_s, vehicle)) {
    waiting_.pop_front();
  }
  for (auto open = open_.begin(); open != open_.end();) {
    if (!IsReady(*open, steady_s, vehicle)) {
      ++open;
      continue;
    }
    Answer(*open);
    answered_.push_back(open->poll.poll);
    if (answered_.size() > kMaxAnsweredKept) answered_.pop_front();
    open = open_.erase(open);
  }
  if (open_.empty()) ForgetFrames();
}

void PollResponder::StartAnew() { ForgetFrames(); }

void PollResponder::ForgetFrames() {
  waiting_.clear();
  luminances_.clear();
}

/// True when the frame is done, whatever became of it.
bool PollResponder::Work(WaitingFrame& waiting, double now_s, double steady_s,
                         const Vehicle& vehicle) {
  waiting.arrival_s = std::min(waiting.arrival_s, now_s);  // The clock was set back.
  const double waited_s = now_s - waiting.arrival_s;
  const placement::SightingFrame& frame = waiting.frame;
  const VehiclePoseLookup::Lookup lookup = vehicle.pose_at(frame.stamp_ns, waited_s);
  if (lookup.answer == VehiclePoseLookup::Answer::kWait) return false;
  if (lookup.answer == VehiclePoseLookup::Answer::kHopeless) {
    for (OpenPoll& open : open_) ++open.troubles[Trouble::kNoFix];
    return true;
  }
  newest_base_ = lookup.base;
  newest_ns_ = frame.stamp_ns;
  const auto mounting = vehicle.mounting(frame.frame_id);
  // At a start the camera's calibration and mounting may come after its first image.
  if ((!vehicle.intrinsics || !mounting) && waited_s < config_.pose_wait_s) return false;
  const bool fits = vehicle.intrinsics && mounting &&
                    static_cast<std::uint32_t>(vehicle.intrinsics->width) == frame.image_width &&
                    static_cast<std::uint32_t>(vehicle.intrinsics->height) == frame.image_height;
  if (!fits) {
    for (OpenPoll& open : open_) ++open.troubles[Trouble::kNoCamera];
    return true;
  }
  const placement::PlacedCamera camera{lookup.base, *vehicle.intrinsics, *mounting};
  for (OpenPoll& open : open_) {
    // An answer whose picture is being made stands.
    if (!open.matched_s && open.order == 0) Look(open, frame, camera, steady_s, vehicle);
  }
  return true;
}

/// One image's word on one poll.
void PollResponder::Look(OpenPoll& open, const placement::SightingFrame& frame,
                         const placement::PlacedCamera& camera, double steady_s,
                         const Vehicle& vehicle) {
  const placement::ProjectedPlace view =
      placement::ProjectPlace(open.poll.position, open.poll.covariance_m2, camera,
                              config_.projection, config_.margin_share);
  if (const placement::Sighting* match = Match(open, frame, view, camera)) {
    open.is_seen = true;
    open.match_confidence = match->confidence;
    SetView(open, frame, camera.base, match->box, vehicle);
    // From afar a whole frame shows nothing that a person could judge by.
    const bool is_far = open.poll.picture == protocol::PollPicture::kFullFrame &&
                        view.distance_m > config_.max_range_m;
    if (!is_far) open.matched_s = steady_s;
    return;
  }
  const auto trouble = WhyNotClear(view, frame);
  if (!trouble) {
    CountView(open, frame, view, camera.base, vehicle);
    return;
  }
  ++open.troubles[*trouble];
  // The place has left the view: nearer images will not come.
  const bool left = *trouble == Trouble::kOutside && MayStand(open);
  if (left) open.no_stands_s = std::min(open.no_stands_s, steady_s);
}

/// A match counts wherever the detector sees it, also beyond the range of a no.
const placement::Sighting* PollResponder::Match(const OpenPoll& open,
                                                const placement::SightingFrame& frame,
                                                const placement::ProjectedPlace& view,
                                                const placement::PlacedCamera& camera) const {
  const double radius_m = catalogue_.DuplicateRadiusM(open.poll.class_name);
  const placement::Sighting* best = nullptr;
  for (const placement::Sighting& sighting : frame.sightings) {
    const bool counts = sighting.class_name == open.poll.class_name &&
                        sighting.confidence >= config_.min_confidence && sighting.confidence <= 1;
    if (!counts || (best != nullptr && best->confidence >= sighting.confidence)) continue;
    if (placement::IsAtPlace(sighting.box, open.poll.position, view, camera, config_.projection,
                             config_.gate_sigma, radius_m)) {
      best = &sighting;
    }
  }
  return best;
}

std::optional<PollResponder::Trouble> PollResponder::WhyNotClear(
    const placement::ProjectedPlace& view, const placement::SightingFrame& frame) const {
  if (view.visibility == placement::ProjectedPlace::Visibility::kBehind) return Trouble::kOutside;
  if (view.distance_m > config_.max_range_m) return Trouble::kTooFar;
  if (view.visibility == placement::ProjectedPlace::Visibility::kOutside) return Trouble::kOutside;
  const auto luminance = luminances_.find(frame.stamp_ns);
  if (luminance != luminances_.end() && luminance->second < config_.dark_luminance) {
    return Trouble::kDark;
  }
  return std::nullopt;
}

void PollResponder::CountView(OpenPoll& open, const placement::SightingFrame& frame,
                              const placement::ProjectedPlace& view, const geo::TrackPose& base,
                              const Vehicle& vehicle) {
  if (open.last_view &&
      geo::GeodesicDistanceM(*open.last_view, base.position) < config_.view_spacing_m) {
    return;
  }
  // The nearest view shows best that nothing is there.
  if (open.clear_views == 0 || view.distance_m < open.view_distance_m) {
    open.view_distance_m = view.distance_m;
    SetView(open, frame, base, PolledBoxOf(view), vehicle);
  }
  open.last_view = base.position;
  ++open.clear_views;
}

/// The image that speaks for the answer from now on.
void PollResponder::SetView(OpenPoll& open, const placement::SightingFrame& frame,
                            const geo::TrackPose& base, const imaging::Box& box,
                            const Vehicle& vehicle) {
  open.view_ns = frame.stamp_ns;
  open.view_base = base;
  open.view_box = box;
  open.view_image = {};
  if (open.poll.picture != protocol::PollPicture::kNone && vehicle.image_at) {
    open.view_image = vehicle.image_at(frame.stamp_ns);
  }
}

bool PollResponder::IsGone(const OpenPoll& open) const {
  if (open.appeared > 0) return false;
  return open.clear_views >= (open.vanished > 0 ? 1 : config_.no_views);
}

/// Whether there is an answer with which it can end once the place has left the view. For a whole
/// frame somebody looks for himself whether the hazard is there: any clear view does.
bool PollResponder::MayStand(const OpenPoll& open) const {
  const bool wants_frame = open.poll.picture == protocol::PollPicture::kFullFrame;
  return IsGone(open) || open.is_seen || (wants_frame && open.clear_views > 0);
}

/// Orders the picture when the answer stands.
bool PollResponder::IsReady(OpenPoll& open, double steady_s, const Vehicle& vehicle) {
  if (open.pictures || steady_s >= open.answer_by_s) return true;
  if (open.order != 0) return false;
  const bool decided = open.matched_s || (MayStand(open) && steady_s >= open.no_stands_s);
  if (!decided) return false;
  if (open.poll.picture == protocol::PollPicture::kNone) return true;
  // It may have come after its frame.
  if (open.view_image.IsMissing() && vehicle.image_at) {
    open.view_image = vehicle.image_at(open.view_ns);
  }
  if (open.view_image.IsMissing()) {
    return !open.matched_s || steady_s - *open.matched_s >= config_.image_wait_s;
  }
  OrderPicture(open);
  return false;
}

/// What is written at the place in the picture: what the detector says of it.
std::string PollResponder::MarkOf(const OpenPoll& open) {
  if (open.is_seen) return imaging::MarkLabel(open.poll.class_name, open.match_confidence);
  return open.poll.class_name + " not found";
}

void PollResponder::OrderPicture(OpenPoll& open) {
  PictureOrder::Cut cut{open.view_box, config_.crop, MarkOf(open)};
  cut.crop.quality = config_.jpeg_quality;
  std::size_t most_bytes = cut.crop.max_bytes;
  if (open.poll.picture != protocol::PollPicture::kCrop) {
    cut.crop.context = 0;
    most_bytes = config_.max_frame_bytes;
  }
  cut.crop.max_bytes = std::min<std::size_t>(most_bytes, open.poll.max_picture_bytes);
  PictureOrder order;
  order.number = open.order = ++last_order_;
  order.image = open.view_image;
  order.cuts.push_back(cut);
  picture_orders_.push_back(std::move(order));
}

void PollResponder::Answer(OpenPoll& open) {
  const bool seen = open.is_seen;
  const bool not_there = !seen && IsGone(open);
  if (!seen && !not_there && !newest_base_) {
    ++counters_.unanswered;
    return;
  }
  protocol::PollAnswer reply;
  reply.poll = open.poll.poll;
  reply.hazard = open.poll.hazard;
  reply.zone = open.poll.zone;
  reply.drive_id = config_.drive_id;
  // The picture's stamp and place are the answer's.
  const bool decided = seen || not_there || (open.pictures && !open.pictures->empty());
  const geo::TrackPose& base = decided ? open.view_base : *newest_base_;
  reply.stamp_ns = decided ? open.view_ns : newest_ns_;
  reply.vehicle_position = base.position;
  reply.course_rad = base.course_rad;
  if (seen) {
    reply.answer = protocol::PollAnswer::Answer::kYes;
    reply.confidence = open.match_confidence;
    ++counters_.yes;
  } else if (not_there) {
    reply.answer = protocol::PollAnswer::Answer::kNo;
    // Both look at the same images: the surer one counts, not both together.
    const double views = 1 - std::pow(config_.miss_share, open.clear_views);
    reply.confidence =
        static_cast<float>(std::min(0.99, std::max(views, static_cast<double>(open.vanished))));
    ++counters_.no;
    if (open.clear_views < config_.no_views) ++counters_.no_by_change;
  } else {
    reply.answer = protocol::PollAnswer::Answer::kCantSee;
    reply.reason = ReasonOf(open);
    ++counters_.cant_see;
    if (open.clear_views >= config_.no_views) ++counters_.disagreed;
  }
  if (decided) AttachPicture(open, reply);
  replies_.push_back(std::move(reply));
}

/// What its order was answered with, if it has one: what may leave the vehicle.
void PollResponder::AttachPicture(OpenPoll& open, protocol::PollAnswer& reply) {
  if (!open.pictures || open.pictures->empty()) return;
  reply.image = std::move(open.pictures->front().jpeg);
  if (reply.image.empty()) return;
  reply.image_format = "jpeg";
  ++counters_.pictures;
  counters_.picture_bytes += reply.image.size();
}

/// What kept most images from counting; at most 64 bytes.
std::string PollResponder::ReasonOf(const OpenPoll& open) {
  if (open.clear_views > 0 && open.appeared > 0) return "seen as changed, but not detected";
  if (open.clear_views > 0 && open.unregistered > 0) {
    return "in view too few times, and unregistered with earlier drives";
  }
  if (open.clear_views > 0) return "the place was in view too few times";
  Trouble worst = Trouble::kTooFew;
  int most = 0;
  for (const auto& [trouble, count] : open.troubles) {
    if (count > most) {
      worst = trouble;
      most = count;
    }
  }
  switch (worst) {
    case Trouble::kNoFix:
      return "no position of the vehicle";
    case Trouble::kNoCamera:
      return "no calibrated camera";
    case Trouble::kTooFar:
      return "the place was too far away";
    case Trouble::kOutside:
      return "the place was out of the camera's view";
    case Trouble::kDark:
      return "too dark";
    case Trouble::kTooFew:
      break;
  }
  return "no image";
}

std::vector<protocol::PollAnswer> PollResponder::TakeReplies() {
  return std::exchange(replies_, {});
}

}  // namespace livemap::vehicle
