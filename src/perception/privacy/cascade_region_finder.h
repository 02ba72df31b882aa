#pragma once

#include <memory>

#include "perception/privacy/private_region_finder.h"

namespace livemap::perception {

/// Faces and number plates by OpenCV's Haar cascades, and faces by a YuNet model where the
/// configuration names one. It finds far more than there is. Throws Error naming the file that
/// cannot be loaded.
std::unique_ptr<PrivateRegionFinder> MakeCascadeRegionFinder(const PrivateRegionConfig& config);

}  // namespace livemap::perception
