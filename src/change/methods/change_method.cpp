#include "change/methods/change_method.h"

#include <algorithm>

#include "common/error.h"
#include "common/text.h"

namespace livemap::change {

ChangeProbabilities NothingChanged(cv::Size size, bool tells_classes) {
  ChangeProbabilities probabilities;
  for (int i = 0; i < (tells_classes ? protocol::kChangeClasses : 2); ++i) {
    probabilities.of_class.emplace_back(size, CV_32FC1, cv::Scalar(i == 0 ? 1 : 0));
  }
  return probabilities;
}

void CheckValidity(const cv::Mat& valid, cv::Size size) {
  if (valid.type() == CV_8UC1 && valid.size() == size) return;
  throw Error("a mask of what is valid is " + std::to_string(valid.cols) + "x" +
              std::to_string(valid.rows) + " with " +
              PixelText(static_cast<int>(8 * valid.elemSize1()), valid.channels()) +
              ", accepted are " + PixelText(8, 1) + " and the pictures' " +
              std::to_string(size.width) + "x" + std::to_string(size.height));
}

cv::Mat FillUnknown(const cv::Mat& before, const cv::Mat& after, const cv::Mat& valid) {
  CheckValidity(valid, before.size());
  cv::Mat filled = before.clone();
  after.copyTo(filled, valid == 0);
  return filled;
}

void MaskUnobserved(const cv::Mat& valid, ChangeProbabilities& probabilities) {
  CheckValidity(valid, probabilities.of_class[0].size());
  const cv::Mat unseen = valid == 0;
  for (std::size_t i = 0; i < probabilities.of_class.size(); ++i) {
    probabilities.of_class[i].setTo(i == 0 ? 1 : 0, unseen);
  }
}

ChangeProbabilities ChangeMethod::Run(const AlignedPair& pair) {
  ChangeProbabilities probabilities = Estimate(pair);
  MaskUnobserved(pair.valid, probabilities);
  return probabilities;
}

ChangeProbabilities ChangeMethod::Estimate(const AlignedPair& pair) {
  const cv::Size size = pair.after.size();
  if (pair.after.empty() || pair.after.type() != CV_8UC3 || pair.before.type() != CV_8UC3 ||
      pair.valid.type() != CV_8UC1 || pair.before.size() != size || pair.valid.size() != size) {
    throw Error("a pair for change detection has pictures of " + std::to_string(pair.before.cols) +
                "x" + std::to_string(pair.before.rows) + " and " + std::to_string(size.width) +
                "x" + std::to_string(size.height) +
                ", accepted are two 8-bit colour pictures of one size with their mask");
  }
  return Infer(pair);
}

std::vector<std::string> ChangeMethodNames() { return {"difference", "dense-sift", "daisy"}; }

std::unique_ptr<ChangeMethod> MakeChangeMethod(const std::string& name) {
  if (name == "difference") return MakeAbsoluteDifference();
  if (name == "dense-sift") return MakeDenseSiftDifference();
  if (name == "daisy") return MakeDaisyDifference();
  throw Error("method '" + name + "' is unknown, accepted are difference, dense-sift and daisy");
}

}  // namespace livemap::change
