#include "drives/generated_drive.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "drives/generated_ground.h"
#include "drives/generated_sprites.h"

namespace livemap {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSharpM = 110;  // Ground beyond is drawn in its mean colour.
constexpr double kObjectsM = 140;
constexpr double kTruthM = 35;
constexpr double kHazeM = 260;  // Distance at which 63 % of the colour is haze.
constexpr int kVariants = 4;

const cv::Vec3f kHazeColour(214, 205, 196);

double Haze(double distance_m) { return 1 - std::exp(-distance_m / kHazeM); }

}  // namespace

class GeneratedDriveRenderer::Implementation {
 public:
  Implementation(const GeneratedWorld& world, const CameraFile& camera)
      : world_(world),
        camera_(camera),
        optical_from_base_(camera.mounting.BaseFromOptical().inverse()),
        ground_(world_) {
    for (int i = 0; i < kVariants; ++i) {
      const auto salt = static_cast<std::uint64_t>(i);
      trees_.push_back(PaintTreeSprite(MixSeed(world.seed, 20 + salt)));
      bushes_.push_back(PaintBushSprite(MixSeed(world.seed, 40 + salt)));
    }
    post_ = PaintPostSprite();
    PlanPixels();
    PaintBackground();
  }

  cv::Mat Render(double along_m) {
    ground_.Prepare(along_m, along_m + kSharpM);
    cv::Mat image = background_.clone();
    DrawGround(along_m, image);
    DrawObjects(along_m, image);
    return Develop(along_m, image);
  }

  std::vector<VisibleHazard> Visible(double along_m) const {
    std::vector<VisibleHazard> visible;
    for (const GeneratedHazard& hazard : world_.hazards) {
      const double ahead_m = hazard.along_m - along_m;
      if (ahead_m < 0.5 || ahead_m > kTruthM) continue;
      const std::optional<cv::Rect2d> box =
          hazard.class_name == "pothole" ? PotholeBox(hazard, ahead_m) : ConeBox(hazard, ahead_m);
      if (!box) continue;
      const CameraIntrinsics& k = camera_.intrinsics;
      const cv::Rect2d inside = *box & cv::Rect2d(0, 0, k.width, k.height);
      if (inside.width < 12 || inside.height < 5 || inside.area() < 0.6 * box->area()) continue;
      visible.push_back({hazard.id, hazard.class_name, inside});
    }
    return visible;
  }

 private:
  /// Where a pixel looks at the ground.
  struct GroundPixel {
    int row;
    int column;
    double ahead_m;
    double left_m;
    double step_m;  ///< How much road lies under the pixel, along it.
    int level;
    int samples;
  };

  /// Image point with (0, 0) at the outer corner of the first pixel; none behind the camera.
  std::optional<cv::Point2d> Project(double ahead_m, double left_m, double up_m) const {
    const Eigen::Vector3d ray = optical_from_base_ * Eigen::Vector3d(ahead_m, left_m, up_m);
    if (ray.z() < 0.3) return std::nullopt;
    const CameraIntrinsics& k = camera_.intrinsics;
    return cv::Point2d(k.fx * ray.x() / ray.z() + k.cx + 0.5,
                       k.fy * ray.y() / ray.z() + k.cy + 0.5);
  }

  void PlanPixels() {
    const CameraIntrinsics& k = camera_.intrinsics;
    const Eigen::Isometry3d base_from_optical = optical_from_base_.inverse();
    const Eigen::Vector3d eye = base_from_optical.translation();
    for (int row = 0; row < k.height; ++row) {
      for (int column = 0; column < k.width; ++column) {
        const Eigen::Vector3d ray = base_from_optical.linear() *
                                    Eigen::Vector3d((column - k.cx) / k.fx, (row - k.cy) / k.fy, 1);
        if (ray.z() > -1e-4) {
          horizon_row_ = std::max(horizon_row_, row + 1);
          continue;
        }
        const double reach = -eye.z() / ray.z();
        GroundPixel pixel{row, column, eye.x() + reach * ray.x(), eye.y() + reach * ray.y(), 0,
                          0,   1};
        const double across_m = reach / k.fx;
        pixel.step_m = across_m * reach / eye.z();
        const double fine = std::max(across_m, pixel.step_m / 4) / GeneratedGround::kResolutionM;
        pixel.level = std::clamp(static_cast<int>(std::lround(std::log2(std::max(fine, 1.0)))), 0,
                                 GeneratedGround::kLevels - 1);
        const double texel_m = GeneratedGround::kResolutionM * (1 << pixel.level);
        pixel.samples = std::clamp(static_cast<int>(std::ceil(pixel.step_m / texel_m)), 1, 4);
        pixels_.push_back(pixel);
      }
    }
  }

