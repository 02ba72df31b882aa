#include "odometry/mounting/mounting_keeper.h"

#include <cmath>
#include <filesystem>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "common/time.h"

namespace livemap::odometry {
namespace {

/// The surer of two numbers.
void TakeSurer(double value, double sigma, double& best, double& best_sigma, bool& found) {
  if (!(sigma < best_sigma)) return;
  best = value;
  best_sigma = sigma;
  found = true;
}

void TakeSurer(const MountingEstimate& other, MountingInUse& best) {
  Mounting &mounting = best.mounting, &sigma = best.sigma;
  TakeSurer(other.mounting.yaw_rad, other.sigma.yaw_rad, mounting.yaw_rad, sigma.yaw_rad,
            best.found);
  TakeSurer(other.mounting.pitch_rad, other.sigma.pitch_rad, mounting.pitch_rad, sigma.pitch_rad,
            best.found);
  TakeSurer(other.mounting.roll_rad, other.sigma.roll_rad, mounting.roll_rad, sigma.roll_rad,
            best.found);
  TakeSurer(other.mounting.height_m, other.sigma.height_m, mounting.height_m, sigma.height_m,
            best.found);
}

/// Whether it could shows when the file is written.
void MakeFolderOf(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code ignored;
  if (!folder.empty()) std::filesystem::create_directories(folder, ignored);
}

bool ContradictsMounting(double one, double one_sigma, double other, double other_sigma,
                         double sigmas, double least) {
  const double difference = std::abs(one - other);
  // Infinite where one is not known: then nothing contradicts.
  return difference > least && difference > sigmas * std::hypot(one_sigma, other_sigma);
}

bool IsSameMountedCamera(const geo::CameraIntrinsics& one, const geo::CameraIntrinsics& other) {
  constexpr double kSamePx = 0.5;
  return one.width == other.width && one.height == other.height &&
         std::abs(one.fx - other.fx) < kSamePx && std::abs(one.fy - other.fy) < kSamePx &&
         std::abs(one.cx - other.cx) < kSamePx && std::abs(one.cy - other.cy) < kSamePx;
}

}  // namespace

MountingKeeper::MountingKeeper(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config), camera_(camera), calibrator_(config.calibrator, camera) {
  Load();
}

bool MountingKeeper::IsOf(const geo::CameraIntrinsics& camera) const {
  return IsSameMountedCamera(camera_, camera);
}

void MountingKeeper::Load() {
  std::error_code ignored;
  if (config_.path.empty() || !std::filesystem::exists(config_.path, ignored)) return;
  try {
    const MountingRecord record = ReadMountingFile(config_.path);
    if (!IsSameMountedCamera(record.camera, camera_)) {
      throw Error("the mounting file '" + config_.path + "' is of another camera: it has " +
                  std::to_string(record.camera.width) + "x" + std::to_string(record.camera.height) +
                  " pixels and fx " + std::to_string(record.camera.fx) + ", this one " +
                  std::to_string(camera_.width) + "x" + std::to_string(camera_.height) + " and " +
                  std::to_string(camera_.fx));
    }
    stored_ = record.estimate;
  } catch (const Error& error) {
    problem_ = error.what();
    std::filesystem::rename(config_.path, config_.path + ".refused", ignored);
    return;
  }
  Mounting& sigma = stored_->sigma;
  for (double* angle : {&sigma.yaw_rad, &sigma.pitch_rad, &sigma.roll_rad}) {
    *angle = std::hypot(*angle, config_.drive_sigma_rad);
  }
  sigma.height_m = std::hypot(sigma.height_m, config_.drive_sigma_m);
}

void MountingKeeper::Add(const CalibrationFrame& frame) {
  calibrator_.Add(frame);
  if (std::optional<MountingKnock> knock = calibrator_.TakeKnock()) {
    knock_ = knock;
    ++knocks_;
    stored_.reset();  // It was of the camera before.
  }
  CompareWithStored();
  if (last_save_ns_ == 0 || frame.stamp_ns < last_save_ns_) last_save_ns_ = frame.stamp_ns;
  if (Seconds(frame.stamp_ns - last_save_ns_) < config_.save_every_s) return;
  last_save_ns_ = frame.stamp_ns;
  Save();
}

/// A camera that was knocked, or mounted elsewhere, while nobody looked.
void MountingKeeper::CompareWithStored() {
  if (!stored_) return;
  const std::optional<MountingEstimate> now = calibrator_.Estimate();
  if (!now) return;
  const MountingEstimator::Config& least = config_.calibrator.estimator;
  const double sigmas = config_.knock_sigmas;
  const Mounting &old = stored_->mounting, &old_sigma = stored_->sigma;
  const Mounting &found = now->mounting, &sigma = now->sigma;
  const bool knocked = ContradictsMounting(old.yaw_rad, old_sigma.yaw_rad, found.yaw_rad,
                                           sigma.yaw_rad, sigmas, least.knock_angle_rad) ||
                       ContradictsMounting(old.pitch_rad, old_sigma.pitch_rad, found.pitch_rad,
                                           sigma.pitch_rad, sigmas, least.knock_angle_rad) ||
                       ContradictsMounting(old.roll_rad, old_sigma.roll_rad, found.roll_rad,
                                           sigma.roll_rad, sigmas, least.knock_angle_rad) ||
                       ContradictsMounting(old.height_m, old_sigma.height_m, found.height_m,
                                           sigma.height_m, sigmas, least.knock_height_m);
  if (!knocked) return;
  knock_ = MountingKnock{old, found};
  ++knocks_;
  stored_.reset();
}

MountingInUse MountingKeeper::InUse() const {
  MountingInUse best;
  best.mounting = config_.calibrator.assumed;
  best.sigma = {config_.parameter_sigma_rad, config_.parameter_sigma_rad,
                config_.parameter_sigma_rad, config_.parameter_sigma_m};
  if (stored_) TakeSurer(*stored_, best);
  if (const std::optional<MountingEstimate> now = calibrator_.Estimate()) TakeSurer(*now, best);
  return best;
}

/// The surest of file and drive, number by number; none before the drive has found anything.
std::optional<MountingEstimate> MountingKeeper::WorthKeeping() const {
  std::optional<MountingEstimate> estimate = calibrator_.Estimate();
  if (!estimate || !stored_) return estimate;
  MountingInUse best{estimate->mounting, estimate->sigma, false};
  TakeSurer(*stored_, best);
  estimate->mounting = best.mounting;
  estimate->sigma = best.sigma;
  estimate->roll_known = estimate->roll_known || stored_->roll_known;
  estimate->height_known = estimate->height_known || stored_->height_known;
  return estimate;
}

void MountingKeeper::Save() {
  if (config_.path.empty()) return;
  const std::optional<MountingEstimate> estimate = WorthKeeping();
  if (!estimate) return;
  try {
    MakeFolderOf(config_.path);
    ReplaceTextFile(config_.path, FormatMountingFile({camera_, *estimate}));
    problem_.clear();
  } catch (const Error& error) {
    problem_ = error.what();
  }
}

std::optional<MountingKnock> MountingKeeper::TakeKnock() {
  std::optional<MountingKnock> knock;
  std::swap(knock, knock_);
  return knock;
}

}  // namespace livemap::odometry
