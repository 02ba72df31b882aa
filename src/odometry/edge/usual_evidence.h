#pragma once

#include <optional>

#include "odometry/edge/usual_share.h"

namespace livemap::odometry {

/// How much of a keyframe a motion explains of a frame.
struct Evidence {
  double agreement = 0;            ///< Share of the edges in view whose residual is explained.
  std::optional<double> surfaces;  ///< Share of the surfaces where the frame measures them,
  std::optional<double> picture;   ///< and of the pixels that look the same; none: not known.
  double picture_sigma = 0;        ///< How these differ, grey levels.
};

/// What frames that were followed explain, and which evidence is strange beside theirs.
class UsualEvidence {
 public:
  /// By how much less than the last frames' evidence may be; by UsualShare more where they vary.
  struct Drops {
    double agreement = 0.04;
    double surfaces = 0.05;
    double picture = 0.15;
    double strange = 0.06;  ///< Agreement of a motion that was searched.
    double found = 0.15;    ///< Agreement and surfaces where a camera finds back.
  };

  explicit UsualEvidence(const Drops& drops) : drops_(drops) {}

  void Forget();
  void Add(const Evidence& evidence);

  /// The agreement; 0 before anything is known.
  double agreement() const { return agreement_.value(); }
  /// By how much the agreement of a frame may fall short of that without being strange.
  double AgreementDrop() const { return agreement_.Drop(drops_.agreement); }
  /// The same for a motion that a search found.
  double StrangeDrop() const;
  /// The same for a camera that finds back.
  double FoundDrop() const;
  /// The least agreement of a motion that is good, from `least` to `most`; `most` before
  /// anything is usual.
  double LeastAgreement(double least, double most) const;
  /// How pixels differ that show the same, grey levels.
  std::optional<double> picture_noise() const { return picture_noise_; }

  /// Whether the depth of the frame contradicts the motion.
  bool IsDisplaced(const Evidence& evidence) const;
  /// Whether its picture does.
  bool LooksUnlike(const Evidence& evidence) const;
  /// Whether its picture, if one is known, is as usual; before anything is, whether most of it
  /// looks the same.
  bool LooksConvincing(const Evidence& evidence) const;
  /// Whether a place that was looked for without any prior looks as places did before.
  bool IsRecognised(const Evidence& evidence) const;

 private:
  /// Share of the surfaces that is expected before anything is usual.
  static constexpr double kSurfacesAtFirst = 0.95;

  double LeastSurfaces() const { return surfaces_.value() - surfaces_.Drop(drops_.surfaces); }
  double UsuallyLeastPicture() const { return picture_.value() - picture_.Drop(drops_.picture); }

  Drops drops_;
  UsualShare agreement_;
  UsualShare surfaces_{kSurfacesAtFirst};
  UsualShare picture_;
  std::optional<double> picture_noise_;
};

}  // namespace livemap::odometry
