#include "simulation/render/street_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>

#include "simulation/render/precipitation.h"
#include "simulation/render/shader.h"

namespace livemap::simulation {
namespace {

/// Neighbours whose light differs by more than this factor get more rays.
constexpr float kEdgeContrast = 1.45F;
/// The ground's paint is filtered already; only shadows' edges are as strong as this.
constexpr float kGroundContrast = 2.2F;
/// Different bodies of the same colour need nothing.
constexpr float kBodyContrast = 1.07F;
constexpr float kFaint = 0.02F;
constexpr float kBrightest = 4;

float RenderedLuminance(const cv::Vec3f& p) { return 0.25F * p[0] + 0.65F * p[1] + 0.1F * p[2]; }

}  // namespace

void ForEachRow(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto loop = [&] {
    try {
      for (int row = next++; row < count; row = next++) work(row);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      failure = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(loop);
  loop();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

/// One instant's light and truth.
class StreetRenderer::Exposure {
 public:
  Exposure(const StreetRenderer& renderer, const Eigen::Isometry3d& world_from_optical)
      : renderer_(renderer),
        rotation_(world_from_optical.linear().cast<float>()),
        eye_((world_from_optical.translation() - renderer.scene_.origin()).cast<float>()),
        shader_(renderer.scene_, renderer.lighting_, eye_, rotation_.col(2)),
        width_(renderer.camera_.intrinsics.width),
        height_(renderer.camera_.intrinsics.height),
        pixel_angle_(static_cast<float>(1.0 / renderer.camera_.intrinsics.fx)),
        raw_(height_, width_, CV_32FC3),
        depth_(height_, width_, CV_32FC1),
        instances_(height_, width_, CV_32SC1) {}

  void CastRow(int row) {
    auto* light = raw_.ptr<cv::Vec3f>(row);
    auto* depth = depth_.ptr<float>(row);
    auto* instances = instances_.ptr<int>(row);
    const Vec3* rays =
        &renderer_.rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_)];
    for (int column = 0; column < width_; column += 8) {
      const int count = std::min(8, width_ - column);
      Vec3 directions[8];
      SceneHit hits[8];
      for (int i = 0; i < count; ++i) directions[i] = rotation_ * rays[column + i];
      renderer_.scene_.CastEight(eye_, directions, count, hits);
      Vec3 radiances[8];
      std::uint32_t met[8];
      shader_.Radiances(directions, hits, count, pixel_angle_, radiances, met);
      for (int i = 0; i < count; ++i) {
        light[column + i] = {radiances[i].x(), radiances[i].y(), radiances[i].z()};
        // The ray's z component in the optical frame is 1: its length is the depth.
        depth[column + i] = hits[i].found ? hits[i].distance : 0.0F;
        instances[column + i] = static_cast<int>(met[i]);
      }
    }
  }

  void SmoothRow(int row, cv::Mat& light) const {
    const auto* raw = raw_.ptr<cv::Vec3f>(row);
    auto* out = light.ptr<cv::Vec3f>(row);
    std::copy(raw, raw + width_, out);
    if (!renderer_.options_.smooth_edges) return;
    std::vector<int> edges;
    for (int column = 0; column < width_; ++column) {
      if (IsEdge(row, column)) edges.push_back(column);
    }
    AddRays(row, edges, out);
    for (const int column : edges) out[column] *= 0.25F;
  }

  const cv::Mat& raw() const { return raw_; }
  const cv::Mat& depth() const { return depth_; }
  const cv::Mat& instances() const { return instances_; }

 private:
  bool IsEdge(int row, int column) const {
    const float here = RenderedLuminance(raw_.at<cv::Vec3f>(row, column)) + kFaint;
    const int own = instances_.at<int>(row, column);
    const int neighbours[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    for (const auto& step : neighbours) {
      const int r = row + step[0];
      const int c = column + step[1];
      if (r < 0 || c < 0 || r >= height_ || c >= width_) continue;
      const bool same = instances_.at<int>(r, c) == own;
      const bool ground = same && own < static_cast<int>(MakeInstance(1, ObjectClass::kSky));
      const float most = ground ? kGroundContrast : same ? kEdgeContrast : kBodyContrast;
      const float there = RenderedLuminance(raw_.at<cv::Vec3f>(r, c)) + kFaint;
      if (there > most * here || here > most * there) return true;
    }
    return false;
  }

  /// Adds three more rays to each of these pixels; one alone must not outshine the rest.
  void AddRays(int row, const std::vector<int>& columns, cv::Vec3f* out) const {
    static constexpr double kOffsets[3][2] = {{-0.375, 0.125}, {0.125, -0.375}, {0.375, 0.375}};
    Vec3 directions[8];
    int targets[8];
    int count = 0;
    const auto flush = [&] {
      SceneHit hits[8];
      Vec3 radiances[8];
      renderer_.scene_.CastEight(eye_, directions, count, hits);
      shader_.Radiances(directions, hits, count, pixel_angle_, radiances, nullptr);
      for (int i = 0; i < count; ++i) {
        for (int channel = 0; channel < 3; ++channel) {
          out[targets[i]][channel] += std::min(radiances[i][channel], kBrightest);
        }
      }
      count = 0;
    };
    for (const int column : columns) {
      for (const auto& offset : kOffsets) {
        directions[count] =
            rotation_ * renderer_.camera_.Ray(column + offset[0], row + offset[1]).cast<float>();
        targets[count++] = column;
        if (count == 8) flush();
      }
    }
    if (count > 0) flush();
  }

  const StreetRenderer& renderer_;
  const Eigen::Matrix3f rotation_;
  const Vec3 eye_;
  const Shader shader_;
  const int width_;
  const int height_;
  const float pixel_angle_;
  cv::Mat raw_;
  cv::Mat depth_;
  cv::Mat instances_;
};

StreetRenderer::StreetRenderer(const Street& street, const SimulatedCamera& camera,
                               const Lighting& lighting, const RenderConfig& options)
    : street_(street), camera_(camera), lighting_(lighting), options_(options), scene_(street) {
  for (int row = 0; row < camera.intrinsics.height; ++row) {
    for (int column = 0; column < camera.intrinsics.width; ++column) {
      rays_.push_back(camera.Ray(column, row).cast<float>());
    }
  }
}

StreetRenderer::~StreetRenderer() = default;

SimulatedFrame StreetRenderer::Render(const CameraExposure& motion, std::uint32_t frame_number) {
  scene_.MoveTo(motion.along_m);
  const int height = camera_.intrinsics.height;
  const int width = camera_.intrinsics.width;
  SimulatedFrame frame;
  frame.world_from_optical = motion.world_from_optical;
  frame.outlines = CountOutlinePixels(scene_, camera_, motion.world_from_optical);
  cv::Mat light(height, width, CV_32FC3);
  const int instants = std::max(1, camera_.blur_samples);
  for (int i = 0; i < instants; ++i) {
    const double t = static_cast<double>(i) / instants;
    Eigen::Isometry3d pose = motion.world_from_optical;
    if (i > 0) {
      const Eigen::Quaterniond from(pose.linear());
      const Eigen::Quaterniond to(motion.world_from_optical_end.linear());
      pose.translation() += t * (motion.world_from_optical_end.translation() - pose.translation());
      pose.linear() = from.slerp(t, to).toRotationMatrix();
    }
    Exposure exposure(*this, pose);
    ForEachRow(height, options_.threads, [&](int row) { exposure.CastRow(row); });
    cv::Mat smooth(height, width, CV_32FC3);
    ForEachRow(height, options_.threads, [&](int row) { exposure.SmoothRow(row, smooth); });
    if (i == 0) {
      frame.depth = exposure.depth();
      frame.instances = exposure.instances();
      light = smooth;
    } else {
      light += smooth;
    }
  }
  if (instants > 1) light *= 1.0 / instants;
  AddPrecipitation(lighting_, camera_.intrinsics, frame_number, frame.depth, light);
  const float gain = MeterExposure(light, lighting_.exposure, lighting_.key);
  frame.bgr.create(height, width, CV_8UC3);
  frame.classes.create(height, width, CV_8UC1);
  const auto noise_seed =
      static_cast<std::uint32_t>(CounterRandom(street_.seed(), 7, frame_number).Bits());
  ForEachRow(height, options_.threads, [&](int row) {
    DevelopRow(camera_, light, row, gain, noise_seed, frame.bgr);
    const auto* instances = frame.instances.ptr<int>(row);
    auto* classes = frame.classes.ptr<std::uint8_t>(row);
    for (int column = 0; column < width; ++column) {
      classes[column] =
          static_cast<std::uint8_t>(ClassOfInstance(static_cast<std::uint32_t>(instances[column])));
    }
  });
  return frame;
}

}  // namespace livemap::simulation
