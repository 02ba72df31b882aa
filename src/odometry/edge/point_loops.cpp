#include "odometry/edge/point_loops.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

// The same source is compiled for each kind of processor. Fused multiplications would round
// otherwise than separate ones, so that no kind has them.
#if defined(__x86_64__)
#define LIVEMAP_HAS_AVX2_LOOPS 1
#else
#define LIVEMAP_HAS_AVX2_LOOPS 0
#endif
#define LIVEMAP_IN_EACH [[gnu::always_inline]] inline

namespace livemap::odometry {
namespace {

constexpr std::size_t kLaneCount = 8;
constexpr std::size_t kBlock = 256;  // Points worked off at once: their arrays stay in the cache.
constexpr float kNearestM = 0.01F;
constexpr int kWithArrays = 7;  // Unknowns whose derivatives are stored; that by the bias is 1.

/// Where the processor has shorter vectors, the compiler takes several.
using Lanes = float __attribute__((vector_size(kLaneCount * sizeof(float))));

using IntLanes = std::int32_t __attribute__((vector_size(kLaneCount * sizeof(std::int32_t))));

template <typename Vector, typename Element>
LIVEMAP_IN_EACH void Load(const Element* from, Vector& lanes) {
  std::memcpy(&lanes, from, sizeof lanes);
}

template <typename Vector, typename Element>
LIVEMAP_IN_EACH void Store(const Vector& lanes, Element* to) {
  std::memcpy(to, &lanes, sizeof lanes);
}

/// Of the lanes, always in the same order.
LIVEMAP_IN_EACH double SumOf(const Lanes& lanes) {
  const float even = (lanes[0] + lanes[4]) + (lanes[2] + lanes[6]);
  const float odd = (lanes[1] + lanes[5]) + (lanes[3] + lanes[7]);
  return static_cast<double>(even + odd);
}

/// What the loops read and write, without Eigen: its functions might be compiled for one kind of
/// processor here and be called on another elsewhere.
struct ResidualArrays {
  const float *x, *y, *z, *intensity, *factor;
  float *value, *visible;
  std::size_t size;
};
struct GreyPixels {
  const std::uint8_t* data;
  std::int32_t row_bytes;
  float last_u, last_v;
};
struct ProjectionNumbers {
  float rotation[3][3];
  float translation[3];
  float fx, fy, cx, cy, gain, bias;
};

/// One coordinate of points after the motion.
LIVEMAP_IN_EACH void Move(const ProjectionNumbers& p, std::size_t row, const Lanes& x,
                          const Lanes& y, const Lanes& z, Lanes& moved) {
  moved =
      p.rotation[row][0] * x + p.rotation[row][1] * y + p.rotation[row][2] * z + p.translation[row];
}

/// At most kBlock points, a multiple of kLaneCount; adds those that are visible.
LIVEMAP_IN_EACH void EvaluateBlock(const ResidualArrays& arrays, const GreyPixels& image,
                                   const ProjectionNumbers& projection, IntLanes& count) {
  // Copies: what is stored might be one of these, as far as the compiler knows.
  const ProjectionNumbers p = projection;
  const GreyPixels pixels = image;
  const std::size_t n = arrays.size;
  alignas(32) float right_share[kBlock], lower_share[kBlock];
  alignas(32) std::int32_t place[kBlock], four_pixels[kBlock];
  for (std::size_t i = 0; i < n; i += kLaneCount) {
    Lanes x, y, z;
    Load(arrays.x + i, x);
    Load(arrays.y + i, y);
    Load(arrays.z + i, z);
    Lanes across, down, depth;
    Move(p, 0, x, y, z, across);
    Move(p, 1, x, y, z, down);
    Move(p, 2, x, y, z, depth);
    const Lanes u = across / depth * p.fx + p.cx;
    const Lanes v = down / depth * p.fy + p.cy;
    // Written so that NaN is not visible.
    const IntLanes is_visible =
        (depth > kNearestM) & (u >= 0) & (v >= 0) & (u < pixels.last_u) & (v < pixels.last_v);
    const Lanes zero = {};
    const Lanes inside_u = is_visible ? u : zero, inside_v = is_visible ? v : zero;
    const IntLanes left = __builtin_convertvector(inside_u, IntLanes);
    const IntLanes top = __builtin_convertvector(inside_v, IntLanes);
    Store(inside_u - __builtin_convertvector(left, Lanes), right_share + i);
    Store(inside_v - __builtin_convertvector(top, Lanes), lower_share + i);
    Store(top * pixels.row_bytes + left, place + i);
    Store(__builtin_convertvector(-is_visible, Lanes), arrays.visible + i);
    count -= is_visible;
  }
  for (std::size_t i = 0; i < n; ++i) {
    std::uint16_t upper, lower;
    std::memcpy(&upper, pixels.data + place[i], sizeof upper);
    std::memcpy(&lower, pixels.data + place[i] + pixels.row_bytes, sizeof lower);
    four_pixels[i] = static_cast<std::int32_t>(upper | static_cast<std::uint32_t>(lower) << 16U);
  }
  for (std::size_t i = 0; i < n; i += kLaneCount) {
    IntLanes four;
    Lanes right, lower, intensity, factor, visible;
    Load(four_pixels + i, four);
    Load(right_share + i, right);
    Load(lower_share + i, lower);
    Load(arrays.intensity + i, intensity);
    Load(arrays.factor + i, factor);
    Load(arrays.visible + i, visible);
    const Lanes upper_left = __builtin_convertvector(four & 255, Lanes);
    const Lanes upper_right = __builtin_convertvector((four >> 8) & 255, Lanes);
    const Lanes lower_left = __builtin_convertvector((four >> 16) & 255, Lanes);
    const Lanes lower_right = __builtin_convertvector((four >> 24) & 255, Lanes);
    const Lanes above = upper_left + right * (upper_right - upper_left);
    const Lanes below = lower_left + right * (lower_right - lower_left);
    const Lanes shown = above + lower * (below - above);
    Store(visible * factor * (shown - p.gain * intensity - p.bias), arrays.value + i);
  }
}

LIVEMAP_IN_EACH std::size_t Evaluate(const ResidualArrays& arrays, const GreyPixels& image,
                                     const ProjectionNumbers& projection) {
  const std::size_t whole = arrays.size / kLaneCount * kLaneCount;
  IntLanes count = {};
  ResidualArrays block = arrays;
  for (std::size_t begin = 0; begin < arrays.size; begin += block.size) {
    block = {arrays.x + begin,         arrays.y + begin,      arrays.z + begin,
             arrays.intensity + begin, arrays.factor + begin, arrays.value + begin,
             arrays.visible + begin,   arrays.size - begin};
    if (begin < whole) {
      block.size = std::min(kBlock, whole - begin);
      EvaluateBlock(block, image, projection, count);
      continue;
    }
    // Up to a whole vector with points that do not count.
    float rest[kLaneCount][kLaneCount] = {};
    const std::size_t bytes = block.size * sizeof(float);
    std::memcpy(rest[0], block.x, bytes);
    std::memcpy(rest[1], block.y, bytes);
    std::memcpy(rest[2], block.z, bytes);
    std::memcpy(rest[3], block.intensity, bytes);
    std::memcpy(rest[4], block.factor, bytes);
    EvaluateBlock({rest[0], rest[1], rest[2], rest[3], rest[4], rest[5], rest[6], kLaneCount},
                  image, projection, count);
    std::memcpy(block.value, rest[5], bytes);
    std::memcpy(block.visible, rest[6], bytes);
    for (std::size_t i = block.size; i < kLaneCount; ++i) count[0] -= rest[6][i] > 0 ? 1 : 0;
  }
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < kLaneCount; ++i) sum += count[i];
  return static_cast<std::size_t>(sum);
}

struct NormalArrays {
  std::array<const float*, kWithArrays> derivative;
  const float *value, *visible, *factor;
  std::size_t size;
};
/// Row i of the lower triangle begins at i (i + 1) / 2.
struct NormalNumbers {
  std::array<double, kAlignmentUnknowns*(kAlignmentUnknowns + 1) / 2> normal, scatter;
  std::array<double, kAlignmentUnknowns> gradient;
};

/// Gradients of one part, until it is complete.
struct OpenPart {
  Lanes sums[kAlignmentUnknowns];
  std::size_t points;
};

LIVEMAP_IN_EACH void ClosePart(OpenPart& part, NormalNumbers& out) {
  double gradient[kAlignmentUnknowns];
  for (int i = 0; i < kAlignmentUnknowns; ++i) {
    gradient[i] = SumOf(part.sums[i]);
    part.sums[i] = Lanes{};
  }
  part.points = 0;
  std::size_t at = 0;
  for (std::size_t i = 0; i < kAlignmentUnknowns; ++i) {
    out.gradient[i] += gradient[i];
    for (std::size_t j = 0; j <= i; ++j) out.scatter[at++] += gradient[i] * gradient[j];
  }
}

/// Row kRow of the lower triangle, and that of the bias in the column of kRow.
template <int kRow>
LIVEMAP_IN_EACH void AddRow(const NormalArrays& arrays, const float* weight, std::size_t n,
                            NormalNumbers& out) {
  Lanes sums[kRow + 1] = {}, with_bias = {};
  for (std::size_t i = 0; i < n; i += kLaneCount) {
    Lanes weighted, derivative;
    Load(weight + i, weighted);
    Load(arrays.derivative[kRow] + i, derivative);
    weighted *= derivative;
    with_bias += weighted;
#pragma GCC unroll 8
    for (int j = 0; j <= kRow; ++j) {
      Load(arrays.derivative[static_cast<std::size_t>(j)] + i, derivative);
      sums[j] += weighted * derivative;
    }
  }
  constexpr std::size_t kRowBegin = kRow * (kRow + 1) / 2;
  constexpr std::size_t kBiasBegin = kWithArrays * (kWithArrays + 1) / 2;
  for (std::size_t j = 0; j <= kRow; ++j) out.normal[kRowBegin + j] += SumOf(sums[j]);
  out.normal[kBiasBegin + kRow] += SumOf(with_bias);
}

/// At most kBlock points, a multiple of kLaneCount.
LIVEMAP_IN_EACH void AddBlock(const NormalArrays& arrays, float huber, std::size_t part_size,
                              OpenPart& part, NormalNumbers& out) {
  alignas(32) float weight[kBlock], pull[kBlock];
  const std::size_t n = arrays.size;
  for (std::size_t i = 0; i < n; ++i) {
    const float magnitude = std::abs(arrays.value[i]);
    const float factor = arrays.factor[i];
    weight[i] =
        arrays.visible[i] * (factor * factor) * (huber / (magnitude > huber ? magnitude : huber));
    pull[i] = weight[i] * (arrays.value[i] / factor);
  }
  for (std::size_t i = 0; i < n; i += kLaneCount) {
    Lanes pulls, derivative;
    Load(pull + i, pulls);
#pragma GCC unroll 8
    for (std::size_t unknown = 0; unknown < kWithArrays; ++unknown) {
      Load(arrays.derivative[unknown] + i, derivative);
      part.sums[unknown] += pulls * derivative;
    }
    part.sums[kWithArrays] += pulls;
    part.points += kLaneCount;
    if (part.points == part_size) ClosePart(part, out);
  }
  AddRow<0>(arrays, weight, n, out);
  AddRow<1>(arrays, weight, n, out);
  AddRow<2>(arrays, weight, n, out);
  AddRow<3>(arrays, weight, n, out);
  AddRow<4>(arrays, weight, n, out);
  AddRow<5>(arrays, weight, n, out);
  AddRow<6>(arrays, weight, n, out);
  Lanes sum = {};
  for (std::size_t i = 0; i < n; i += kLaneCount) {
    Lanes weights;
    Load(weight + i, weights);
    sum += weights;
  }
  out.normal.back() += SumOf(sum);
}

LIVEMAP_IN_EACH void Sum(const NormalArrays& arrays, float huber, std::size_t part_size,
                         NormalNumbers& out) {
  OpenPart part = {};
  const std::size_t whole = arrays.size / kLaneCount * kLaneCount;
  NormalArrays block = arrays;
  const auto begin_at = [&](std::size_t begin) {
    for (std::size_t k = 0; k < kWithArrays; ++k) {
      block.derivative[k] = arrays.derivative[k] + begin;
    }
    block.value = arrays.value + begin;
    block.visible = arrays.visible + begin;
    block.factor = arrays.factor + begin;
  };
  for (std::size_t begin = 0; begin < whole; begin += kBlock) {
    begin_at(begin);
    block.size = std::min(kBlock, whole - begin);
    AddBlock(block, huber, part_size, part, out);
  }
  if (whole < arrays.size) {  // Up to a whole vector with points that nobody sees.
    alignas(32) float rest[kWithArrays + 3][kLaneCount] = {};
    const std::size_t bytes = (arrays.size - whole) * sizeof(float);
    begin_at(whole);
    block.size = kLaneCount;
    float* row = rest[0];
    const auto fill_up = [&](const float*& array) {
      std::memcpy(row, array, bytes);
      array = row;
      row += kLaneCount;
    };
    for (const float*& derivative : block.derivative) fill_up(derivative);
    fill_up(block.value);
    fill_up(block.visible);
    for (std::size_t i = 0; i < kLaneCount; ++i) row[i] = 1;
    fill_up(block.factor);
    AddBlock(block, huber, part_size, part, out);
  }
  if (part.points > 0) ClosePart(part, out);
}

#if LIVEMAP_HAS_AVX2_LOOPS
__attribute__((target("avx2"))) std::size_t EvaluateByAvx2(const ResidualArrays& arrays,
                                                           const GreyPixels& image,
                                                           const ProjectionNumbers& projection) {
  return Evaluate(arrays, image, projection);
}
__attribute__((target("avx2"))) void SumByAvx2(const NormalArrays& arrays, float huber,
                                               std::size_t part_size, NormalNumbers& out) {
  Sum(arrays, huber, part_size, out);
}
bool HasAvx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
}
#endif

