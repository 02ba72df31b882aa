#include "tools/evaluation/simulated_recording.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/time.h"
#include "common/utc_text.h"
#include "datasets/camera_file.h"
#include "datasets/seeded_random.h"
#include "datasets/sensors/gnss_receiver_model.h"
#include "geo/wgs84.h"
#include "recordings/positions/gpx_track.h"
#include "recordings/positions/nmea_log.h"
#include "recordings/time_text.h"
#include "simulation/motion/vehicle_motion.h"
#include "simulation/render/lighting.h"
#include "simulation/render/street_renderer.h"

namespace livemap::tools {
namespace {

constexpr std::int64_t kTrueBeginNs = 1'769'862'896'000'000'000;
constexpr double kReceiverLeadS = 25;
constexpr double kMaxOffsetS = 20;
constexpr int kPictureWidth = 256, kPictureHeight = 144;
constexpr double kFrameRateHz = 8;
constexpr double kFrameJitterS = 0.02;
constexpr int kJpegQuality = 60;
/// Of the receiver's Doppler, per axis.
constexpr double kReceiverVelocitySigmaMps = 0.1;
constexpr double kStopMps = 0.2;
constexpr double kTurnDeg = 20;
constexpr double kTurnS = 5;

/// What the seed decides.
struct RecordingDraw {
  explicit RecordingDraw(std::uint64_t seed) : random(seed ^ 0x7265636f7264ULL) {
    style.speed_mps = 6 + 8 * random.Uniform();
    style.stops = random.Uniform() < 0.5;
    const double light = random.Uniform();
    condition = light < 0.55   ? simulation::Condition::kDay
                : light < 0.7  ? simulation::Condition::kDusk
                : light < 0.85 ? simulation::Condition::kRain
                               : simulation::Condition::kSnow;
    field_of_view_deg = Choose({66.0, 90.0, 110.0});
    mounting.height_m = 1.2 + 0.4 * random.Uniform();
    mounting.forward_m = 1.5;
    mounting.yaw_deg = -3 + 6 * random.Uniform();
    mounting.pitch_deg = -1 + 6 * random.Uniform();
    rate_hz = Choose({1.0, 5.0, 10.0});
    const double file = random.Uniform();
    nmea = file < 1.0 / 3;
    velocities = file < 2.0 / 3;
    noise.white_sigma_m = 0.2 + 0.4 * random.Uniform();
    noise.bias_sigma_m = 1;
    offset_s = kMaxOffsetS * (2 * random.Uniform() - 1);
  }

  double Choose(std::initializer_list<double> values) {
    const auto index = static_cast<std::size_t>(random.Uniform() * 3);
    return *(values.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(index, 2)));
  }

