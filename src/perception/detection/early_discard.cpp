#include "perception/detection/early_discard.h"

#include <string>
#include <utility>

#include "common/error.h"

namespace livemap::perception {

EarlyDiscard::EarlyDiscard(const ModelManifest& manifest, int threads)
    : EarlyDiscard(manifest, MakeInferenceEngine(manifest, threads)) {}

EarlyDiscard::EarlyDiscard(const ModelManifest& manifest, std::unique_ptr<InferenceEngine> engine)
    : manifest_(manifest), engine_(std::move(engine)), letterbox_(manifest) {
  if (manifest_.head.type != HeadType::kScore || manifest_.classes.size() != 1) {
    throw Error("model '" + manifest_.name + "' has " + std::to_string(manifest_.classes.size()) +
                (manifest_.head.type == HeadType::kScore ? " classes and a head of type 'score'"
                                                         : " classes and a head of type 'yolox'") +
                ", early discard needs one class and a head of type 'score'");
  }
}

float EarlyDiscard::Score(const cv::Mat& bgr) {
  const float score = *engine_->Run(letterbox_.Fill(bgr)).ptr<float>();
  // Written so that NaN is refused too.
  if (!(score >= 0 && score <= 1)) {
    throw Error("model '" + manifest_.name + "' gives an image the score " + std::to_string(score) +
                ", accepted is 0 to 1");
  }
  return score;
}

}  // namespace livemap::perception
