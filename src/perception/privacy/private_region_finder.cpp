#include "perception/privacy/private_region_finder.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>
#include <utility>

#include "common/error.h"

namespace livemap::perception {
namespace {

/// How densely a cascade looks.
struct Search {
  double scale_step;  ///< Between two sizes that are looked for.
  int neighbours;     ///< Finds that must agree.
};

// A missed face costs more than a masked bush: few neighbours are asked for. Of 60 faces drawn into
// street photos all are found with steps of 1.1 and two neighbours and with 1.2 and one, each with
// 14 false finds; the latter takes 0.55 times as long. Of 60 drawn plates the cascade finds 52 with
// two neighbours, 58 with one, and nothing on twelve roads without plates.
constexpr Search kFaceSearch{1.2, 1};
constexpr Search kPlateSearch{1.1, 1};
constexpr float kMinFaceScore = 0.5F;

/// Width of a plate that is `side` high, European or American, at least.
constexpr int kPlateAspect = 2;

/// A face of at most this side that meets a part lies wholly within the part grown by it. So only
/// larger ones need to be looked for elsewhere, and the small ones are what takes the time.
constexpr int kNearMarginPx = 64;
/// Where looking elsewhere begins: two steps of kFaceSearch below, as finds of neighbouring sizes
/// must agree.
constexpr int kFarFacePx = 44;

cv::Rect Near(const cv::Rect& part, const cv::Size& image) {
  return cv::Rect(part.x - kNearMarginPx, part.y - kNearMarginPx, part.width + 2 * kNearMarginPx,
                  part.height + 2 * kNearMarginPx) &
         cv::Rect({}, image);
}

class Cascade {
 public:
  Cascade(const std::string& folder, const std::string& name, const Search& search)
      : file_(folder + "/" + name), search_(search) {
    bool loaded = false;
    try {
      loaded = std::filesystem::is_regular_file(file_) && classifier_.load(file_);
    } catch (const cv::Exception&) {  // What it says about a damaged file is no help to anybody.
    }
    if (!loaded) {
      throw Error("cascade '" + file_ +
                  "' cannot be loaded, accepted is a Haar cascade as in Debian's opencv-data");
    }
  }

  std::vector<cv::Rect> Find(const cv::Mat& grey, cv::Size smallest) {
    std::vector<cv::Rect> found;
    classifier_.detectMultiScale(grey, found, search_.scale_step, search_.neighbours, 0, smallest);
    return found;
  }

 private:
  std::string file_;
  Search search_;
  cv::CascadeClassifier classifier_;
};

/// Faces by YuNet (Wu et al., "YuNet: a tiny millisecond-level face detector", 2023).
class YuNet {
 public:
  explicit YuNet(const std::string& file) : file_(file) {
    if (!std::filesystem::is_regular_file(file)) {
      throw Error("face_model is '" + file + "', which is no file");
    }
    try {
      network_ = cv::FaceDetectorYN::create(file, "", {320, 320}, kMinFaceScore);
    } catch (const cv::Exception&) {
      throw Error("face_model '" + file + "' cannot be loaded, accepted is a YuNet model in ONNX");
    }
  }

  std::vector<cv::Rect> Find(const cv::Mat& bgr) {
    network_->setInputSize(bgr.size());
    cv::Mat faces;  // A row per face; x, y, width, height first.
    network_->detect(bgr, faces);
    std::vector<cv::Rect> found;
    for (int i = 0; i < faces.rows; ++i) {
      const float* face = faces.ptr<float>(i);
      found.emplace_back(cv::Rect2f(face[0], face[1], face[2], face[3]));
    }
    return found;
  }

