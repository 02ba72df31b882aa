#include "simulation/datasets/change_truth.h"

#include <algorithm>

namespace livemap::simulation {
namespace {

/// An object whose middle lies so far behind the camera may still reach into its view.
constexpr double kLongestBehindM = 4;

}  // namespace

InstanceCaster::InstanceCaster(const Street& street, const SimulatedCamera& camera, int threads)
    : threads_(threads),
      scene_(street, false),
      size_(camera.intrinsics.width, camera.intrinsics.height) {
  for (int row = 0; row < size_.height; ++row) {
    for (int column = 0; column < size_.width; ++column) {
      rays_.push_back(camera.Ray(column, row).cast<float>());
    }
  }
}

cv::Mat InstanceCaster::Cast(const CameraExposure& motion) {
  scene_.MoveTo(motion.along_m);
  changes_.clear();
  for (const auto& block : scene_.visible()) {
    changes_.insert(changes_.end(), block->street.changes.begin(), block->street.changes.end());
  }
  const Eigen::Matrix3f rotation = motion.world_from_optical.linear().cast<float>();
  const Vec3 eye = (motion.world_from_optical.translation() - scene_.origin()).cast<float>();
  cv::Mat instances(size_, CV_32SC1);
  ForEachRow(size_.height, threads_, [&](int row) {
    auto* out = instances.ptr<int>(row);
    const Vec3* rays =
        &rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(size_.width)];
    for (int column = 0; column < size_.width; column += 8) {
      const int count = std::min(8, size_.width - column);
      Vec3 directions[8];
      SceneHit hits[8];
      for (int i = 0; i < count; ++i) directions[i] = rotation * rays[column + i];
      scene_.CastEight(eye, directions, count, hits);
      for (int i = 0; i < count; ++i) {
        std::uint32_t instance = MakeInstance(0, ObjectClass::kSky);
        if (hits[i].found) {
          const Mesh& mesh = scene_.block(hits[i].block).street.mesh;
          instance = mesh.triangles[hits[i].triangle].instance;
        }
        out[column + i] = static_cast<int>(instance);
      }
    }
  });
  return instances;
}

ChangeView CompareInstances(const cv::Mat& before, const cv::Mat& after,
                            const std::map<std::uint32_t, StreetChange>& changed) {
  ChangeView view;
  view.mask = cv::Mat::zeros(after.size(), CV_8UC1);
  view.direction = view.mask.clone();
  for (int row = 0; row < after.rows; ++row) {
    const auto* old_line = before.ptr<int>(row);
    const auto* new_line = after.ptr<int>(row);
    auto* mask = view.mask.ptr<std::uint8_t>(row);
    auto* direction = view.direction.ptr<std::uint8_t>(row);
    for (int column = 0; column < after.cols; ++column) {
      if (old_line[column] == new_line[column]) continue;
      for (const int id : {new_line[column], old_line[column]}) {
        const auto instance = static_cast<std::uint32_t>(id);
        const auto change = changed.find(instance);
        if (change == changed.end()) continue;
        mask[column] = static_cast<std::uint8_t>(ChangeClassOf(ClassOfInstance(instance)));
        direction[column] =
            change->second.appeared ? protocol::kAppearedPixel : protocol::kVanishedPixel;
        ++view.pixels[instance];
        break;
      }
    }
  }
  return view;
}

ChangeTruth::ChangeTruth(const WorldDescription& description, std::uint64_t seed, double length_m,
                         bool leaves, double changes, const SimulatedCamera& camera, int threads)
    : before_(description, seed, length_m, leaves, {StreetPass::Which::kFirst, changes}),
      after_(description, seed, length_m, leaves, {StreetPass::Which::kSecond, changes}),
      before_caster_(before_, camera, threads),
      after_caster_(after_, camera, threads) {}

ChangeView ChangeTruth::Look(const CameraExposure& motion) {
  const cv::Mat before = before_caster_.Cast(motion);
  const cv::Mat after = after_caster_.Cast(motion);
  std::map<std::uint32_t, StreetChange> here;
  // Both worlds name the same changes.
  for (const StreetChange& change : after_caster_.changes()) {
    here[change.instance] = change;
    if (change.along_m > motion.along_m - kLongestBehindM) changes_[change.instance] = change;
  }
  return CompareInstances(before, after, here);
}

}  // namespace livemap::simulation