  datasets::SeededRandom random;
  simulation::DrivingStyle style;
  simulation::Condition condition;
  double field_of_view_deg;
  datasets::CameraMounting mounting;
  double rate_hz;
  bool nmea;
  bool velocities;  ///< The file states speed and course.
  datasets::GnssReceiverNoise noise;
  double offset_s;
};

simulation::SimulatedCamera CameraOf(double field_of_view_deg) {
  simulation::SimulatedCamera camera;
  const double focal =
      0.5 * kPictureWidth / std::tan(field_of_view_deg / 2 * geo::kRadiansPerDegree);
  camera.intrinsics = {
      focal,         focal,         0.5 * (kPictureWidth - 1), 0.5 * (kPictureHeight - 1),
      kPictureWidth, kPictureHeight};
  return camera;
}

/// The picture as a recorder keeps it.
cv::Mat Compressed(const cv::Mat& bgr) {
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", bgr, jpeg, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  return cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE);
}

/// What a receiver measures at a time.
struct MeasuredState {
  std::int64_t stamp_ns = 0;
  geo::GeoPoint place;
  double speed_mps = 0;
  double course_deg = 0;
};

std::string GpxPoint(const MeasuredState& state, bool velocities) {
  char text[280], motion[80] = "";
  if (velocities) {
    std::snprintf(motion, sizeof motion,
                  "<extensions><speed>%.3f</speed><course>%.2f</course></extensions>",
                  state.speed_mps, state.course_deg);
  }
  std::snprintf(text, sizeof text, "<trkpt lat=\"%.7f\" lon=\"%.7f\"><time>%s</time>%s</trkpt>\n",
                state.place.latitude_deg, state.place.longitude_deg,
                Rfc3339(state.stamp_ns).c_str(), motion);
  return text;
}

/// "4807.03812,N".
std::string NmeaAngle(double degrees, int digits, const char* sides) {
  const double size = std::abs(degrees);
  const int whole = static_cast<int>(size);
  char text[32];
  std::snprintf(text, sizeof text, "%0*d%08.5f,%c", digits, whole, (size - whole) * 60,
                degrees < 0 ? sides[1] : sides[0]);
  return text;
}

std::string RmcSentence(const MeasuredState& state) {
  const std::string utc = Rfc3339(state.stamp_ns);  // 2026-01-31T12:34:56.789Z
  char body[160];
  std::snprintf(body, sizeof body, "GNRMC,%s%s%s,A,%s,%s,%.3f,%.2f,%s%s%s,,,A",
                utc.substr(11, 2).c_str(), utc.substr(14, 2).c_str(), utc.substr(17, 6).c_str(),
                NmeaAngle(state.place.latitude_deg, 2, "NS").c_str(),
                NmeaAngle(state.place.longitude_deg, 3, "EW").c_str(),
                state.speed_mps * 3600 / 1852, state.course_deg, utc.substr(8, 2).c_str(),
                utc.substr(5, 2).c_str(), utc.substr(2, 2).c_str());
  unsigned int sum = 0;
  for (const char* c = body; *c != '\0'; ++c) sum ^= static_cast<unsigned char>(*c);
  char sentence[200];
  std::snprintf(sentence, sizeof sentence, "$%s*%02X\r\n", body, sum);
  return sentence;
}

recordings::RecordedTrack LogOf(const simulation::VehicleMotion& motion, double seconds,
                                std::uint64_t seed, RecordingDraw& draw) {
  const geo::LocalFrame map({48.8566, 9.0});
  datasets::GnssReceiverModel receiver(draw.noise, seed);
  std::string text = draw.nmea ? "" : "<gpx version=\"1.1\"><trk><trkseg>\n";
  const auto count = static_cast<int>((seconds + 2 * kReceiverLeadS) * draw.rate_hz);
  for (int i = 0; i < count; ++i) {
    const double time_s = i / draw.rate_hz - kReceiverLeadS;
    const simulation::VehicleKinematics truth = motion.StateAt(time_s);
    const Eigen::Vector2d error_m = receiver.ErrorAt(time_s).value_or(Eigen::Vector2d::Zero());
    MeasuredState state;
    state.stamp_ns = kTrueBeginNs + Nanoseconds(time_s);
    state.place = map.ToGeo(truth.world_from_base.translation().head<2>() + error_m);
    const Eigen::Vector2d velocity =
        (truth.world_from_base.linear() * truth.velocity_mps).head<2>() +
        kReceiverVelocitySigmaMps * draw.random.Normal();
    state.speed_mps = velocity.norm();
    state.course_deg = std::atan2(velocity.x(), velocity.y()) / geo::kRadiansPerDegree;
    if (state.course_deg < 0) state.course_deg += 360;
    text += draw.nmea ? RmcSentence(state) : GpxPoint(state, draw.velocities);
  }
  return draw.nmea
             ? recordings::ParseNmea(text, "the simulated receiver")
             : recordings::ParseGpx(text + "</trkseg></trk></gpx>\n", "the simulated receiver");
}

/// Whether it stands, and whether it turns, while it is filmed.
void FindEvents(const simulation::VehicleMotion& motion, double seconds,
                SimulatedRecording& recording) {
  const auto heading = [&](double time_s) {
    const Eigen::Vector3d ahead = motion.WorldFromBase(time_s).linear().col(0);
    return std::atan2(ahead.y(), ahead.x());
  };
  for (double time_s = 3; time_s < seconds - 3 - kTurnS; time_s += 0.25) {
    if (motion.SpeedMps(time_s) < kStopMps) recording.stops = true;
    const double turn = std::remainder(heading(time_s + kTurnS) - heading(time_s), 2 * M_PI);
    if (std::abs(turn) > kTurnDeg * geo::kRadiansPerDegree) recording.turns = true;
  }
}

}  // namespace

SimulatedRecording SimulateRecording(std::uint64_t seed, double seconds, int threads) {
  RecordingDraw draw(seed);
  draw.style.seconds = seconds + kReceiverLeadS;
  const simulation::Street street({}, seed, (seconds + 2 * kReceiverLeadS) * 16 + 600,
                                  draw.condition != simulation::Condition::kSnow);
  const simulation::VehicleMotion motion(street, draw.style, 16 * kReceiverLeadS);
  const simulation::SimulatedCamera camera = CameraOf(draw.field_of_view_deg);
  simulation::RenderConfig config;
  config.threads = threads;
  config.smooth_edges = false;
  simulation::StreetRenderer renderer(street, camera,
                                      simulation::MakeLighting(draw.condition, seed), config);
  SimulatedRecording recording;
  recording.offset_s = draw.offset_s;
  recording.track = LogOf(motion, seconds, seed, draw);
  recording.receiver = std::string(draw.nmea         ? "NMEA, "
                                   : draw.velocities ? "GPX with speed, "
                                                     : "GPX, ") +
                       std::to_string(static_cast<int>(draw.rate_hz)) + " Hz";
  FindEvents(motion, seconds, recording);
  recordings::ImageMotionMeter meter;
  const auto frames = static_cast<std::uint32_t>(seconds * kFrameRateHz);
  for (std::uint32_t i = 0; i < frames; ++i) {
    const double time_s = i / kFrameRateHz + kFrameJitterS * draw.random.Uniform();
    simulation::CameraExposure exposure;
    exposure.world_from_optical = motion.WorldFromBase(time_s) * draw.mounting.BaseFromOptical();
    exposure.world_from_optical_end = exposure.world_from_optical;
    exposure.along_m = motion.AlongM(time_s);
    const cv::Mat grey = Compressed(renderer.Render(exposure, i).bgr);
    const auto seen =
        meter.Add(grey, kTrueBeginNs + Nanoseconds(time_s) - Nanoseconds(draw.offset_s));
    if (seen) recording.picture.push_back(*seen);
  }
  return recording;
}

}  // namespace livemap::tools
