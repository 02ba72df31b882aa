// A real zone and its real web server for the browser tests and for pictures of the page. Its
// arguments, if any, are the zone's street file, a file of tiles, a folder for the store, which
// stays, the files of a certificate and its key, and a URL of PostgreSQL for the store; empty ones
// count as none. It takes one JSON command per line on standard input and answers each with one
// line of JSON:
//
//   {"do": "report", "class": C, "lat": D, "lon": D, "picture": true, "vehicle": V, "label": L}
//                                                                       -> {"id", "status",
//                                                                       "reason"}
//   {"do": "change", "class": C, "lat": D, "lon": D, "vanished": false, "vehicle": V} -> {"id"}
//   {"do": "remove", "id": UUID}                                        -> {"removed"}
//   {"do": "confirm", "id": UUID}           as an official              -> {"confirmed"}
//   {"do": "reject", "id": UUID}            as an official              -> {"rejected"}
//   {"do": "pass", "seconds": S}            the zone's clock goes on    -> {"passed"}
//   {"do": "close_decisions"}               the server starts anew without a token file
//   {"do": "accounts", "public": "all", "file": F}   the server starts anew with the accounts of
//                                           F, which gets jones (viewer), miller (official) and
//                                           root (admin) where it has none; without F those of a
//                                           new file                    -> {"password"}
//   {"do": "session", "name": NAME}         logs in without a password  -> {"name", "value"} of
//                                           the cookie
//   {"do": "orders", "recipients": [{"name": N, "kind": "webhook", "url": URL, "delay_s": S,
//    "classes": [C]}]}                      the server starts anew with work orders; what fails
//    once
//                                           is given up. Kinds and secrets are those of
//                                           test/orders/order_recipients.py; no classes: all
//   {"do": "follow", "zone": Z, "directory": F, "authority": F, "store": DIR}   the server starts
//   anew
//                                           and shows what zones around Z tell -> {"zones"}
//   {"do": "log_out_all"}                   their passwords are set again -> {"password"}
//   {"do": "fill", "count": N, "lat": D, "lon": D}                      -> {"hazards"}
//   {"do": "row", "class": C, "count": N, "lat": D, "lon": D}           hazards 20 m apart, going
//                                           north, that drivers are told of -> {"hazards"}
//   {"do": "vehicle", "id": V, "lat": D, "lon": D, "course": RAD, "speed": MPS} -> {"accepted"}
//   {"do": "answer_polls", "answer": "yes", "no" or "cant_see", "picture": true}   every vehicle
//                                           that is asked answers   -> {"answered", "frames"}
//   {"do": "stop"} / {"do": "start"}        closes the web server / opens it on the same port
//   {"do": "connections"}                                               -> {"connections"}
//   {"do": "certificate"}                   how many were taken since the server's start ->
//                                           {"loads"}
#include <atomic>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "accounts/account_store.h"
#include "common/clock.h"
#include "common/error.h"
#include "orders/desk/order_desk.h"
#include "region/neighbours.h"
#include "streets/street_file.h"
#include "test/web/zone_fixture.h"
#include "zone/service/erasure_desk.h"

