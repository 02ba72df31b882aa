#pragma once

#include "odometry/se3.h"

namespace livemap::odometry {

/// What a covariance says of movements that nothing shows, square metres and radians: all but
/// nothing.
inline constexpr double kUnseenVariance = 100;

/// The part of a difference between two poses, a twist, that movements explain of which their
/// covariance knows nothing (see kUnseenVariance).
Vector6d UnseenPart(const Vector6d& difference, const Matrix6d& covariance);

/// Tells the movements of a camera that its edges show from those of which the normal equations of
/// an alignment know by the noise of the gradients alone: along stripes, say.
///
/// Noise in a gradient is squared in the normal equations and looks like knowledge there (errors in
/// variables; Fuller 1987, section 1.1). How much of them it is in each direction is known where
/// the noise is: the generalised eigenvalues of the noise's part by the whole, 0 to 1.
///
/// Typical usage:
///   const SeenMovements seen(information, noise_information);
///   if (!seen.All()) step = seen.Told(step);
class SeenMovements {
 public:
  /// Of the pose's part of the normal equations, and what the noise of the gradients is expected to
  /// have added to that: both of the twist, translation first. An `information` that is not
  /// positive definite tells nothing, so that all counts as seen.
  SeenMovements(const Matrix6d& information, const Matrix6d& noise_information);

  /// Whether less than half of what is known of each movement is noise.
  bool All() const;
  /// A step without its part along unseen movements.
  Vector6d Told(const Vector6d& step) const;
  /// The covariance of a step, m^2 and rad^2, with kUnseenVariance along unseen movements.
  Matrix6d Widened(const Matrix6d& covariance) const;

 private:
  Vector6d IsSeen() const;  // 1 or 0.

  bool is_known_ = false;
  Vector6d noise_shares_ = Vector6d::Zero();
  // Between twists and coordinates in which the information is the identity and the noise diagonal.
  Matrix6d twist_from_coordinates_ = Matrix6d::Identity();
  Matrix6d coordinates_from_twist_ = Matrix6d::Identity();
};

}  // namespace livemap::odometry
