#include "odometry/edge/usual_evidence.h"

#include <algorithm>

namespace livemap::odometry {
namespace {

/// Weight of the newest frame in how pixels differ.
constexpr double kNewestNoise = 0.2;
/// Of what is usual, so much of the picture looks the same where a camera finds back.
constexpr double kFoundPicture = 0.6;
/// A share of the picture that is convincing before anything is usual.
constexpr double kConvincingPicture = 0.8;

}  // namespace

void UsualEvidence::Forget() {
  agreement_.Forget();
  surfaces_.Forget();
  picture_.Forget();
  picture_noise_.reset();
}

void UsualEvidence::Add(const Evidence& evidence) {
  agreement_.Add(evidence.agreement);
  if (evidence.surfaces) surfaces_.Add(*evidence.surfaces);
  if (!evidence.picture) return;
  picture_.Add(*evidence.picture);
  const double usual = picture_noise_.value_or(evidence.picture_sigma);
  picture_noise_ = usual + kNewestNoise * (evidence.picture_sigma - usual);
}

double UsualEvidence::StrangeDrop() const { return std::max(drops_.strange, AgreementDrop()); }

double UsualEvidence::FoundDrop() const { return std::max(drops_.found, AgreementDrop()); }

double UsualEvidence::LeastAgreement(double least, double most) const {
  if (agreement() == 0) return most;
  return std::min(most, std::max(least, agreement() - FoundDrop()));
}

bool UsualEvidence::IsDisplaced(const Evidence& evidence) const {
  return evidence.surfaces && *evidence.surfaces < LeastSurfaces();
}

bool UsualEvidence::LooksUnlike(const Evidence& evidence) const {
  return evidence.picture && picture_.value() > 0 && *evidence.picture < UsuallyLeastPicture();
}

bool UsualEvidence::LooksConvincing(const Evidence& evidence) const {
  const double least = picture_.value() > 0 ? UsuallyLeastPicture() : kConvincingPicture;
  return evidence.picture.value_or(1) >= least;
}

bool UsualEvidence::IsRecognised(const Evidence& evidence) const {
  return evidence.agreement >= agreement_.value() - FoundDrop() &&
         evidence.surfaces.value_or(1) >=
             std::min(LeastSurfaces(), surfaces_.value() - drops_.found) &&
         evidence.picture.value_or(1) >=
             std::min(UsuallyLeastPicture(), kFoundPicture * picture_.value());
}

}  // namespace livemap::odometry
