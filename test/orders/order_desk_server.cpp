// A real zone with its work orders, to be killed: it takes a command per line on standard input and
// answers each with a line on standard output.
//
//   order_desk_server DIRECTORY WORK_ORDERS_FILE
//
//   new LATITUDE LONGITUDE   a vehicle reports a pothole, an official confirms it -> its id
//   state HAZARD             -> its state
//   orders                   -> a JSON list of all orders
//   close ORDER              as an official -> true or false
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "common/clock.h"
#include "common/error.h"
#include "orders/desk/order_desk.h"

namespace {

using livemap::Uuid;
using livemap::geo::GeoPoint;
using livemap::orders::Order;
using livemap::orders::OrderDesk;
using livemap::zone::ZoneService;

Uuid AddConfirmed(ZoneService& zone, const GeoPoint& position) {
  static auto generator = livemap::EntropySeededGenerator();
  livemap::protocol::Report report;
  report.uuid = Uuid::Random(generator);
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = livemap::SystemNs();
  report.class_name = "pothole";
  report.confidence = 0.8F;
  report.box = {10, 20, 110, 90};
  report.position = position;
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = 640;
  report.image_height = 480;
  const Uuid hazard = zone.Handle(report).hazard_uuid;
  zone.Confirm(hazard, "miller");
  return hazard;
}

std::string OrdersText(const OrderDesk& desk) {
  nlohmann::json list = nlohmann::json::array();
  for (const Order& order : desk.List({UINT64_MAX, 1000, {}, {}, {}})) {
    list.push_back({{"id", order.uuid.ToString()},
                    {"recipient", order.recipient},
                    {"state", OrderStateName(order.state)},
                    {"hazard", order.content.hazard.ToString()},
                    {"attempts", order.attempts},
                    {"reference", order.reference},
                    {"error", order.error}});
  }
  return list.dump();
}

std::string Answer(ZoneService& zone, OrderDesk& desk, const std::string& line) {
  std::istringstream words(line);
  std::string command;
  std::string id;
  words >> command;
  if (command == "new") {
    GeoPoint position;
    words >> position.latitude_deg >> position.longitude_deg;
    return AddConfirmed(zone, position).ToString();
  }
  if (command == "orders") return OrdersText(desk);
  words >> id;
  const Uuid uuid = Uuid::Parse(id).value_or(Uuid{});
  if (command == "close") return desk.Close(uuid, "miller") ? "true" : "false";
  return livemap::zone::HazardStateName(zone.Find(uuid)->state);
}

void Serve(const std::string& directory, const std::string& file) {
  ZoneService::Config config;
  config.directory = directory;
  config.speed.max_speed_mps = 1e9;
  const auto seed = livemap::EntropySeededGenerator()();
  ZoneService zone(config, livemap::SystemNs, seed);
  OrderDesk desk(livemap::orders::ReadWorkOrderFile(file), directory, zone, config.catalogue,
                 livemap::SystemNs, seed,
                 [](const std::string& line) { std::cerr << line << std::endl; });
  std::cout << "ready" << std::endl;
  for (std::string line; std::getline(std::cin, line);) {
    std::cout << Answer(zone, desk, line) << std::endl;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    Serve(argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "order_desk_server: " << error.what() << std::endl;
    return 1;
  }
}
