#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "change/methods/change_probabilities.h"

namespace livemap::change {

/// The prediction of the pair `name` in a folder: `NAME.npy` (numpy, C order, float32, or uint8 for
/// 255ths; kChangeClasses x height x width, probabilities in the order of ChangeClass) or
/// `NAME.png` (one channel of 8 or 16 bits: how sure a change is, as a share of the full range).
/// Throws Error naming the path, what it holds and what is accepted.
ChangeProbabilities ReadPrediction(const std::string& folder, const std::string& name,
                                   cv::Size size);

/// The bytes of a .npy file as above. Throws Error naming `path`.
ChangeProbabilities ParseNpyProbabilities(const std::string& bytes, const std::string& path);

/// A change score as 16-bit picture `path`; makes the folder above it. Throws Error naming it.
void WriteScorePicture(const std::string& path, const ChangeProbabilities& probabilities);

/// Change or not, 8 bits: MostLikely's classes, as one channel. Throws Error naming the path.
void WriteClassPicture(const std::string& path, const cv::Mat& classes);

}  // namespace livemap::change
