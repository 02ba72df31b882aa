// Counts what Track allocates, OpenCV's allocations included: this program's malloc stands before
// the C library's.
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <cstddef>

#include "odometry/edge/edge_odometry.h"
#include "test/odometry/synthetic_scene.h"

namespace {

std::atomic<bool> counting{false};
std::atomic<int> allocations{0};

void Count() {
  if (counting) ++allocations;
}

}  // namespace

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  Count();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  Count();
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) noexcept {
  Count();
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  Count();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
  Count();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}

namespace livemap::odometry {
namespace {

int AllocationsOf(EdgeOdometry& odometry, const RgbdFrame& frame, VoResult& result) {
  allocations = 0;
  counting = true;
  result = odometry.Track(frame);
  counting = false;
  return allocations;
}

TEST(EdgeOdometryMemory, NoFrameAfterTheFirstAllocates) {
  const geo::CameraIntrinsics camera{520, 520, 319.5, 239.5, 640, 480};
  const SyntheticWall wall(camera);
  EdgeOdometry odometry({}, camera);
  VoResult result;
  int keyframes = 0;
  for (int i = 0; i < 25; ++i) {
    const double t = i * 0.1;
    RgbdFrame frame = wall.See(1'000'000'000 + i * 33'333'333LL,
                               Pose(0.12 * std::sin(t), 0.05 * t, 0, 0, 0, 0.06 * std::sin(t)));
    if (i == 12) frame.grey.setTo(0);  // Lost, and found again.
    const int count = AllocationsOf(odometry, frame, result);
    if (i == 0) {
      EXPECT_GT(count, 0) << "the counter works";
    } else {
      EXPECT_EQ(count, 0) << "frame " << i << (result.new_keyframe ? ", a keyframe" : "");
    }
    EXPECT_EQ(result.state, i == 12 ? VoState::kLost : VoState::kTracking) << i;
    keyframes += result.new_keyframe ? 1 : 0;
  }
  EXPECT_GT(keyframes, 3);
}

}  // namespace
}  // namespace livemap::odometry
