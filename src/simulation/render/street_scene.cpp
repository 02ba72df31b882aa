#include "simulation/render/street_scene.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "common/error.h"

namespace livemap::simulation {
namespace {

constexpr double kBehindM = 24;
constexpr double kAheadM = 210;
// The ground's view of the sky is measured on a grid of this pitch.
constexpr float kSkyCellM = 0.25F;
constexpr float kSkyHalfWidthM = 11;
constexpr int kSkyRows = static_cast<int>(kBlockM / static_cast<double>(kSkyCellM));
constexpr int kSkyColumns = static_cast<int>(2 * kSkyHalfWidthM / kSkyCellM);
constexpr int kSkyRays = 20;
constexpr float kSkyReachM = 14;

void RefuseSceneError(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error != RTC_ERROR_NONE) {
    throw std::runtime_error("Embree failed with code " + std::to_string(static_cast<int>(error)));
  }
}

RTCScene MakeBlockScene(RTCDevice device, const Mesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.positions.size()));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh.triangles.size()));
  for (const Vec3& position : mesh.positions) {
    std::memcpy(vertices, position.data(), 3 * sizeof(float));
    vertices += 3;
  }
  for (const Triangle& triangle : mesh.triangles) {
    std::memcpy(indices, triangle.corners, sizeof(triangle.corners));
    indices += 3;
  }
  rtcCommitGeometry(geometry);
  RTCScene scene = rtcNewScene(device);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  return scene;
}

RTCRay MakeSceneRay(const Vec3& from, const Vec3& direction, float nearest, float farthest) {
  RTCRay ray;
  ray.org_x = from.x();
  ray.org_y = from.y();
  ray.org_z = from.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tnear = nearest;
  ray.tfar = farthest;
  ray.time = 0;
  ray.mask = 0xffffffffU;
  ray.id = 0;
  ray.flags = 0;
  return ray;
}

}  // namespace

StreetScene::StreetScene(const Street& street, bool lit) : street_(street), lit_(lit) {
  // One thread builds: with more, equal distances could be decided differently from run to run.
  device_ = rtcNewDevice("threads=1");
  if (device_ == nullptr) throw std::runtime_error("Embree cannot start");
}

StreetScene::~StreetScene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  for (auto& [index, block] : loaded_) rtcReleaseScene(block->scene);
  rtcReleaseDevice(device_);
}

std::shared_ptr<StreetScene::Block> StreetScene::Load(int index) {
  const auto found = loaded_.find(index);
  if (found != loaded_.end()) return found->second;
  auto block = std::make_shared<Block>();
  block->street = street_.Build(index);
  const double heading = street_.line().HeadingRad((index + 0.5) * kBlockM);
  block->heading =
      Vec2(static_cast<float>(std::cos(heading)), static_cast<float>(std::sin(heading)));
  block->scene = MakeBlockScene(device_, block->street.mesh);
  RefuseSceneError(device_);
  loaded_[index] = block;
  return block;
}

RTCScene StreetScene::Assemble(int first, int last, const Eigen::Vector3d& origin) {
  RTCScene scene = rtcNewScene(device_);
  for (int index = first; index <= last; ++index) {
    const std::shared_ptr<Block> block = Load(index);
    const Vec3 offset = (block->street.origin - origin).cast<float>();
    RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, block->scene);
    const float columns[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, offset.x(), offset.y(), offset.z()};
    rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(scene, instance, static_cast<unsigned>(index - first));
    rtcReleaseGeometry(instance);
  }
  rtcCommitScene(scene);
  RefuseSceneError(device_);
  return scene;
}

void StreetScene::MeasureSky(int index) {
  Block& block = *Load(index);
  if (!block.sky.empty()) return;
  // A scene of its own makes the result depend on the block alone, not on the way here.
  const Eigen::Vector3d origin = block.street.origin;
  RTCScene scene = Assemble(index - 1, index + 1, origin);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  block.sky.resize(static_cast<std::size_t>(kSkyRows) * kSkyColumns);
  for (int row = 0; row < kSkyRows; ++row) {
    const double along = index * kBlockM + (row + 0.5) * static_cast<double>(kSkyCellM);
    for (int column = 0; column < kSkyColumns; ++column) {
      const float left = (static_cast<float>(column) + 0.5F) * kSkyCellM - kSkyHalfWidthM;
      const Vec3 place =
          (street_.line().At(along, static_cast<double>(left), 0.16) - origin).cast<float>();
      const std::uint32_t turn = HashLattice(row, column, 99);
      int open = 0;
      for (int i = 0; i < kSkyRays; ++i) {
        // A spiral over the disc is a cosine-weighted set of directions.
        const float r2 = (static_cast<float>(i) + 0.5F) / kSkyRays;
        const float angle = 2.39996F * static_cast<float>(i) + 6.2832F * UnitFloat(turn);
        const float r = std::sqrt(r2);
        RTCRay ray =
            MakeSceneRay(place, {r * std::cos(angle), r * std::sin(angle), std::sqrt(1 - r2)},
                         0.01F, kSkyReachM);
        rtcOccluded1(scene, &context, &ray);
        if (ray.tfar >= 0) ++open;
      }
      block.sky[static_cast<std::size_t>(row) * kSkyColumns + static_cast<std::size_t>(column)] =
          static_cast<float>(open) / kSkyRays;
    }
  }
  rtcReleaseScene(scene);
}

