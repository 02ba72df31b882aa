#include "nodelets/edge_vo/eye_choice.h"

#include "common/time.h"

namespace livemap::nodelets {
namespace {

/// Images with depth further apart are none in succession, s.
constexpr double kSuccessionS = 1.0;

}  // namespace

const char* EyeName(Eye eye) {
  switch (eye) {
    case Eye::kUndecided:
      return "undecided";
    case Eye::kDepth:
      return "depth";
    case Eye::kMono:
      return "mono";
  }
  return "";
}

EyeChoice::EyeChoice(const Config& config) : config_(config) {
  if (config.wanted == Wanted::kDepth) eye_ = Eye::kDepth;
  if (config.wanted == Wanted::kMono) eye_ = Eye::kMono;
}

bool EyeChoice::OnImage(std::int64_t stamp_ns) {
  if (eye_ == Eye::kUndecided) {
    if (last_image_ns_ == 0) first_image_ns_ = stamp_ns;
    last_image_ns_ = stamp_ns;
    if (Seconds(stamp_ns - first_image_ns_) >= config_.wait_s) eye_ = Eye::kMono;
  }
  return eye_ == Eye::kMono;
}

bool EyeChoice::OnDepth(std::int64_t stamp_ns) {
  if (eye_ == Eye::kUndecided) eye_ = Eye::kDepth;
  if (eye_ == Eye::kMono && config_.wanted == Wanted::kAuto) {
    const bool in_succession = Seconds(stamp_ns - last_depth_ns_) <= kSuccessionS;
    depths_ = in_succession ? depths_ + 1 : 1;
    last_depth_ns_ = stamp_ns;
    if (depths_ >= config_.depths_to_change) eye_ = Eye::kDepth;
  }
  return eye_ == Eye::kDepth;
}

void EyeChoice::OnTimeReset() {
  first_image_ns_ = last_image_ns_ = last_depth_ns_ = 0;
  depths_ = 0;
}

}  // namespace livemap::nodelets