namespace {

using livemap::geo::GeoPoint;
using Json = nlohmann::json;

/// A drawn road with a drawn hazard and its box, as a detector would annotate it.
std::vector<std::uint8_t> DrawnPicture(const std::string& class_name) {
  cv::Mat picture(360, 540, CV_8UC3, cv::Scalar(214, 190, 160));
  for (int y = 0; y < 170; ++y) {
    picture.row(y).setTo(cv::Scalar(236 - y / 8, 205 - y / 6, 165 - y / 5));
  }
  picture.rowRange(170, 360).setTo(cv::Scalar(96, 128, 118));
  const std::vector<cv::Point> road{{245, 170}, {295, 170}, {520, 360}, {20, 360}};
  cv::fillConvexPoly(picture, road, cv::Scalar(92, 88, 86), cv::LINE_AA);
  for (int i = 0; i < 5; ++i) {
    const int y = 180 + i * i * 9;
    cv::line(picture, {270, y}, {270, y + 4 + 5 * i}, cv::Scalar(230, 235, 238), 2 + i / 2,
             cv::LINE_AA);
  }
  const cv::Point centre(206, 270);
  cv::ellipse(picture, centre, {38, 13}, 4, 0, 360, cv::Scalar(52, 50, 50), -1, cv::LINE_AA);
  cv::ellipse(picture, centre + cv::Point(3, 3), {30, 8}, 4, 0, 360, cv::Scalar(34, 32, 33), -1,
              cv::LINE_AA);
  const cv::Scalar red(43, 50, 224);
  cv::rectangle(picture, {160, 248}, {252, 292}, red, 2, cv::LINE_AA);
  const std::string text = class_name.substr(0, 18) + " 0.87";
  cv::rectangle(picture, {160, 228}, {160 + 9 * static_cast<int>(text.size()), 248}, red, -1);
  cv::putText(picture, text, {164, 243}, cv::FONT_HERSHEY_SIMPLEX, 0.45, cv::Scalar::all(255), 1,
              cv::LINE_AA);
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", picture, file, {cv::IMWRITE_JPEG_QUALITY, 88});
  return file;
}

constexpr char kPassword[] = "correct horse battery";

class Session {
 public:
  Session(std::shared_ptr<const livemap::streets::StreetMap> streets, std::string tile_file,
          const std::string& directory, std::string certificate_file, std::string key_file,
          const std::string& store_url)
      : fixture_(std::move(streets), directory, store_url) {
    options_ = livemap::web::TestOptions();
    options_.token_file = tokens_.path();
    options_.tile_file = std::move(tile_file);
    options_.certificate_file = std::move(certificate_file);
    options_.key_file = std::move(key_file);
    options_.certificate_check_s = 0.05;
    if (!directory.empty()) {
      erasures_.emplace(directory, *fixture_.zone, livemap::SystemNs, [](const std::string&) {});
    }
    Start();
  }

  int port() const { return options_.port; }

  Json Do(const Json& command) {
    const std::string verb = command.at("do");
    if (verb == "report") return AddReport(command);
    if (verb == "change") return AddMapChange(command);
    if (verb == "remove") return Remove(command);
    if (verb == "confirm") return Confirm(command);
    if (verb == "reject") return Reject(command);
    if (verb == "pass") return Pass(command);
    if (verb == "close_decisions") return CloseDecisions();
    if (verb == "accounts") return OpenAccounts(command);
    if (verb == "session") return OpenSession(command);
    if (verb == "orders") return OpenOrders(command);
    if (verb == "follow") return Follow(command);
    if (verb == "log_out_all") return SetPasswords();
    if (verb == "fill") return Fill(command);
    if (verb == "row") return AddToldRow(command);
    if (verb == "vehicle") return MoveVehicle(command);
    if (verb == "answer_polls") return AnswerPolls(command);
    if (verb == "start") return Start();
    if (verb == "certificate") return {{"loads", server_->certificate().value().loads}};
    if (verb == "connections") return {{"connections", server_->connections()}};
    if (verb != "stop") throw livemap::Error("unknown command '" + verb + "'");
    server_.reset();
    return {{"running", false}};
  }

 private:
  Json Start() {
    server_ = std::make_unique<livemap::web::WebServer>(
        options_, *fixture_.zone, fixture_.catalogue, orders_.get(), neighbours_.get());
    options_.port = server_->port();
    return {{"running", true}};
  }

  Json Follow(const Json& command) {
    livemap::region::Neighbours::Config config;
    config.zone = command.at("zone");
    config.directory = command.at("directory");
    config.authority = command.at("authority");
    config.store = command.at("store");
    config.ask_every_s = 0.2;
    server_.reset();
    neighbours_ = std::make_unique<livemap::region::Neighbours>(
        config, *fixture_.zone, fixture_.catalogue, livemap::SystemNs, [](const std::string&) {});
    Start();
    return {{"zones", neighbours_->zones()}};
  }

