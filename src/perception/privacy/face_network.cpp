#include "perception/privacy/face_network.h"

#include "perception/inference/manifest_section.h"
#include "perception/privacy/network_answer.h"

namespace livemap::perception {
namespace {

constexpr char kFaceModel[] = "faces";
constexpr float kFaceIou = 0.3F;

/// Cells of UltraFace's four levels with their anchors: 3, 2, 2, 3.
int FaceAnchors(cv::Size input) {
  int count = 0;
  const int strides[] = {8, 16, 32, 64};
  const int anchors[] = {3, 2, 2, 3};
  for (int level = 0; level < 4; ++level) {
    const int columns = (input.width + strides[level] - 1) / strides[level];
    const int rows = (input.height + strides[level] - 1) / strides[level];
    count += columns * rows * anchors[level];
  }
  return count;
}

}  // namespace

std::vector<ScoredBox> DecodeFaces(const cv::Mat& boxes, const cv::Mat& scores, cv::Size input,
                                   double scale, float found) {
  const int count = FaceAnchors(input);
  RequireNumbers(boxes, count, 4, kFaceModel, "boxes");
  RequireNumbers(scores, count, 2, kFaceModel, "scores");
  const float* box = boxes.ptr<float>();
  const float* score = scores.ptr<float>();
  const auto x_scale = static_cast<float>(input.width / scale);
  const auto y_scale = static_cast<float>(input.height / scale);
  std::vector<ScoredBox> faces;
  for (int i = 0; i < count; ++i, box += 4, score += 2) {
    RequireScore(score[1], kFaceModel);
    if (score[1] < found) continue;
    const cv::Rect2f face(box[0] * x_scale, box[1] * y_scale, (box[2] - box[0]) * x_scale,
                          (box[3] - box[1]) * y_scale);
    RequireFinite(face, kFaceModel);
    if (face.width > 0 && face.height > 0) faces.push_back({face, score[1]});
  }
  return Suppressed(faces, kFaceIou);
}

FaceNetwork::FaceNetwork(const PrivacyNetworks::Network& network)
    : graph_(network.file, ReadHashedFile(kFaceModel, network.file, network.sha256)),
      input_(network.input.width, network.input.height),
      found_(network.found),
      letterbox_(network.input, network.normalisation) {
  graph_.RequireInput("input", {1, 3, input_.height, input_.width});
  RequireOutputs(graph_, {"boxes", "scores"});
  Find(cv::Mat(input_, CV_8UC3, cv::Scalar::all(127)));
}

std::vector<ScoredBox> FaceNetwork::Find(const cv::Mat& bgr) {
  const std::vector<cv::Mat> answer = graph_.Run({{"input", letterbox_.Fill(bgr)}});
  return DecodeFaces(answer[0], answer[1], input_, letterbox_.Scale(bgr.size()), found_);
}

}  // namespace livemap::perception