 private:
  std::string file_;
  cv::Ptr<cv::FaceDetectorYN> network_;
};

class Finder final : public PrivateRegionFinder {
 public:
  explicit Finder(const PrivateRegionConfig& config)
      : min_side_px_(config.min_side_px),
        plates_{
            Cascade(config.cascades, "haarcascade_russian_plate_number.xml", kPlateSearch),
            Cascade(config.cascades, "haarcascade_licence_plate_rus_16stages.xml", kPlateSearch)} {
    if (!config.face_model.empty()) {
      yunet_ = std::make_unique<YuNet>(config.face_model);
      return;
    }
    frontal_.emplace_back(config.cascades, "haarcascade_frontalface_alt2.xml", kFaceSearch);
    profile_.emplace_back(config.cascades, "haarcascade_profileface.xml", kFaceSearch);
  }

  std::vector<cv::Rect> Find(const cv::Mat& bgr, const cv::Rect& part) override {
    if (bgr.empty() || bgr.type() != CV_8UC3) {
      throw Error("faces and plates are looked for in images of 8 bit and 3 channels only");
    }
    try {
      return FindAll(bgr, part);
    } catch (const cv::Exception& error) {
      throw Error("looking for faces and plates failed: " + error.err);
    }
  }

 private:
  std::vector<cv::Rect> FindAll(const cv::Mat& bgr, const cv::Rect& part) {
    cv::Mat grey;
    cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
    const cv::Rect image({}, bgr.size());
    const cv::Rect near = Near(part, bgr.size());
    std::vector<cv::Rect> all;
    for (const cv::Rect& face : FindFaces(grey(near), min_side_px_))
      all.push_back(face + near.tl());
    if (near != image) FindLargeFaces(grey, all);
    for (Cascade& cascade : plates_) {
      const cv::Size smallest(kPlateAspect * min_side_px_, min_side_px_);
      for (const cv::Rect& plate : cascade.Find(grey, smallest)) all.push_back(plate);
    }
    if (yunet_) {
      for (const cv::Rect& face : yunet_->Find(bgr)) all.push_back(face);
    }
    for (cv::Rect& region : all) region &= image;
    all.erase(std::remove_if(all.begin(), all.end(),
                             [](const cv::Rect& region) { return region.empty(); }),
              all.end());
    return all;
  }

  /// Those of kFarFacePx or more, in half as many lines and columns: a cascade takes no finer look
  /// at them in any case.
  void FindLargeFaces(const cv::Mat& grey, std::vector<cv::Rect>& all) {
    cv::Mat half;
    cv::resize(grey, half, {}, 0.5, 0.5, cv::INTER_AREA);
    for (const cv::Rect& face : FindFaces(half, std::max(min_side_px_, kFarFacePx) / 2)) {
      all.emplace_back(2 * face.x, 2 * face.y, 2 * face.width, 2 * face.height);
    }
  }

  /// Those that the cascades know, at least `smallest` pixels large.
  std::vector<cv::Rect> FindFaces(const cv::Mat& grey, int smallest) {
    const cv::Size size(smallest, smallest);
    std::vector<cv::Rect> all;
    for (Cascade& cascade : frontal_) {
      for (const cv::Rect& face : cascade.Find(grey, size)) all.push_back(face);
    }
    if (profile_.empty()) return all;
    // The cascade knows faces that look to one side; the mirror image gives the other.
    cv::Mat mirrored;
    cv::flip(grey, mirrored, 1);
    for (Cascade& cascade : profile_) {
      for (const cv::Rect& face : cascade.Find(grey, size)) all.push_back(face);
      for (const cv::Rect& face : cascade.Find(mirrored, size)) {
        all.emplace_back(grey.cols - face.x - face.width, face.y, face.width, face.height);
      }
    }
    return all;
  }

  int min_side_px_;
  std::vector<Cascade> frontal_;
  std::vector<Cascade> profile_;
  std::array<Cascade, 2> plates_;
  std::unique_ptr<YuNet> yunet_;
};

}  // namespace

std::unique_ptr<PrivateRegionFinder> MakePrivateRegionFinder(const PrivateRegionConfig& config) {
  return std::make_unique<Finder>(config);
}

}  // namespace livemap::perception
