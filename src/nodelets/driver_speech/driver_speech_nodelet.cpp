#include <livemap/HazardAlert.h>
#include <ros/package.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <utility>
#include <vector>

#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/alert_conversions.h"
#include "ros/parameters/driver_speech_parameters.h"
#include "vehicle/speech/speaker.h"
#include "vehicle/speech/speechd_voice.h"
#include "vehicle/speech/tone_voice.h"

namespace livemap::nodelets {

/// Lets the driver hear the alerts of driver_alert: Speaker with a topic.
class DriverSpeechPart : public NodeletPart {
 public:
  ~DriverSpeechPart() override {
    diagnostics_.reset();
    subscriber_.shutdown();
  }

 private:
  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    ros_io::DriverSpeechConfig config = ros_io::ReadDriverSpeechConfig(parameters);
    const std::string package_config = ros::package::getPath("livemap") + "/config/";
    if (config.catalogue.empty()) config.catalogue = package_config + "hazards.yaml";
    if (config.language_file.empty()) {
      config.language_file = package_config + "languages/" + config.language + ".txt";
    }
    const auto language = vehicle::SpokenLanguage::Load(
        config.language_file, protocol::HazardCatalogue::Load(config.catalogue));
    std::vector<std::unique_ptr<vehicle::Voice>> voices;
    if (config.use_words) {
      config.speech.language = language.code();
      voices.push_back(std::make_unique<vehicle::SpeechdVoice>(config.speech));
    }
    voices.push_back(std::make_unique<vehicle::ToneVoice>(config.player));
    speaker_ = std::make_unique<vehicle::Speaker>(config.speaker, language, std::move(voices));
    subscriber_ = getNodeHandle().subscribe("hazard/alert", 100, &DriverSpeechPart::OnAlert, this);
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "driver_speech", "driver_speech",
                            config.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void OnAlert(const HazardAlert& message) {
    try {
      speaker_->Take(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped an alert: %s", error.what());
    }
  }

  void Diagnose(Diagnostics::Status& status) const {
    using Level = diagnostic_msgs::DiagnosticStatus;
    const vehicle::Speaker::State state = speaker_->state();
    if (!state.is_known) {
      status.summary(Level::OK, "tries its voices");
    } else if (state.voice.empty()) {
      status.summary(Level::ERROR, "the driver hears nothing");
    } else if (!state.silent.empty()) {
      status.summary(Level::WARN, "the driver hears a tone, no words");
    } else {
      status.summary(Level::OK, "running");
    }
    status.add("voice", state.voice.empty() ? "none" : state.voice);
    for (std::size_t i = 0; i < state.silent.size(); ++i) {
      status.add("silent_" + std::to_string(i + 1), state.silent[i]);
    }
    status.add("waiting", state.waiting);
    status.add("said", state.counters.said);
    status.add("interrupted", state.counters.interrupted);
    status.add("withdrawn", state.counters.withdrawn);
    status.add("late", state.counters.late);
    status.add("refused", state.counters.refused);
    status.add("failed", state.counters.failed);
  }

  std::unique_ptr<vehicle::Speaker> speaker_;
  ros::Subscriber subscriber_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using DriverSpeechNodelet = PartNodelet<DriverSpeechPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::DriverSpeechNodelet, nodelet::Nodelet)