  void PaintBackground() {
    const CameraIntrinsics& k = camera_.intrinsics;
    background_ = cv::Mat(k.height, k.width, CV_8UC3, cv::Scalar(150, 170, 165));
    if (horizon_row_ < 2) return;
    const cv::Mat sky = PaintSky(MixSeed(world_.seed, 5), horizon_row_, k.width);
    sky.copyTo(background_.rowRange(0, horizon_row_));
  }

  void DrawGround(double along_m, cv::Mat& image) const {
    for (const GroundPixel& pixel : pixels_) {
      cv::Vec3f colour;
      if (pixel.ahead_m > kSharpM) {
        const bool road = pixel.left_m > kRightVergeM && pixel.left_m < kLeftVergeM;
        colour = road ? cv::Vec3f(106, 108, 112) : cv::Vec3f(62, 113, 98);
      } else {
        for (int i = 0; i < pixel.samples; ++i) {
          const double offset = ((i + 0.5) / pixel.samples - 0.5) * pixel.step_m;
          const double at_m = std::clamp(pixel.ahead_m + offset, 0.0, kSharpM);
          colour += ground_.At(along_m + at_m, pixel.left_m, pixel.level);
        }
        colour /= static_cast<float>(pixel.samples);
      }
      const auto haze = static_cast<float>(Haze(pixel.ahead_m));
      colour = (1 - haze) * colour + haze * kHazeColour;
      image.at<cv::Vec3b>(pixel.row, pixel.column) = {cv::saturate_cast<uchar>(colour[0]),
                                                      cv::saturate_cast<uchar>(colour[1]),
                                                      cv::saturate_cast<uchar>(colour[2])};
    }
  }

  /// Upright things from far to near.
  void DrawObjects(double along_m, cv::Mat& image) const {
    std::size_t hazard = world_.hazards.size();
    const auto draw_cones_beyond = [&](double limit_m) {
      while (hazard > 0 && world_.hazards[hazard - 1].along_m > limit_m) {
        DrawCone(world_.hazards[--hazard], along_m, image);
      }
    };
    for (auto object = world_.roadside.rbegin(); object != world_.roadside.rend(); ++object) {
      draw_cones_beyond(object->along_m);
      const double ahead_m = object->along_m - along_m;
      if (ahead_m < 1.5 || ahead_m > kObjectsM) continue;
      const auto variant = static_cast<std::size_t>(object->variant);
      const cv::Mat& sprite = object->kind == RoadsideKind::kTree   ? trees_[variant]
                              : object->kind == RoadsideKind::kBush ? bushes_[variant]
                                                                    : post_;
      const double width_m =
          object->kind == RoadsideKind::kPost ? 0.12 : object->height_m * sprite.cols / sprite.rows;
      DrawUpright(sprite, ahead_m, object->left_m, width_m, object->height_m, image);
    }
    draw_cones_beyond(-1e9);
  }

  void DrawUpright(const cv::Mat& sprite, double ahead_m, double left_m, double width_m,
                   double height_m, cv::Mat& image) const {
    const std::optional<cv::Point2d> foot = Project(ahead_m, left_m, 0);
    const std::optional<cv::Point2d> top = Project(ahead_m, left_m, height_m);
    const std::optional<cv::Point2d> side = Project(ahead_m, left_m + width_m / 2, 0);
    if (!foot || !top || !side) return;
    const double half = foot->x - side->x;
    DrawSprite(sprite, {foot->x - half, top->y, 2 * half, foot->y - top->y}, Haze(ahead_m), image);
  }

  void DrawCone(const GeneratedHazard& hazard, double along_m, cv::Mat& image) const {
    const double ahead_m = hazard.along_m - along_m;
    if (hazard.class_name != "traffic_cone" || ahead_m < 0.5 || ahead_m > kObjectsM) return;
    const std::optional<cv::Rect2d> box = ConeBox(hazard, ahead_m);
    if (!box) return;
    DrawShadow(ahead_m, hazard.left_m, image);
    const double tilt_rad = std::atan2(camera_.mounting.height_m - kConeHeightM / 2, ahead_m);
    DrawSprite(PaintConeSprite(std::clamp(tilt_rad, 0.0, 0.7), hazard.seed), *box, Haze(ahead_m),
               image);
  }