  void Tick() { fixture_.now_ns = livemap::SystemNs() + ahead_ns_; }

  Json Pass(const Json& command) {
    ahead_ns_ += static_cast<std::int64_t>(command.at("seconds").get<double>() * 1e9);
    Tick();
    fixture_.zone->Advance();
    return {{"passed", true}};
  }

  Json CloseDecisions() {
    server_.reset();
    options_.token_file.clear();
    return Start();
  }

  /// A file that has accounts saves the time of hashing their passwords.
  Json OpenAccounts(const Json& command) {
    const std::map<std::string, livemap::web::PublicSees> choices{
        {"nothing", livemap::web::PublicSees::kNothing},
        {"told", livemap::web::PublicSees::kTold},
        {"all", livemap::web::PublicSees::kAll}};
    server_.reset();
    options_.public_sees = choices.at(command.at("public"));
    options_.accounts_file = command.value(
        "file", accounts_folder_.path() + "/" + std::to_string(++account_files_) + ".sqlite");
    livemap::accounts::AccountStore accounts(options_.accounts_file, {});
    if (!accounts.HasAccounts()) {
      accounts.Add("jones", livemap::accounts::Role::kViewer, kPassword, livemap::SystemNs());
      accounts.Add("miller", livemap::accounts::Role::kOfficial, kPassword, livemap::SystemNs());
      accounts.Add("root", livemap::accounts::Role::kAdmin, kPassword, livemap::SystemNs());
    }
    Start();
    return {{"password", kPassword}};
  }

  Json OpenSession(const Json& command) {
    livemap::accounts::AccountStore accounts(options_.accounts_file, {});
    return {{"name", "livemap_" + accounts.id()},
            {"value", accounts.OpenSession(command.at("name"), livemap::SystemNs())}};
  }

  Json OpenOrders(const Json& command) {
    livemap::orders::WorkOrderConfig config;
    config.give_up_s = 0;
    for (const Json& wanted : command.at("recipients")) {
      livemap::orders::Recipient recipient;
      recipient.name = wanted.at("name");
      const std::string url = wanted.at("url");
      if (wanted.at("kind") == "webhook") {
        recipient.way = livemap::orders::WebhookSender::Config{url, "top-secret-key"};
      } else {
        recipient.way =
            livemap::orders::Open311Sender::Config{url, "city.example", "open-sesame", {}, "001"};
        recipient.poll_s = 1;
      }
      livemap::orders::OrderRule rule;
      rule.recipient = recipient.name;
      rule.delay_s = wanted.value("delay_s", 0.0);
      for (const Json& name : wanted.value("classes", Json::array())) rule.classes.insert(name);
      config.recipients.push_back(std::move(recipient));
      config.rules.push_back(std::move(rule));
    }
    server_.reset();
    orders_ = std::make_unique<livemap::orders::OrderDesk>(
        config, orders_folder_.path(), *fixture_.zone, fixture_.catalogue,
        [this] { return livemap::SystemNs() + ahead_ns_.load(); }, 1,
        [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); });
    return Start();
  }

  Json SetPasswords() {
    livemap::accounts::AccountStore accounts(options_.accounts_file, {});
    for (const char* name : {"jones", "miller"}) {
      accounts.SetPassword(name, kPassword, livemap::SystemNs());
    }
    return {{"password", kPassword}};
  }

  Json Confirm(const Json& command) {
    Tick();
    const auto uuid = livemap::Uuid::Parse(command.at("id"));
    const std::string official = livemap::web::TokenFile::official();
    return {{"confirmed", uuid && fixture_.zone->Confirm(*uuid, official)}};
  }