std::size_t EvaluateHere(const ResidualArrays& arrays, const GreyPixels& image,
                         const ProjectionNumbers& projection) {
#if LIVEMAP_HAS_AVX2_LOOPS
  if (HasAvx2()) return EvaluateByAvx2(arrays, image, projection);
#endif
  return Evaluate(arrays, image, projection);
}

void SumHere(const NormalArrays& arrays, float huber, std::size_t part_size, NormalNumbers& out) {
#if LIVEMAP_HAS_AVX2_LOOPS
  if (HasAvx2()) return SumByAvx2(arrays, huber, part_size, out);
#endif
  Sum(arrays, huber, part_size, out);
}

}  // namespace

void EvaluateResiduals(const EdgePoints& points, const std::vector<float>& factor,
                       const cv::Mat& grey, const PointProjection& projection,
                       PointResiduals& residuals) {
  residuals.value.resize(points.size());
  residuals.visible.resize(points.size());
  residuals.count = 0;
  if (grey.cols < 2 || grey.rows < 2) {  // Between no four pixels.
    std::fill(residuals.value.begin(), residuals.value.end(), 0.0F);
    std::fill(residuals.visible.begin(), residuals.visible.end(), 0.0F);
    return;
  }
  const ResidualArrays arrays = {points.x.data(),          points.y.data(), points.z.data(),
                                 points.intensity.data(),  factor.data(),   residuals.value.data(),
                                 residuals.visible.data(), points.size()};
  const GreyPixels image = {grey.data, static_cast<std::int32_t>(grey.step[0]),
                            static_cast<float>(grey.cols - 1), static_cast<float>(grey.rows - 1)};
  ProjectionNumbers numbers = {{},
                               {},
                               projection.fx,
                               projection.fy,
                               projection.cx,
                               projection.cy,
                               projection.gain,
                               projection.bias};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      numbers.rotation[row][column] = projection.rotation(row, column);
    }
    numbers.translation[row] = projection.translation[row];
  }
  residuals.count = EvaluateHere(arrays, image, numbers);
}

NormalSums SumNormalEquations(const EdgePoints& points, const std::vector<float>& factor,
                              const PointResiduals& residuals, float huber, std::size_t part_size) {
  NormalArrays arrays = {
      {}, residuals.value.data(), residuals.visible.data(), factor.data(), points.size()};
  for (std::size_t i = 0; i < points.jacobian.size(); ++i) {
    arrays.derivative[i] = points.jacobian[i].data();
  }
  arrays.derivative.back() = points.intensity.data();
  NormalNumbers numbers = {};
  SumHere(arrays, huber, part_size, numbers);
  NormalSums sums;
  std::size_t at = 0;
  for (int i = 0; i < kAlignmentUnknowns; ++i) {
    sums.gradient[i] = numbers.gradient[static_cast<std::size_t>(i)];
    for (int j = 0; j <= i; ++j, ++at) {
      sums.normal(i, j) = numbers.normal[at];
      sums.scatter(i, j) = sums.scatter(j, i) = numbers.scatter[at];
    }
  }
  return sums;
}

}  // namespace livemap::odometry
