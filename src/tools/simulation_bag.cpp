#include "tools/simulation_bag.h"

#include <opencv2/imgcodecs.hpp>

#include "tools/drive_bag.h"

namespace livemap {
namespace {

/// 2026-01-01T12:00:00Z, as other drives begin.
constexpr std::uint32_t kStartS = 1767268800;
constexpr double kFixRateHz = 10;

DriveSetup ToDriveSetup(const SimulationBag::Setup& setup) {
  DriveSetup drive{Route::Straight(setup.place(0), 0),
                   0,
                   setup.camera,
                   ReceiverNoise(),
                   kFixRateHz,
                   setup.seed,
                   ros::Time(kStartS, 0)};
  drive.place = setup.place;
  return drive;
}

class RosSimulationBag : public SimulationBag {
 public:
  RosSimulationBag(const std::string& path, const Setup& setup)
      : bag_(path, ToDriveSetup(setup)), jpeg_quality_(setup.jpeg_quality) {}

  void Add(double time_s, const SimulatedFrame& frame,
           const std::vector<HazardInView>& hazards) override {
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", frame.bgr, jpeg,
                 {cv::IMWRITE_JPEG_QUALITY, jpeg_quality_, cv::IMWRITE_JPEG_OPTIMIZE, 1});
    std::vector<Detection> boxes;
    for (const HazardInView& hazard : hazards) {
      Detection box;
      box.class_name = ClassName(hazard.object_class);
      box.confidence = 1;
      box.x_min = static_cast<float>(hazard.box.x);
      box.y_min = static_cast<float>(hazard.box.y);
      box.x_max = static_cast<float>(hazard.box.br().x);
      box.y_max = static_cast<float>(hazard.box.br().y);
      boxes.push_back(box);
    }
    bag_.AddFrame(time_s, jpeg, boxes);
  }

  void Finish(double end_s) override { bag_.Finish(end_s); }

 private:
  DriveBag bag_;
  const int jpeg_quality_;
};

}  // namespace

std::unique_ptr<SimulationBag> OpenSimulationBag(const std::string& path,
                                                 const SimulationBag::Setup& setup) {
  return std::make_unique<RosSimulationBag>(path, setup);
}

}  // namespace livemap
