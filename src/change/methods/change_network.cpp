#include "change/methods/change_network.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "change/registration/change_region.h"
#include "common/error.h"
#include "perception/inference/engines.h"
#include "perception/inference/manifest_section.h"

namespace livemap::change {
namespace {

/// Of a probability beyond [0, 1]: sums of float32 are not exact.
constexpr double kRounding = 1e-3;

perception::OnnxGraph LoadNetworkGraph(const ChangeManifest& manifest,
                                       const ChangeManifest::Graph& graph) {
  return {graph.file, perception::ReadHashedFile(manifest.name, graph.file, graph.sha256)};
}

cv::Mat Zeros(const std::vector<std::int64_t>& shape) {
  const std::vector<int> sizes(shape.begin(), shape.end());
  return {sizes, CV_32F, cv::Scalar(0)};
}

std::vector<std::int64_t> NetworkPictureShape(const perception::ModelManifest::Input& input) {
  return {1, 3, input.height, input.width};
}

std::vector<std::int64_t> NetworkValidityShape(const perception::ModelManifest::Input& input) {
  return {1, 1, input.height, input.width};
}

}  // namespace

std::size_t ChangeFeatures::Bytes() const {
  std::size_t bytes = 0;
  for (const cv::Mat& level : levels) bytes += level.total() * level.elemSize();
  return bytes;
}

ChangeNetwork::ChangeNetwork(const ChangeManifest& manifest, int threads)
    : manifest_(manifest),
      before_letterbox_(manifest.input, manifest.normalisation),
      after_letterbox_(manifest.input, manifest.normalisation),
      whole_(LoadNetworkGraph(manifest, manifest.whole)),
      encoder_(LoadNetworkGraph(manifest, manifest.encoder)),
      head_(LoadNetworkGraph(manifest, manifest.head)) {
  if (threads > 0) cv::setNumThreads(threads);
  CheckWhole();
  CheckParts();
  if (manifest.road) road_look_.emplace(manifest);
}

void ChangeNetwork::CheckWhole() {
  const std::vector<std::int64_t> picture = NetworkPictureShape(manifest_.input);
  const std::vector<std::int64_t> validity = NetworkValidityShape(manifest_.input);
  whole_.RequireInput("first", picture);
  whole_.RequireInput("second", picture);
  whole_.RequireInput("validity", validity);
  CheckAnswer(whole_, whole_.Run({{"first", Zeros(picture)},
                                  {"second", Zeros(picture)},
                                  {"validity", Zeros(validity)}}));
}

void ChangeNetwork::CheckParts() {
  encoder_.RequireInput("image", NetworkPictureShape(manifest_.input));
  const auto levels = static_cast<std::size_t>(manifest_.levels);
  for (std::size_t level = 0; level < levels; ++level) {
    const std::string name = "features_" + std::to_string(level);
    if (encoder_.outputs().size() == levels && encoder_.outputs()[level] == name) continue;
    throw Error("model file '" + encoder_.file() + "' has " +
                std::to_string(encoder_.outputs().size()) + " outputs, its manifest accepts " +
                std::to_string(levels) + " named features_0, features_1, ...");
  }
  const std::vector<cv::Mat> features = RunEncoder(Zeros(NetworkPictureShape(manifest_.input)));
  for (std::size_t level = 0; level < levels; ++level) {
    head_.RequireInput("first_" + std::to_string(level), perception::ShapeOf(features[level]));
    head_.RequireInput("second_" + std::to_string(level), perception::ShapeOf(features[level]));
  }
  head_.RequireInput("validity", NetworkValidityShape(manifest_.input));
  CheckAnswer(head_, head_.Run(HeadInputs(features, features,
                                          Zeros(NetworkValidityShape(manifest_.input)))));
}

void ChangeNetwork::CheckAnswer(const perception::OnnxGraph& graph,
                                const std::vector<cv::Mat>& answers) const {
  const std::vector<std::string>& names = graph.outputs();
  if (names.size() != 1 || names[0] != manifest_.output) {
    throw Error("model file '" + graph.file() + "' has " + std::to_string(names.size()) +
                " outputs, the first named '" + (names.empty() ? "" : names[0]) +
                "', its manifest accepts one named '" + manifest_.output + "'");
  }
  const std::vector<std::int64_t> shape = {1, protocol::kChangeClasses, manifest_.input.height,
                                           manifest_.input.width};
  if (answers[0].type() != CV_32F || perception::ShapeOf(answers[0]) != shape) {
    throw Error("model file '" + graph.file() + "' answers with a tensor of " +
                perception::ShapeText(perception::ShapeOf(answers[0])) + ", its manifest accepts " +
                perception::ShapeText(shape));
  }
}

std::vector<cv::Mat> ChangeNetwork::RunEncoder(const cv::Mat& image) {
  std::vector<cv::Mat> features = encoder_.Run({{"image", image}});
  // The graph's own buffers are written again by the next picture.
  for (cv::Mat& level : features) level = level.clone();
  return features;
}

ChangeNetwork::NamedTensors ChangeNetwork::HeadInputs(const std::vector<cv::Mat>& first,
                                                      const std::vector<cv::Mat>& second,
                                                      const cv::Mat& validity) {
  NamedTensors inputs;
  for (std::size_t level = 0; level < first.size(); ++level) {
    inputs.emplace_back("first_" + std::to_string(level), first[level]);
    inputs.emplace_back("second_" + std::to_string(level), second[level]);
  }
  inputs.emplace_back("validity", validity);
  return inputs;
}

ChangeFeatures ChangeNetwork::Encode(const cv::Mat& picture) {
  return {RunEncoder(before_letterbox_.Fill(picture)), picture.size()};
}

ChangeProbabilities ChangeNetwork::Compare(const ChangeFeatures& before,
                                           const ChangeFeatures& after, const cv::Mat& valid) {
  const auto levels = static_cast<std::size_t>(manifest_.levels);
  if (before.size != after.size || before.levels.size() != levels ||
      after.levels.size() != levels) {
    throw Error("features to compare are of pictures of " + std::to_string(before.size.width) +
                "x" + std::to_string(before.size.height) + " and " +
                std::to_string(after.size.width) + "x" + std::to_string(after.size.height) +
                ", accepted are those that Encode makes of two pictures of one size");
  }
  CheckValidity(valid, after.size);
  const std::vector<cv::Mat> answers =
      head_.Run(HeadInputs(before.levels, after.levels, Validity(valid)));
  ChangeProbabilities probabilities = Enlarged(answers[0], valid.size());
  MaskUnobserved(valid, probabilities);
  return probabilities;
}

ChangeProbabilities ChangeNetwork::Infer(const AlignedPair& pair) {
  ChangeProbabilities probabilities = Look(pair);
  const cv::Rect middle = CloserLook(pair.after.size(), manifest_.closer_look,
                                     {manifest_.input.width, manifest_.input.height});
  if (!middle.empty()) {
    const ChangeProbabilities closer =
        Look({pair.before(middle), pair.after(middle), pair.valid(middle)});
    for (std::size_t i = 0; i < closer.of_class.size(); ++i) {
      closer.of_class[i].copyTo(probabilities.of_class[i](middle));
    }
  }
  if (road_look_) LookAtRoad(pair, probabilities);
  return probabilities;
}

void ChangeNetwork::LookAtRoad(const AlignedPair& pair, ChangeProbabilities& probabilities) {
  const std::optional<AlignedPair> aligned = road_look_->Align(pair);
  if (!aligned) return;
  ChangeProbabilities on_road = Look(*aligned);
  RaiseChange(road_look_->LogOdds(*aligned), on_road);
  const cv::Mat known = ChangeRegionMask("road", pair.after.size()) & aligned->valid & pair.valid;
  for (std::size_t i = 0; i < on_road.of_class.size(); ++i) {
    on_road.of_class[i].copyTo(probabilities.of_class[i], known);
  }
}

ChangeProbabilities ChangeNetwork::Look(const AlignedPair& pair) {
  const cv::Mat before = FillUnknown(pair.before, pair.after, pair.valid);
  const std::vector<cv::Mat> answers = whole_.Run({{"first", before_letterbox_.Fill(before)},
                                                   {"second", after_letterbox_.Fill(pair.after)},
                                                   {"validity", Validity(pair.valid)}});
  return Enlarged(answers[0], pair.valid.size());
}

cv::Mat ChangeNetwork::Validity(const cv::Mat& valid) const {
  const cv::Size fitted = after_letterbox_.Fitted(valid.size());
  cv::Mat share;
  cv::resize(valid, share, fitted, 0, 0, cv::INTER_AREA);
  const int shape[] = {1, 1, manifest_.input.height, manifest_.input.width};
  cv::Mat validity(4, shape, CV_32F, cv::Scalar(1));
  cv::Mat plane(manifest_.input.height, manifest_.input.width, CV_32FC1, validity.ptr<float>());
  // What is known in part is not known.
  plane(cv::Rect(cv::Point(), fitted)).setTo(0, share < 255);
  return validity;
}

ChangeProbabilities ChangeNetwork::Enlarged(const cv::Mat& answer, cv::Size size) const {
  const cv::Rect shown(cv::Point(), after_letterbox_.Fitted(size));
  ChangeProbabilities probabilities;
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    const cv::Mat plane(manifest_.input.height, manifest_.input.width, CV_32FC1,
                        const_cast<float*>(answer.ptr<float>(0, i)));
    if (!cv::checkRange(plane, true, nullptr, -kRounding, 1 + kRounding)) {
      throw Error("model '" + manifest_.name + "' gives class " +
                  protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i)) +
                  " a value that is no probability, accepted is 0 to 1");
    }
    cv::Mat enlarged;
    cv::resize(plane(shown), enlarged, size, 0, 0, cv::INTER_LINEAR);
    cv::min(enlarged, 1, enlarged);
    cv::max(enlarged, 0, enlarged);
    probabilities.of_class.push_back(enlarged);
  }
  return probabilities;
}

cv::Rect CloserLook(cv::Size size, double share, cv::Size input) {
  constexpr double kMiddleRow = 0.55;
  const int width = cvRound(share * size.width);
  const int height = std::min(size.height, cvRound(1.0 * width * input.height / input.width));
  if (width <= input.width || height <= 0) return {};
  const int top =
      std::clamp(cvRound(kMiddleRow * size.height - height / 2.0), 0, size.height - height);
  return {(size.width - width) / 2, top, width, height};
}

std::unique_ptr<ChangeNetwork> MakeChangeNetwork(const std::string& path, int threads) {
  return std::make_unique<ChangeNetwork>(ReadChangeManifest(path), threads);
}

}  // namespace livemap::change
