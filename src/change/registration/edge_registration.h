#pragma once

#include <opencv2/core.hpp>

#include "change/registration/registration.h"

namespace livemap::change {

/// Finds the scale and the shift by which the earlier picture's edges fit the later one's. It needs
/// no feature to look the same, and so works across seasons where RegisterByHomography does not; it
/// costs half of that. What it leaves out is that a second drive also turns and shears the view: on
/// a road by little. Pictures: 8 bit, grey or BGR; Error otherwise. Sizes without HasEdgeCells are
/// refused.
Registration RegisterByEdges(const cv::Mat& before, const cv::Mat& after,
                             const RegistrationConfig& options);

}  // namespace livemap::change
