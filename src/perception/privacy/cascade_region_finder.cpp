#include "perception/privacy/cascade_region_finder.h"

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

/// How a cascade looks at a find again, at one size for finds of all sizes, so that the number of
/// finds that agree can be compared.
struct SecondLook {
  int width_px;  ///< To which the find is scaled.
  int agreeing;  ///< So many finds make it sure.
};

// A missed face costs more than a masked bush: few neighbours are asked for. Of 60 faces drawn into
// street photos all are found with steps of 1.1 and two neighbours and with 1.2 and one, each with
// 14 false finds; the latter takes 0.55 times as long. Of 60 drawn plates the cascade finds 52 with
// two neighbours, 58 with one, and nothing on twelve roads without plates.
constexpr Search kFaceSearch{1.2, 1};
constexpr Search kPlateSearch{1.1, 1};

// How many agree, at the most of the false finds (37 in 50 images of rosbags/town.bag; 109 in 140
// photos of accidents) and for drawn faces and plates:
//   frontal face 16; 25; 87 to 147        face from the side 7; 13; 5 to 53, a real one 34
//   plate 6; 12; 17 to 133 of all but two of 22 that are 50 to 110 pixels wide
//   plate, second cascade 7; 26; 6 to 14: hardly ever sure by itself
constexpr double kSecondLookStep = 1.05;
constexpr double kSecondLookMargin = 0.5;  ///< Around the find, share of its sides.
constexpr SecondLook kFrontalLook{60, 30};
constexpr SecondLook kProfileLook{60, 15};
constexpr SecondLook kPlateLook{160, 15};
constexpr SecondLook kOtherPlateLook{160, 40};
constexpr float kMinFaceScore = 0.5F;
constexpr float kSureFaceScore = 0.8F;

/// Width of a plate that is `side` high, European or American, at least.
constexpr int kPlateAspect = 2;

/// A face of at most this side that meets a part lies wholly within the part grown by it. So only
/// larger ones need to be looked for elsewhere, and the small ones are what takes the time.
constexpr int kNearMarginPx = 64;
/// Where looking elsewhere begins: two steps of kFaceSearch below, as finds of neighbouring sizes
/// must agree.
constexpr int kFarFacePx = 44;

cv::Rect WithNearMargin(const cv::Rect& part, const cv::Size& image) {
  return cv::Rect(part.x - kNearMarginPx, part.y - kNearMarginPx, part.width + 2 * kNearMarginPx,
                  part.height + 2 * kNearMarginPx) &
         cv::Rect({}, image);
}

