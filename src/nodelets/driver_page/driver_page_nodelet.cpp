#include <diagnostic_msgs/DiagnosticArray.h>
#include <livemap/HazardAlert.h>
#include <ros/package.h>
#include <sensor_msgs/NavSatFix.h>

#include <boost/asio/ip/address.hpp>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

#include "nodelets/diagnostics.h"
#include "nodelets/driver_page/driver_page_state.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/alert_conversions.h"
#include "ros/parameters/driver_page_parameters.h"
#include "web/driver/driver_site.h"
#include "web/server/http_server.h"

namespace livemap::nodelets {

/// Serves the in-car page: DriverPageState with topics, DriverSite and a web server. All callbacks
/// run one at a time, in the nodelet's own queue.
class DriverPagePart : public NodeletPart {
 public:
  ~DriverPagePart() override {
    diagnostics_.reset();
    subscribers_.clear();
    timer_.stop();
    if (site_) site_->Stop();
    server_.reset();
  }

 private:
  void Initialize() override {
    using Self = DriverPagePart;
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadDriverPageConfig(parameters);
    const std::string package = ros::package::getPath("livemap");
    if (config_.catalogue.empty()) config_.catalogue = package + "/config/hazards.yaml";
    if (config_.web_root.empty()) config_.web_root = package + "/web";
    state_ = std::make_unique<DriverPageState>(config_);
    Serve();
    ros::NodeHandle& node = getNodeHandle();
    subscribers_ = {
        node.subscribe("hazard/alert", 100, &Self::OnAlert, this),
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("/diagnostics", 100, &Self::OnDiagnostics, this),
    };
    timer_ = node.createSteadyTimer(ros::WallDuration(config_.period_s),
                                    [this](const ros::SteadyTimerEvent&) { Publish(); });
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "driver_page", "driver_page", config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void Serve() {
    web::DriverSite::Config site;
    site.web_root = config_.web_root;
    boost::system::error_code failure;
    const auto address = boost::asio::ip::make_address(config_.bind, failure);
    site.only_local = failure || address.is_loopback();
    site_ =
        std::make_unique<web::DriverSite>(site, protocol::HazardCatalogue::Load(config_.catalogue));
    web::WebConfig server;
    server.address = config_.bind;
    server.port = config_.port;
    server.threads = 1;
    server.max_connections = 32;
    server.max_connections_per_client = 16;
    server_ = std::make_unique<web::HttpServer>(server, *site_, nullptr);
    NODELET_INFO("the in-car page is at http://%s:%d/", config_.bind.c_str(), server_->port());
  }

  void OnAlert(const HazardAlert& message) {
    try {
      state_->Take(ros_io::FromMessage(message), SteadyS());
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped an alert: %s", error.what());
    }
    Publish();
  }

  void OnFix(const sensor_msgs::NavSatFix& message) { state_->Take(message, SteadyS()); }

  void OnDiagnostics(const diagnostic_msgs::DiagnosticArray& message) {
    state_->Take(message, SteadyS());
  }

  void Publish() { site_->Publish(state_->At(SteadyS())); }

  void Diagnose(Diagnostics::Status& status) const {
    const web::HttpServer::Counters counters = server_->counters();
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    status.add("address", "http://" + config_.bind + ":" + std::to_string(server_->port()) + "/");
    status.add("connections", server_->connections());
    status.add("connections_ended", counters.connections_ended);
    status.add("connections_refused", counters.connections_refused);
  }

  ros_io::DriverPageConfig config_;
  std::unique_ptr<DriverPageState> state_;
  std::unique_ptr<web::DriverSite> site_;
  std::unique_ptr<web::HttpServer> server_;
  std::vector<ros::Subscriber> subscribers_;
  ros::SteadyTimer timer_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using DriverPageNodelet = PartNodelet<DriverPagePart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::DriverPageNodelet, nodelet::Nodelet)