float StreetScene::SkyOverGround(const Block& block, float local_along, float left) {
  if (block.sky.empty()) return 1;
  const float x = local_along / kSkyCellM - 0.5F;
  const float y = (left + kSkyHalfWidthM) / kSkyCellM - 0.5F;
  const std::int32_t ix = FloorToInt(x);
  const std::int32_t iy = FloorToInt(y);
  const auto at = [&](std::int32_t row, std::int32_t column) {
    row = std::min(std::max(row, 0), kSkyRows - 1);
    column = std::min(std::max(column, 0), kSkyColumns - 1);
    return block
        .sky[static_cast<std::size_t>(row) * kSkyColumns + static_cast<std::size_t>(column)];
  };
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  return Blend(Blend(at(ix, iy), at(ix, iy + 1), fy), Blend(at(ix + 1, iy), at(ix + 1, iy + 1), fy),
               fx);
}

void StreetScene::MoveTo(double along_m) {
  const auto first = static_cast<int>(std::floor((along_m - kBehindM) / kBlockM));
  const auto last = static_cast<int>(std::floor((along_m + kAheadM) / kBlockM));
  if (first == first_ && last == last_) return;
  first_ = first;
  last_ = last;
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  scene_ = nullptr;
  for (auto it = loaded_.begin(); it != loaded_.end();) {
    if (it->first >= first - 1 && it->first <= last + 1) {
      ++it;
      continue;
    }
    rtcReleaseScene(it->second->scene);
    it = loaded_.erase(it);
  }
  if (lit_) {
    for (int index = first; index <= last; ++index) MeasureSky(index);
  }
  origin_ = street_.line().At((first + 1) * kBlockM, 0, 0);
  scene_ = Assemble(first, last, origin_);
  visible_.clear();
  for (int index = first; index <= last; ++index) {
    visible_.push_back(Load(index));
    visible_.back()->offset = (visible_.back()->street.origin - origin_).cast<float>();
  }
}

SceneHit StreetScene::Cast(const Vec3& from, const Vec3& direction, float nearest,
                           float farthest) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  query.ray = MakeSceneRay(from, direction, nearest, farthest);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_, &context, &query);
  SceneHit hit;
  hit.found = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  hit.distance = query.ray.tfar;
  hit.block = query.hit.instID[0];
  hit.triangle = query.hit.primID;
  hit.u = query.hit.u;
  hit.v = query.hit.v;
  return hit;
}

void StreetScene::CastEight(const Vec3& from, const Vec3* directions, int count,
                            SceneHit* hits) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRayHit8 query;
  alignas(32) int valid[8];
  for (int i = 0; i < 8; ++i) {
    const Vec3& direction = directions[i < count ? i : 0];
    valid[i] = i < count ? -1 : 0;
    query.ray.org_x[i] = from.x();
    query.ray.org_y[i] = from.y();
    query.ray.org_z[i] = from.z();
    query.ray.dir_x[i] = direction.x();
    query.ray.dir_y[i] = direction.y();
    query.ray.dir_z[i] = direction.z();
    query.ray.tnear[i] = 0.05F;
    query.ray.tfar[i] = std::numeric_limits<float>::infinity();
    query.ray.time[i] = 0;
    query.ray.mask[i] = 0xffffffffU;
    query.ray.id[i] = 0;
    query.ray.flags[i] = 0;
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect8(valid, scene_, &context, &query);
  for (int i = 0; i < count; ++i) {
    hits[i].found = query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hits[i].distance = query.ray.tfar[i];
    hits[i].block = query.hit.instID[0][i];
    hits[i].triangle = query.hit.primID[i];
    hits[i].u = query.hit.u[i];
    hits[i].v = query.hit.v[i];
  }
}

unsigned StreetScene::BlockedOfEight(const Vec3* from, unsigned wanted, const Vec3& direction,
                                     float farthest) const {
  if (wanted == 0) return 0;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRay8 ray;
  alignas(32) int valid[8];
  for (unsigned i = 0; i < 8; ++i) {
    const bool asked = (wanted >> i & 1U) != 0;
    valid[i] = asked ? -1 : 0;
    const Vec3 start = asked ? from[i] : Vec3::Zero();
    ray.org_x[i] = start.x();
    ray.org_y[i] = start.y();
    ray.org_z[i] = start.z();
    ray.dir_x[i] = direction.x();
    ray.dir_y[i] = direction.y();
    ray.dir_z[i] = direction.z();
    ray.tnear[i] = 0.004F;
    ray.tfar[i] = farthest;
    ray.time[i] = 0;
    ray.mask[i] = 0xffffffffU;
    ray.id[i] = 0;
    ray.flags[i] = 0;
  }
  rtcOccluded8(valid, scene_, &context, &ray);
  unsigned blocked = 0;
  for (unsigned i = 0; i < 8; ++i) {
    if (valid[i] != 0 && ray.tfar[i] < 0) blocked |= 1U << i;
  }
  return blocked;
}

}  // namespace livemap::simulation
