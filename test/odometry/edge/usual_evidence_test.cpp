#include "odometry/edge/usual_evidence.h"

#include <gtest/gtest.h>

namespace livemap::odometry {
namespace {

Evidence EvidenceOf(double agreement, double surfaces, double picture) {
  Evidence evidence;
  evidence.agreement = agreement;
  evidence.surfaces = surfaces;
  evidence.picture = picture;
  evidence.picture_sigma = 1;
  return evidence;
}

UsualEvidence After(int frames, const Evidence& each) {
  UsualEvidence usual{UsualEvidence::Drops()};
  for (int i = 0; i < frames; ++i) usual.Add(each);
  return usual;
}

TEST(UsualEvidence, AFrameLikeTheLastOnesIsNotStrange) {
  const Evidence each = EvidenceOf(0.9, 0.95, 0.9);
  const UsualEvidence usual = After(10, each);
  EXPECT_FALSE(usual.IsDisplaced(each));
  EXPECT_FALSE(usual.LooksUnlike(each));
  EXPECT_TRUE(usual.IsRecognised(each));
}

TEST(UsualEvidence, EachKindContradictsByItself) {
  const UsualEvidence usual = After(10, EvidenceOf(0.9, 0.95, 0.9));
  const Evidence displaced = EvidenceOf(0.9, 0.85, 0.9), unlike = EvidenceOf(0.9, 0.95, 0.7);
  EXPECT_TRUE(usual.IsDisplaced(displaced));
  EXPECT_FALSE(usual.LooksUnlike(displaced));
  EXPECT_TRUE(usual.LooksUnlike(unlike));
  EXPECT_FALSE(usual.IsDisplaced(unlike));
}

TEST(UsualEvidence, AnotherPlaceIsNotRecognised) {
  const UsualEvidence usual = After(10, EvidenceOf(0.9, 0.95, 0.9));
  EXPECT_TRUE(usual.IsRecognised(EvidenceOf(0.8, 0.85, 0.6)));
  EXPECT_FALSE(usual.IsRecognised(EvidenceOf(0.7, 0.95, 0.9)));
  EXPECT_FALSE(usual.IsRecognised(EvidenceOf(0.9, 0.7, 0.9)));
  EXPECT_FALSE(usual.IsRecognised(EvidenceOf(0.9, 0.95, 0.5)));
}

TEST(UsualEvidence, WhatIsNotKnownContradictsNothing) {
  const UsualEvidence usual = After(10, EvidenceOf(0.9, 0.95, 0.9));
  Evidence edges;
  edges.agreement = 0.9;
  EXPECT_FALSE(usual.IsDisplaced(edges));
  EXPECT_FALSE(usual.LooksUnlike(edges));
  EXPECT_TRUE(usual.IsRecognised(edges));
}

TEST(UsualEvidence, AtFirstSurfacesAreExpectedAndPicturesAreNot) {
  UsualEvidence usual{UsualEvidence::Drops()};
  EXPECT_TRUE(usual.IsDisplaced(EvidenceOf(0.9, 0.8, 0.1)));
  EXPECT_FALSE(usual.LooksUnlike(EvidenceOf(0.9, 0.8, 0.1)));
  EXPECT_FALSE(usual.picture_noise().has_value());
  usual.Add(EvidenceOf(0.9, 0.95, 0.9));
  EXPECT_DOUBLE_EQ(usual.picture_noise().value_or(0), 1);
  usual.Forget();
  EXPECT_FALSE(usual.picture_noise().has_value());
  EXPECT_EQ(usual.agreement(), 0);
}

TEST(UsualEvidence, APictureThatHardlyLooksTheSameConvincesNotAtFirstEither) {
  UsualEvidence usual{UsualEvidence::Drops()};
  EXPECT_FALSE(usual.LooksConvincing(EvidenceOf(0.9, 0.95, 0.2)));
  EXPECT_TRUE(usual.LooksConvincing(EvidenceOf(0.9, 0.95, 0.85)));
  EXPECT_TRUE(usual.LooksConvincing(Evidence()));
  usual = After(10, EvidenceOf(0.9, 0.95, 0.5));
  EXPECT_TRUE(usual.LooksConvincing(EvidenceOf(0.9, 0.95, 0.4)));
  EXPECT_FALSE(usual.LooksConvincing(EvidenceOf(0.9, 0.95, 0.3)));
}

TEST(UsualEvidence, AgreementMayBeSmallOnlyWhereItUsuallyVaries) {
  UsualEvidence usual{UsualEvidence::Drops()};
  EXPECT_DOUBLE_EQ(usual.LeastAgreement(0.3, 0.5), 0.5);
  usual = After(10, EvidenceOf(0.9, 0.95, 0.9));
  EXPECT_DOUBLE_EQ(usual.LeastAgreement(0.3, 0.5), 0.5);
  usual = After(10, EvidenceOf(0.6, 0.95, 0.9));
  EXPECT_NEAR(usual.LeastAgreement(0.3, 0.5), 0.45, 1e-9);
  usual.Add(EvidenceOf(0.2, 0.95, 0.9));
  EXPECT_DOUBLE_EQ(usual.LeastAgreement(0.3, 0.5), 0.3);
}

}  // namespace
}  // namespace livemap::odometry