  Json Reject(const Json& command) {
    Tick();
    const auto uuid = livemap::Uuid::Parse(command.at("id"));
    const std::string official = livemap::web::TokenFile::official();
    return {{"rejected", uuid && fixture_.zone->Reject(*uuid, official, "test")}};
  }

  Json AddReport(const Json& command) {
    Tick();
    auto report = fixture_.MakeReport(command.at("class"), {command.at("lat"), command.at("lon")});
    report.vehicle_id = command.value("vehicle", report.vehicle_id);
    if (command.value("picture", true)) {
      report.image_format = "jpeg";
      report.image = DrawnPicture(command.value("label", report.class_name));
    }
    const livemap::protocol::Receipt receipt = fixture_.zone->Handle(report);
    const bool committed = receipt.status == livemap::protocol::Receipt::Status::kCommitted;
    return {{"id", receipt.hazard_uuid.ToString()},
            {"status", committed ? "committed" : "refused"},
            {"reason", receipt.reason}};
  }

  Json AddMapChange(const Json& command) {
    Tick();
    auto report =
        fixture_.MakeMapChange(command.at("class"), {command.at("lat"), command.at("lon")});
    report.vehicle_id = command.value("vehicle", report.vehicle_id);
    report.vanished = command.value("vanished", false);
    const livemap::protocol::Receipt receipt = fixture_.zone->HandleMapChanges({report}).at(0);
    if (!receipt.reason.empty()) throw livemap::Error(receipt.reason);
    return {{"id", receipt.hazard_uuid.ToString()}};
  }

  Json Remove(const Json& command) {
    Tick();
    const auto uuid = livemap::Uuid::Parse(command.at("id"));
    return {{"removed", uuid && fixture_.zone->Remove(*uuid, "test")}};
  }

  /// Hazards along a lattice of streets about 150 m apart.
  Json Fill(const Json& command) {
    Tick();
    const GeoPoint corner{command.at("lat"), command.at("lon")};
    const std::vector<const char*> classes{"pothole", "pothole",        "pothole", "traffic_cone",
                                           "debris",  "road_work_sign", "barrier"};
    std::mt19937 random(11);
    const std::size_t count = command.at("count");
    // Streets cross, so some of these merge: goes on until there are as many as asked for.
    for (int i = 0; fixture_.zone->Statistics().active_hazards < count;) {
      const std::size_t missing = count - fixture_.zone->Statistics().active_hazards;
      std::vector<livemap::protocol::Report> reports;
      for (std::size_t k = 0; k < missing; ++k, ++i) {
        const double along = 0.00011 * (i / 60) + 1e-5 * std::uniform_real_distribution<>()(random);
        const double across = 0.0018 * (i % 30);
        const bool east = i % 60 < 30;
        const double longitude = corner.longitude_deg + (east ? along * 1.31 : across);
        const GeoPoint position{corner.latitude_deg + (east ? across * 0.76 : along),
                                longitude < 180 ? longitude : longitude - 360};
        auto report = fixture_.MakeReport(classes[random() % classes.size()], position);
        report.confidence = 0.5F + 0.49F * std::uniform_real_distribution<float>()(random);
        reports.push_back(report);
      }
      fixture_.zone->HandleBatch(reports);
    }
    return {{"hazards", fixture_.zone->Statistics().active_hazards}};
  }

  /// Two vehicles tell of each, and no vehicle of so many that they count no more.
  Json AddToldRow(const Json& command) {
    Tick();
    for (const char* vehicle : {"first-", "second-"}) {
      std::vector<livemap::protocol::Report> reports;
      for (int i = 0; i < command.at("count").get<int>(); ++i) {
        auto report = fixture_.MakeReport(
            command.at("class"),
            {command.at("lat").get<double>() + 0.00018 * i, command.at("lon").get<double>()});
        report.vehicle_id = vehicle + std::to_string(i / 50);
        reports.push_back(std::move(report));
      }
      fixture_.zone->HandleBatch(reports);
    }
    return {{"hazards", fixture_.zone->Statistics().active_hazards}};
  }

