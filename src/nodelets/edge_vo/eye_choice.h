#pragma once

#include <cstdint>

namespace livemap::nodelets {

/// By what a camera is followed.
enum class Eye {
  kUndecided,  ///< Images came, and depth may yet come.
  kDepth,      ///< By depth images, of a depth camera or of two eyes.
  kMono,       ///< By its images alone.
};
/// "undecided", "depth", "mono".
const char* EyeName(Eye eye);

/// Decides whether depth images or the images alone are followed, by what arrives: images whose
/// depth has not come after some time are followed with one eye; depth that comes later takes over,
/// once. Stamps are the images', in nanoseconds, so that a replay decides the same again.
class EyeChoice {
 public:
  enum class Wanted { kAuto, kDepth, kMono };
  struct Config {
    Wanted wanted = Wanted::kAuto;
    /// Images without depth for so long mean that there is none, s.
    double wait_s = 2.0;
    /// So many images with depth in succession mean that there is depth after all.
    int depths_to_change = 5;
  };

  explicit EyeChoice(const Config& config);

  /// An image came, with or without its depth: depth is a matter of OnDepth. True: it is to be
  /// followed with one eye.
  bool OnImage(std::int64_t stamp_ns);
  /// An image came together with its depth. True: it is to be followed by its depth.
  bool OnDepth(std::int64_t stamp_ns);
  /// The stamps went back: what has been decided stays.
  void OnTimeReset();

  Eye eye() const { return eye_; }

 private:
  const Config config_;
  Eye eye_ = Eye::kUndecided;
  std::int64_t first_image_ns_ = 0;
  std::int64_t last_image_ns_ = 0;  // 0: none.
  std::int64_t last_depth_ns_ = 0;
  int depths_ = 0;  // In succession.
};

}  // namespace livemap::nodelets
