#pragma once

#include <map>
#include <memory>
#include <string>

#include "test/transport/broker_process.h"
#include "transport/mqtt_client.h"

namespace livemap::transport {

/// Which broker the contract of docs/reference/broker.md is tested on.
enum class BrokerKind {
  kMosquitto,  ///< Debian's, as `livemap zone init` configures it.
  kEjabberd,   ///< Debian's, with config/ejabberd.yml.
  kAddressed   ///< One that runs somewhere; ContractBroker::Addressed tells of it.
};

/// "mosquitto", "ejabberd" or "addressed".
std::string NameOf(BrokerKind kind);

/// Whether the environment names a broker, so that no other one is tested.
bool IsBrokerAddressed();

/// False for ejabberd where its package is not. LiveMap's development does not bring it: its
/// package starts a chat server that listens on all addresses.
bool IsBrokerInstalled(BrokerKind kind);

/// A real broker of the zone "demo" and the certificates of its clients: "zone", the vehicles
/// "1001" and "1002", "1003", which is revoked, and "car-1", whose name has letters. "stranger" has
/// a certificate of another authority, with the name "1001".
///
/// The environment names the addressed one: LIVEMAP_TEST_BROKER is HOST:PORT, or several of them
/// with commas between, of a cluster. The zone logs in at the first one and vehicles at the last.
/// LIVEMAP_TEST_BROKER_IDENTITY is a folder as `livemap zone init` and `enroll` make it, with the
/// folder of 1003 still there. LIVEMAP_TEST_BROKER_LACKS names the tests, with commas between, of
/// what this broker is known to lack: TEST=FAULT, or TEST where it has the fault of ejabberd.
class ContractBroker {
 public:
  /// Makes certificates and starts the broker. Throws Error when it does not start, or when the
  /// environment does not say what the addressed one needs.
  explicit ContractBroker(BrokerKind kind);

  /// The certificate of `owner`, as user and client id `name`; a login that keeps no session.
  MqttConfig Login(const std::string& name, const std::string& owner) const;
  MqttConfig Login(const std::string& name) const { return Login(name, name); }

  /// The fault by which this broker is known not to hold the test of this name, in the test's
  /// words; empty: it is known to hold it.
  std::string KnownFault(const std::string& test) const {
    const auto fault = known_faults_.find(test);
    return fault == known_faults_.end() ? "" : fault->second;
  }

 private:
  void RunZoneIdentity(const std::string& arguments) const;
  void MakeIdentities();
  void StartMosquitto();
  void StartEjabberd();
  void FindAddressed();
  std::string Folder(const std::string& owner) const;

  const TemporaryDirectory directory_;
  std::string identity_ = directory_.path() + "/identity";
  MqttAddress zone_address_{"127.0.0.1", 0};
  MqttAddress vehicle_address_{"127.0.0.1", 0};
  std::map<std::string, std::string> known_faults_;  ///< By the name of the test.
  ChildProcess process_;
};

}  // namespace livemap::transport
