#include "recordings/lens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/error.h"

namespace livemap::recordings {
namespace {

TEST(Lens, APinholeShowsItsFieldOfViewAcross) {
  const imaging::CameraCalibration calibration = CalibrationOf(PinholeLens(90), 1000, 500);
  EXPECT_NEAR(calibration.k(0, 0), 500, 1e-9);
  EXPECT_NEAR(calibration.k(0, 2), 499.5, 1e-9);
  EXPECT_TRUE(imaging::Rectifier(calibration, {}).is_identity());
}

TEST(Lens, OfAnUprightFrameTheFieldOfViewIsThatOfTheLongerSide) {
  EXPECT_NEAR(CalibrationOf(PinholeLens(90), 500, 1000).k(1, 1), 500, 1e-9);
}

TEST(Lens, EveryPresetCanBeRectified) {
  for (const Lens& lens : LensPresets()) {
    const imaging::CameraCalibration calibration = CalibrationOf(lens, 320, 180);
    const imaging::Rectifier rectifier(calibration, {});
    const double across_deg = 2 * std::atan(160 / rectifier.output().k(0, 0)) * 180 / M_PI;
    EXPECT_GT(across_deg, 50) << lens.name;
    EXPECT_LT(across_deg, 100.1) << lens.name;
  }
}

TEST(Lens, AnUnknownNameIsRefusedWithTheKnownOnes) {
  try {
    FindLens("fisheye");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("'fisheye', accepted are phone, "));
  }
}

TEST(Lens, ACameraFileOfAnotherSizeOfTheSameRatioIsScaled) {
  datasets::CameraFile camera;
  camera.name = "c";
  camera.intrinsics = {400, 400, 319.5, 179.5, 640, 360};
  const imaging::CameraCalibration calibration = CalibrationOf(camera, 1280, 720);
  EXPECT_NEAR(calibration.k(0, 0), 800, 1e-9);
  EXPECT_NEAR(calibration.k(0, 2), 639.5, 1e-9);
  EXPECT_THROW(CalibrationOf(camera, 640, 480), Error);
}

}  // namespace
}  // namespace livemap::recordings
