#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "change/methods/change_probabilities.h"

namespace livemap::change {

/// Two pictures of one place, the earlier one warped into the later one's view.
struct AlignedPair {
  cv::Mat before;  ///< CV_8UC3, BGR.
  cv::Mat after;   ///< CV_8UC3, BGR, of the same size.
  cv::Mat valid;   ///< CV_8UC1: 255 where `before` is known, else 0.
  /// True: it is `after` that was warped, into the view of `before`, as when a pair is measured in
  /// the other order. A method that aligns parts of the pictures anew moves the warped one.
  bool after_is_warped = false;
};

/// Throws Error unless `valid` is a mask as AlignedPair has it, of `size`.
void CheckValidity(const cv::Mat& valid, cv::Size size);
/// `before` with the pixels of `after` where `valid` is 0: no edge stands there then.
cv::Mat FillUnknown(const cv::Mat& before, const cv::Mat& after, const cv::Mat& valid);

/// Makes no change certain where `valid` is 0: a map must not hear of what was never seen.
void MaskUnobserved(const cv::Mat& valid, ChangeProbabilities& probabilities);

/// Says what changed between two pictures. Not thread-safe.
class ChangeMethod {
 public:
  virtual ~ChangeMethod() = default;
  /// Probabilities of the pair's size. Where the pair is not valid nothing is said to have changed.
  /// Throws Error when the sizes or types are not as AlignedPair states.
  ChangeProbabilities Run(const AlignedPair& pair);
  /// The same, with what the method believes of pixels where the pair is not valid: a network knows
  /// that cars come and go and skies stay. For measuring how good its probabilities are.
  ChangeProbabilities Estimate(const AlignedPair& pair);
  /// True: Run gives kChangeClasses images; false: two.
  virtual bool tells_classes() const = 0;

 protected:
  virtual ChangeProbabilities Infer(const AlignedPair& pair) = 0;
};

/// No change at all, with certainty: what is said of a pair that could not be registered.
ChangeProbabilities NothingChanged(cv::Size size, bool tells_classes);

/// The classical baselines of the thesis (table 4.1): "dense-sift" and "daisy". A descriptor
/// stands at every `stride`-th pixel; the change score is the distance of the two descriptors, 0
/// for the same to 1 for the most that two can differ. It is a measure and no probability: only
/// the order of scores means something, figures at the most likely class do not.
std::unique_ptr<ChangeMethod> MakeDenseSiftDifference();
std::unique_ptr<ChangeMethod> MakeDaisyDifference();

/// The least that a method must beat: how far the colours of a pixel are apart, the mean of the
/// three channels, 0 to 1.
std::unique_ptr<ChangeMethod> MakeAbsoluteDifference();

/// Names that MakeChangeMethod accepts.
std::vector<std::string> ChangeMethodNames();
/// Throws Error naming what is accepted.
std::unique_ptr<ChangeMethod> MakeChangeMethod(const std::string& name);

}  // namespace livemap::change