  /// Of a cone, on the ground towards the driver and to the left, as the potholes' shadows.
  void DrawShadow(double ahead_m, double left_m, cv::Mat& image) const {
    std::vector<cv::Point> outline;
    const std::vector<cv::Point2d> corners = {{0.15, -0.2}, {-0.9, 0.42}, {-0.2, 0.2}};
    for (const cv::Point2d& corner : corners) {
      const auto point = Project(ahead_m + corner.x, left_m + corner.y, 0);
      if (!point) return;
      outline.emplace_back(cvRound(point->x * 16), cvRound(point->y * 16));
    }
    const cv::Rect area = cv::boundingRect(outline);
    const cv::Rect patch =
        cv::Rect(area.x / 16 - 2, area.y / 16 - 2, area.width / 16 + 5, area.height / 16 + 5) &
        cv::Rect(0, 0, image.cols, image.rows);
    if (patch.area() == 0) return;
    cv::Mat mask = cv::Mat::zeros(image.size(), CV_8UC1);
    cv::fillConvexPoly(mask, outline, 255, cv::LINE_AA, 4);
    cv::GaussianBlur(mask(patch), mask(patch), {}, 1.2);
    for (int row = patch.y; row < patch.br().y; ++row) {
      for (int column = patch.x; column < patch.br().x; ++column) {
        const double keep = 1 - 0.5 * mask.at<uchar>(row, column) / 255.0;
        image.at<cv::Vec3b>(row, column) *= keep;
      }
    }
  }

  std::optional<cv::Rect2d> PotholeBox(const GeneratedHazard& hazard, double ahead_m) const {
    const PotholeShape shape(hazard);
    std::vector<cv::Point2f> outline;
    for (int i = 0; i < 72; ++i) {
      const double angle = i * kPi / 36;
      const double radius = shape.RadiusM(angle);
      const auto point =
          Project(ahead_m + radius * std::cos(angle), hazard.left_m + radius * std::sin(angle), 0);
      if (!point) return std::nullopt;
      outline.emplace_back(*point);
    }
    const auto [left, right] = std::minmax_element(outline.begin(), outline.end(),
                                                   [](auto& a, auto& b) { return a.x < b.x; });
    const auto [top, bottom] = std::minmax_element(outline.begin(), outline.end(),
                                                   [](auto& a, auto& b) { return a.y < b.y; });
    return cv::Rect2d(left->x, top->y, right->x - left->x, bottom->y - top->y);
  }

  std::optional<cv::Rect2d> ConeBox(const GeneratedHazard& hazard, double ahead_m) const {
    const double half = kConeFootM / 2;
    const auto near_left = Project(ahead_m - half, hazard.left_m + half, 0);
    const auto near_right = Project(ahead_m - half, hazard.left_m - half, 0);
    const auto top = Project(ahead_m, hazard.left_m, kConeHeightM);
    if (!near_left || !near_right || !top) return std::nullopt;
    return cv::Rect2d(near_left->x, top->y, near_right->x - near_left->x, near_left->y - top->y);
  }

  /// What a camera adds: a little blur, vignetting, noise.
  cv::Mat Develop(double along_m, const cv::Mat& image) const {
    cv::Mat picture;
    cv::GaussianBlur(image, picture, {}, 0.6);
    cv::RNG generator(MixSeed(world_.seed, static_cast<std::uint64_t>(along_m * 1000) + 7000));
    cv::Mat noise(picture.size(), CV_16SC3);
    generator.fill(noise, cv::RNG::NORMAL, 0, 2.6);
    cv::add(picture, noise, picture, cv::noArray(), CV_8UC3);
    return picture;
  }

  const GeneratedWorld world_;
  const CameraFile camera_;
  const Eigen::Isometry3d optical_from_base_;
  GeneratedGround ground_;
  std::vector<GroundPixel> pixels_;
  int horizon_row_ = 0;
  cv::Mat background_;
  std::vector<cv::Mat> trees_;
  std::vector<cv::Mat> bushes_;
  cv::Mat post_;
};

GeneratedDriveRenderer::GeneratedDriveRenderer(const GeneratedWorld& world,
                                               const CameraFile& camera)
    : implementation_(std::make_unique<Implementation>(world, camera)) {}

GeneratedDriveRenderer::~GeneratedDriveRenderer() = default;

cv::Mat GeneratedDriveRenderer::Render(double along_m) { return implementation_->Render(along_m); }

std::vector<VisibleHazard> GeneratedDriveRenderer::Visible(double along_m) const {
  return implementation_->Visible(along_m);
}

}  // namespace livemap
