#pragma once

#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "common/sha256.h"
#include "perception/privacy/plate_network.h"
#include "test/perception/privacy/tiny_networks.h"
#include "test/support/temporary_directory.h"

namespace livemap::perception {

/// A folder with a manifest of networks and, where a test wants it, tiny networks that answer: one
/// person at kPersonBox and one car at kCarBox of every picture of kTinyPicture, a face in the
/// middle of every picture and a plate at one anchor of every picture.
class PlacedNetworks {
 public:
  static constexpr int kSide = 64;  ///< px, of the inputs.

  PlacedNetworks() : files_{FaceFile(0.95F), PlateFile(), RoadUserFile()} {}

  void PlaceAll() const {
    for (std::size_t i = 0; i < 3; ++i) Place(i, files_[i]);
    WriteManifest(files_);
  }
  /// Whatever `bytes` are, the manifest accepts them.
  void PlaceAllWith(std::size_t which, const std::string& bytes) {
    files_[which] = bytes;
    PlaceAll();
  }
  void Place(std::size_t which, const std::string& bytes) const {
    std::ofstream(File(which), std::ios::binary) << bytes;
  }
  void WriteManifest() const { WriteManifest(files_); }

  std::string Manifest() const { return folder_.path() + "/privacy.yaml"; }
  std::string File(std::size_t which) const {
    return folder_.path() + "/" + kNames[which] + ".onnx";
  }

  static std::string FaceFile(float score) {
    // Cells of 8, 16, 32 and 64 px with 3, 2, 2 and 3 anchors.
    constexpr std::size_t kCount = 64 * 3 + 16 * 2 + 4 * 2 + 3;
    std::vector<float> boxes;
    std::vector<float> scores;
    for (std::size_t i = 0; i < kCount; ++i) {
      boxes.insert(boxes.end(), {0.25F, 0.25F, 0.5F, 0.5F});
      const float face = i == 7 ? score : 0.0F;
      scores.insert(scores.end(), {1 - face, face});
    }
    return TinyNetwork("input", kSide, kSide,
                       {{"boxes", {1, kCount, 4}, boxes}, {"scores", {1, kCount, 2}, scores}});
  }

  /// The plate reaches `half_height` px of the input above and below its anchor.
  static std::string PlateFile(float half_height = 1) {
    const auto count = static_cast<std::int64_t>(PlateAnchors({kSide, kSide}).size());
    const auto rows = static_cast<std::size_t>(count);
    std::vector<float> conf(2 * rows, 0.0F);
    std::vector<float> iou(rows, 1.0F);
    std::vector<float> loc(14 * rows, 0.0F);
    // Of the first anchor, centre (4, 4) and side 10: 2 px to the left and right, 1 up and down.
    conf[1] = 0.81F;
    const float h = half_height;
    const float corners[] = {-2, -h, 2, -h, 0, 0, -2, h, 2, h};
    for (std::size_t i = 0; i < 10; ++i) loc[4 + i] = corners[i];
    return TinyNetwork(
        "input", kSide, kSide,
        {{"conf", {count, 2}, conf}, {"iou", {count, 1}, iou}, {"loc", {count, 14}, loc}});
  }

  static std::string RoadUserFile() {
    constexpr std::size_t kCells = 64 + 16 + 4;
    std::vector<float> rows(kCells * 85, 0.0F);
    const auto put = [&](std::size_t cell, std::size_t object, float width, float height) {
      float* row = &rows[cell * 85];
      row[0] = 0.5F;  // In the middle of the cell; sizes are logarithms of cells.
      row[1] = 0.5F;
      row[2] = width;
      row[3] = height;
      row[4] = 1;
      row[5 + object] = 0.9F;
    };
    put(64 + 5, 0, 0, 0);       // A person of 16 x 16 px in the second column and row of 16.
    put(64 + 16 + 3, 2, 0, 0);  // A car of 32 x 32 px in the last column and row of 32.
    return TinyNetwork("images", kSide, kSide, {{"output", {1, kCells, 85}, rows}});
  }

 private:
  static constexpr const char* kNames[] = {"faces", "plates", "road_users"};

  void WriteManifest(const std::vector<std::string>& files) const {
    std::ofstream file(Manifest());
    file << "name: privacy\nkind: privacy\n";
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string name = kNames[i];
      file << name << ":\n  file: " << name << ".onnx\n  sha256: " << Sha256Hex(files[i])
           << "\n  origin: made by the test\n  licence: ours\n"
           << "  input: {width: 64, height: 64, channels: bgr, resize: letterbox, pad_value: 0}\n"
           << "  normalisation: {mean: [0, 0, 0], std: [1, 1, 1]}\n  thresholds: {found: 0.5"
           << (i < 2 ? ", sure: 0.92" : "") << "}\n";
    }
  }

  test::TemporaryDirectory folder_;
  std::vector<std::string> files_;
};

}  // namespace livemap::perception
