#include "test/transport/contract_broker.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "common/comma_list.h"
#include "common/error.h"

namespace livemap::transport {
namespace {

constexpr std::size_t kMostConfigurationBytes = 1 << 20;
// The largest message of the contract: a zone directory.
constexpr int kLargestMessageBytes = 2064 << 10;

std::string FromEnvironment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

MqttAddress ParseTestAddress(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const int port = colon == std::string::npos ? 0 : std::atoi(text.c_str() + colon + 1);
  if (port <= 0) throw Error("LIVEMAP_TEST_BROKER has '" + text + "', accepted is HOST:PORT");
  return {text.substr(0, colon), port};
}

/// What docs/reference/broker.md says that ejabberd lacks: the test and what it finds.
const std::map<std::string, std::string>& FaultsOfEjabberd() {
  static const std::map<std::string, std::string> faults = {
      {"SaysNotAuthorized", "it said reason 144"},
      {"RetainsNothing", "a later subscriber heard 'left\n'"},
      {"RefusesWhatIsTooLargeAndKeepsTheConnection", "it ended the connection"},
      {"RefusesTheLoginOfARevokedVehicle", "it let the vehicle in"},
      {"EndsTheFirstLoginOfAName", "two clients were in under one name"},
      {"TakesANameAsItIsWritten", "it took it for the vehicle's own"},
      {"TakesNamesWithLetters", "it said reason 144"}};
  return faults;
}

/// An entry of LIVEMAP_TEST_BROKER_LACKS: the test and its fault.
std::pair<std::string, std::string> ParseLack(const std::string& text) {
  const std::size_t equals = std::min(text.find('='), text.size());
  const std::string test = text.substr(0, equals);
  if (equals + 1 < text.size()) return {test, text.substr(equals + 1)};
  const auto known = FaultsOfEjabberd().find(test);
  if (known == FaultsOfEjabberd().end()) {
    throw Error("LIVEMAP_TEST_BROKER_LACKS has '" + text +
                "', accepted is TEST=FAULT, or TEST alone where ejabberd has that fault");
  }
  return *known;
}

/// Every occurrence; a configuration that lost what the test sets would run unnoticed otherwise.
void ReplaceInConfiguration(std::string& text, const std::string& from, const std::string& to) {
  std::size_t found = text.find(from);
  if (found == std::string::npos) throw Error("config/ejabberd.yml has no '" + from + "'");
  for (; found != std::string::npos; found = text.find(from, found + to.size())) {
    text.replace(found, from.size(), to);
  }
}

}  // namespace

std::string NameOf(BrokerKind kind) {
  if (kind == BrokerKind::kMosquitto) return "mosquitto";
  return kind == BrokerKind::kEjabberd ? "ejabberd" : "addressed";
}

bool IsBrokerInstalled(BrokerKind kind) {
  return kind != BrokerKind::kEjabberd || std::filesystem::exists("/usr/sbin/ejabberdctl");
}

bool IsBrokerAddressed() { return !FromEnvironment("LIVEMAP_TEST_BROKER").empty(); }

ContractBroker::ContractBroker(BrokerKind kind) {
  zone_address_.port = vehicle_address_.port = FreePort();
  if (kind == BrokerKind::kAddressed) {
    FindAddressed();
  } else {
    MakeIdentities();
  }
  RunZoneIdentity("init " + directory_.path() + "/other_authority");
  RunZoneIdentity("enroll 1001 --dir " + directory_.path() + "/other_authority");
  if (kind == BrokerKind::kMosquitto) StartMosquitto();
  if (kind == BrokerKind::kEjabberd) StartEjabberd();
}

void ContractBroker::RunZoneIdentity(const std::string& arguments) const {
  const std::string log = directory_.path() + "/identity.log";
  const std::string command = "/usr/bin/python3 " + std::string(LIVEMAP_SOURCE_DIR) +
                              "/scripts/livemap_zone_identity " + arguments + " > " + log + " 2>&1";
  if (std::system(command.c_str()) != 0) {
    throw Error("'livemap zone " + arguments + "' failed: " + ReadFile(log, 1 << 20));
  }
}

void ContractBroker::MakeIdentities() {
  RunZoneIdentity("init " + identity_ + " --zone demo --port " +
                  std::to_string(zone_address_.port) + " --max-message-bytes " +
                  std::to_string(kLargestMessageBytes));
  for (const char* vehicle : {"1001", "1002", "1003", "car-1"}) {
    RunZoneIdentity("enroll " + std::string(vehicle) + " --dir " + identity_);
  }
  // Revoking deletes the zone's copy of it; the vehicle keeps its own.
  const std::string vehicles = identity_ + "/vehicles/";
  std::filesystem::copy(vehicles + "1003", vehicles + "kept");
  RunZoneIdentity("revoke 1003 --dir " + identity_);
  std::filesystem::rename(vehicles + "kept", vehicles + "1003");
}

void ContractBroker::StartMosquitto() {
  process_.Start({"mosquitto", "-c", identity_ + "/mosquitto.conf"}, zone_address_.port,
                 directory_.path() + "/broker.log");
}

void ContractBroker::StartEjabberd() {
  known_faults_ = FaultsOfEjabberd();
  std::string configuration =
      ReadFile(std::string(LIVEMAP_SOURCE_DIR) + "/config/ejabberd.yml", kMostConfigurationBytes);
  ReplaceInConfiguration(configuration, "/etc/ejabberd/livemap", identity_ + "/broker");
  ReplaceInConfiguration(configuration, "port: 8883",
                         "port: " + std::to_string(zone_address_.port));
  ReplaceInConfiguration(configuration, "0.0.0.0", "127.0.0.1");
  ReplaceInConfiguration(configuration, "nobody@localhost", "1003@localhost");
  const std::string folder = directory_.path();
  std::ofstream(folder + "/ejabberd.yml") << configuration;
  // As ejabberdctl starts it, but as whoever runs the test, and without a node name: alone it needs
  // no port mapper (epmd), which would stay behind.
  std::ofstream(folder + "/start")
      << "eval \"$(grep ^ERL_LIBS= /usr/sbin/ejabberdctl)\"\n"
      << "export ERL_LIBS HOME=" << folder << " EJABBERD_CONFIG_PATH=" << folder << "/ejabberd.yml"
      << " EJABBERD_LOG_PATH=" << folder << "/ejabberd.log\n"
      << "exec erl -noinput +sbwt none -mnesia dir '\"" << folder << "/mnesia\"' -s ejabberd\n";
  // It computes for seconds, which are minutes on a machine that compiles meanwhile.
  process_.Start({"sh", folder + "/start"}, zone_address_.port, folder + "/broker.log",
                 std::chrono::seconds(300));
}

void ContractBroker::FindAddressed() {
  const std::vector<std::string> addresses = SplitAtCommas(FromEnvironment("LIVEMAP_TEST_BROKER"));
  zone_address_ = ParseTestAddress(addresses.front());
  vehicle_address_ = ParseTestAddress(addresses.back());
  identity_ = FromEnvironment("LIVEMAP_TEST_BROKER_IDENTITY");
  if (!std::filesystem::is_directory(identity_ + "/zone")) {
    throw Error("LIVEMAP_TEST_BROKER_IDENTITY is '" + identity_ +
                "', accepted is a folder that `livemap zone init` made");
  }
  for (const std::string& lack : SplitAtCommas(FromEnvironment("LIVEMAP_TEST_BROKER_LACKS"))) {
    known_faults_.insert(ParseLack(lack));
  }
}

std::string ContractBroker::Folder(const std::string& owner) const {
  if (owner == "zone") return identity_ + "/zone/";
  if (owner == "stranger") return directory_.path() + "/other_authority/vehicles/1001/";
  return identity_ + "/vehicles/" + owner + "/";
}

MqttConfig ContractBroker::Login(const std::string& name, const std::string& owner) const {
  const MqttAddress& address = name == "zone" ? zone_address_ : vehicle_address_;
  MqttConfig config;
  config.host = address.host;
  config.port = address.port;
  config.client_id = name;
  config.user = name;
  config.clean_start = true;
  config.session_expiry_s = 0;
  config.max_packet_bytes = kLargestMessageBytes + 4096;
  // Nobody who was thrown out comes back during a test.
  config.reconnect_min_s = 600;
  config.reconnect_max_s = 600;
  const std::string folder = Folder(owner);
  // The stranger trusts the broker; the broker does not trust it.
  config.tls = MqttTlsConfig{(owner == "stranger" ? Folder("zone") : folder) + "ca.pem",
                             folder + "certificate.pem", folder + "key.pem"};
  return config;
}

}  // namespace livemap::transport