  Json MoveVehicle(const Json& command) {
    // As far apart that each position is told.
    ahead_ns_ += livemap::zone::VehicleTable::kTellNs;
    Tick();
    livemap::zone::VehicleState vehicle;
    vehicle.vehicle_id = command.at("id");
    vehicle.position = {command.at("lat"), command.at("lon")};
    vehicle.course_rad = command.at("course");
    vehicle.speed_mps = command.at("speed");
    vehicle.stamp_ns = fixture_.now_ns;
    return {{"accepted", fixture_.zone->UpdateVehicle(vehicle)}};
  }

  /// With a picture where one is wanted; `frames` counts those that were to show the whole frame.
  Json AnswerPolls(const Json& command) {
    using livemap::protocol::PollAnswer;
    using livemap::protocol::PollPicture;
    const std::map<std::string, PollAnswer::Answer> kinds{
        {"yes", PollAnswer::Answer::kYes},
        {"no", PollAnswer::Answer::kNo},
        {"cant_see", PollAnswer::Answer::kCantSee}};
    Tick();
    int answered = 0, frames = 0;
    for (const livemap::protocol::Poll& poll : fixture_.zone->TakeDuePolls()) {
      PollAnswer answer;
      answer.poll = poll.poll;
      answer.hazard = poll.hazard;
      answer.vehicle_id = poll.vehicle_id;
      answer.drive_id = "drive-1";
      answer.stamp_ns = fixture_.now_ns;
      answer.answer = kinds.at(command.value("answer", "yes"));
      answer.confidence = 0.9F;
      answer.vehicle_position = fixture_.zone->Vehicles().at(0).position;
      if (command.value("picture", true) && poll.picture != PollPicture::kNone) {
        answer.image_format = "jpeg";
        answer.image = DrawnPicture("whole frame");
      }
      frames += poll.picture == PollPicture::kFullFrame ? 1 : 0;
      answered += fixture_.zone->HandleAnswer(answer) ? 1 : 0;
    }
    return {{"answered", answered}, {"frames", frames}};
  }

  livemap::web::TokenFile tokens_;
  livemap::web::ZoneFixture fixture_;
  std::atomic<std::int64_t> ahead_ns_{0};  ///< Of the zone's clock before the system's.
  livemap::web::TemporaryFolder accounts_folder_;
  int account_files_ = 0;
  livemap::web::TemporaryFolder orders_folder_;
  livemap::web::WebConfig options_;
  std::optional<livemap::zone::ErasureDesk> erasures_;
  std::unique_ptr<livemap::orders::OrderDesk> orders_;       ///< Null: the zone has no work orders.
  std::unique_ptr<livemap::region::Neighbours> neighbours_;  ///< Null: it follows no other zone.
  std::unique_ptr<livemap::web::WebServer> server_;
};

}  // namespace

int main(int argc, char** argv) {
  try {
    std::shared_ptr<const livemap::streets::StreetMap> streets;
    if (argc > 1 && *argv[1] != '\0') {
      streets = std::make_shared<const livemap::streets::StreetMap>(
          livemap::streets::ReadStreetFile(argv[1]));
    }
    const auto argument = [&](int i) { return std::string(argc > i ? argv[i] : ""); };
    Session session(std::move(streets), argument(2), argument(3), argument(4), argument(5),
                    argument(6));
    std::cout << Json{{"port", session.port()},
                      {"token", livemap::web::TokenFile::token()},
                      {"region_token", livemap::web::TokenFile::region_token()}}
              << std::endl;
    std::string line;
    while (std::getline(std::cin, line)) {
      std::cout << session.Do(Json::parse(line)) << std::endl;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "map_page_server: %s\n", error.what());
    return 1;
  }
  return 0;
}