class Cascade {
 public:
  Cascade(const std::string& folder, const std::string& name, const Search& search,
          const SecondLook& second_look)
      : file_(folder + "/" + name), search_(search), second_look_(second_look) {
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

  std::vector<PrivateRegion> Find(const cv::Mat& grey, cv::Size smallest) {
    std::vector<cv::Rect> boxes;
    classifier_.detectMultiScale(grey, boxes, search_.scale_step, search_.neighbours, 0, smallest);
    std::vector<PrivateRegion> found;
    found.reserve(boxes.size());
    for (const cv::Rect& box : boxes) found.push_back({box, IsSure(grey, box)});
    return found;
  }

 private:
  /// Looks at the find again, in finer steps.
  bool IsSure(const cv::Mat& grey, const cv::Rect& box) {
    const cv::Size margin(cvRound(kSecondLookMargin * box.width),
                          cvRound(kSecondLookMargin * box.height));
    const cv::Rect around = cv::Rect(box.x - margin.width, box.y - margin.height,
                                     box.width + 2 * margin.width, box.height + 2 * margin.height) &
                            cv::Rect({}, grey.size());
    const double scale = 1.0 * second_look_.width_px / box.width;
    cv::Mat near;
    cv::resize(grey(around), near, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    const auto sized = [&](double share) {
      return cv::Size(cvRound(share * scale * box.width), cvRound(share * scale * box.height));
    };
    std::vector<cv::Rect> again;
    std::vector<int> agreeing;
    classifier_.detectMultiScale(near, again, agreeing, kSecondLookStep, 1, 0, sized(0.6),
                                 sized(1.6));
    return std::any_of(agreeing.begin(), agreeing.end(),
                       [this](int count) { return count >= second_look_.agreeing; });
  }

  std::string file_;
  Search search_;
  SecondLook second_look_;
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

  std::vector<PrivateRegion> Find(const cv::Mat& bgr) {
    network_->setInputSize(bgr.size());
    cv::Mat faces;  // A row per face; x, y, width, height first, the score last.
    network_->detect(bgr, faces);
    std::vector<PrivateRegion> found;
    for (int i = 0; i < faces.rows; ++i) {
      const float* face = faces.ptr<float>(i);
      found.push_back(
          {cv::Rect2f(face[0], face[1], face[2], face[3]), face[faces.cols - 1] >= kSureFaceScore});
    }
    return found;
  }

 private:
  std::string file_;
  cv::Ptr<cv::FaceDetectorYN> network_;
};

class CascadeRegionFinder final : public PrivateRegionFinder {
 public:
  explicit CascadeRegionFinder(const PrivateRegionConfig& config)
      : min_side_px_(config.min_side_px),
        plates_{Cascade(config.cascades, "haarcascade_russian_plate_number.xml", kPlateSearch,
                        kPlateLook),
                Cascade(config.cascades, "haarcascade_licence_plate_rus_16stages.xml", kPlateSearch,
                        kOtherPlateLook)} {
    if (!config.face_model.empty()) {
      yunet_ = std::make_unique<YuNet>(config.face_model);
      return;
    }
    frontal_.emplace_back(config.cascades, "haarcascade_frontalface_alt2.xml", kFaceSearch,
                          kFrontalLook);
    profile_.emplace_back(config.cascades, "haarcascade_profileface.xml", kFaceSearch,
                          kProfileLook);
  }

  std::string Name() const override { return "cascades"; }

  std::vector<PrivateRegion> Find(const cv::Mat& bgr, const cv::Rect& part) override {
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
  std::vector<PrivateRegion> FindAll(const cv::Mat& bgr, const cv::Rect& part) {
    cv::Mat grey;
    cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
    const cv::Rect image({}, bgr.size());
    const cv::Rect near = WithNearMargin(part, bgr.size());
    std::vector<PrivateRegion> all;
    for (const PrivateRegion& face : FindFaces(grey(near), min_side_px_)) {
      all.push_back({face.box + near.tl(), face.is_sure});
    }
    // YuNet takes the place of the cascades of faces, and looks at the whole image.
    if (near != image && !yunet_) FindLargeFaces(grey, all);
    for (Cascade& cascade : plates_) {
      const cv::Size smallest(kPlateAspect * min_side_px_, min_side_px_);
      for (const PrivateRegion& plate : cascade.Find(grey, smallest)) all.push_back(plate);
    }
    if (yunet_) {
      for (const PrivateRegion& face : yunet_->Find(bgr)) all.push_back(face);
    }
    for (PrivateRegion& region : all) region.box &= image;
    all.erase(std::remove_if(all.begin(), all.end(),
                             [](const PrivateRegion& region) { return region.box.empty(); }),
              all.end());
    return all;
  }

  /// Those of kFarFacePx or more, in half as many lines and columns: a cascade takes no finer look
  /// at them in any case.
  void FindLargeFaces(const cv::Mat& grey, std::vector<PrivateRegion>& all) {
    cv::Mat half;
    cv::resize(grey, half, {}, 0.5, 0.5, cv::INTER_AREA);
    for (const PrivateRegion& face : FindFaces(half, std::max(min_side_px_, kFarFacePx) / 2)) {
      const cv::Rect& box = face.box;
      all.push_back({{2 * box.x, 2 * box.y, 2 * box.width, 2 * box.height}, face.is_sure});
    }
  }

  /// Those that the cascades know, at least `smallest` pixels large.
  std::vector<PrivateRegion> FindFaces(const cv::Mat& grey, int smallest) {
    const cv::Size size(smallest, smallest);
    std::vector<PrivateRegion> all;
    for (Cascade& cascade : frontal_) {
      for (const PrivateRegion& face : cascade.Find(grey, size)) all.push_back(face);
    }
    if (profile_.empty()) return all;
    // The cascade knows faces that look to one side; the mirror image gives the other.
    cv::Mat mirrored;
    cv::flip(grey, mirrored, 1);
    for (Cascade& cascade : profile_) {
      for (const PrivateRegion& face : cascade.Find(grey, size)) all.push_back(face);
      for (const PrivateRegion& face : cascade.Find(mirrored, size)) {
        const cv::Rect& box = face.box;
        all.push_back(
            {{grey.cols - box.x - box.width, box.y, box.width, box.height}, face.is_sure});
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

std::unique_ptr<PrivateRegionFinder> MakeCascadeRegionFinder(const PrivateRegionConfig& config) {
  return std::make_unique<CascadeRegionFinder>(config);
}

}  // namespace livemap::perception
