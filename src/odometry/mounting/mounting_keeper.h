#pragma once

#include <optional>
#include <string>

#include "odometry/mounting/mounting_calibrator.h"
#include "odometry/mounting/mounting_file.h"

namespace livemap::odometry {

/// How the camera is taken to be mounted now: each number from the surest of the parameters, the
/// file of earlier drives and this drive.
struct MountingInUse {
  Mounting mounting;
  Mounting sigma;
  bool found = false;  ///< At least one number is not the parameters' own.
};

/// Keeps a camera's mounting from drive to drive: reads it at the start, calibrates while the
/// vehicle drives, and writes what it found. Not thread-safe.
class MountingKeeper {
 public:
  struct Config {
    /// Of the file; empty: nothing is kept.
    std::string path;
    MountingCalibrator::Config calibrator;
    /// How sure the parameters in calibrator.assumed are, standard deviations.
    double parameter_sigma_rad = 0.035;
    double parameter_sigma_m = 0.05;
    /// What may have changed since the last drive: passengers, load.
    double drive_sigma_rad = 0.001;
    double drive_sigma_m = 0.01;
    /// Between two writings of the file, s of the stamps.
    double save_every_s = 60;
    /// This drive contradicts the file when they differ by so many standard deviations, and by at
    /// least as much as MountingEstimator's knocks.
    double knock_sigmas = 5;
  };

  /// Reads the file, if there is one. One that cannot be used (damaged, or of another camera) is
  /// renamed to PATH.refused, and problem() says why. Throws Error as MountingCalibrator does.
  MountingKeeper(const Config& config, const geo::CameraIntrinsics& camera);

  /// The next frame, as MountingCalibrator::Add. Writes the file when it is due: a few
  /// milliseconds once a minute.
  void Add(const CalibrationFrame& frame);

  /// Writes the file now, and makes its folder, if there is something to say; for the end of a
  /// drive.
  void Save();

  MountingInUse InUse() const;
  /// Of this drive alone.
  std::optional<MountingEstimate> ThisDrive() const { return calibrator_.Estimate(); }
  /// Of earlier drives; none when there is no file, or this drive has contradicted it.
  const std::optional<MountingEstimate>& EarlierDrives() const { return stored_; }

  /// Told once per knock: during the drive, or since the last one.
  std::optional<MountingKnock> TakeKnock();
  /// Whether it was made for this camera.
  bool IsOf(const geo::CameraIntrinsics& camera) const;
  /// In this drive.
  int knocks() const { return knocks_; }

  /// The last thing that was wrong with the file, a sentence; empty: nothing.
  const std::string& problem() const { return problem_; }
  const MountingCalibrator::Figures& figures() const { return calibrator_.figures(); }

 private:
  void Load();
  void CompareWithStored();
  std::optional<MountingEstimate> WorthKeeping() const;

  Config config_;
  geo::CameraIntrinsics camera_;
  MountingCalibrator calibrator_;
  std::optional<MountingEstimate> stored_;
  std::optional<MountingKnock> knock_;
  int knocks_ = 0;
  std::int64_t last_save_ns_ = 0;
  std::string problem_;
};

}  // namespace livemap::odometry
