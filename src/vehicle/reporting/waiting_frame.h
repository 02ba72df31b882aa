#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "imaging/report_picture.h"
#include "placement/hazard_placement.h"
#include "placement/sighting.h"
#include "vehicle/pictures/picture_order.h"
#include "vehicle/reporting/pass_sights.h"

namespace livemap::vehicle {

/// A hazard of one image that lies near enough to be reported.
struct PlacedSighting {
  placement::Sighting sighting;
  placement::PlacedHazard place;   ///< By all sights of the pass up to this one.
  Eigen::Vector3d earth_m;         ///< geo::EarthCentred of the place.
  std::optional<std::size_t> cut;  ///< Of the frame's order; none where it was known already.
  PassSights::Id pass = 0;
  std::size_t sights = 1;    ///< That its place is of.
  bool has_settled = false;  ///< It waits for no further sight (SettlingReports).
};

/// What the detector found in one image, until it is reported or dropped: it waits for the
/// vehicle's position, for its image, and for the pictures.
struct WaitingFrame {
  placement::SightingFrame frame;
  double arrival_s = 0;  ///< By the clock of the stamps.
  bool held_back = false;
  bool placed = false;
  std::vector<PlacedSighting> candidates;  ///< Once placed.
  CameraImage image;
  std::uint64_t order = 0;  ///< Of its pictures; 0: none yet.
  /// Once the order was answered: one for each cut, or nothing at all.
  std::optional<std::vector<imaging::CroppedPicture>> pictures;
};

}  // namespace livemap::vehicle
