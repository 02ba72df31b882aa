#include "web/feeds/formats/csv_feed.h"

#include "common/utc_text.h"
#include "web/feeds/feed_text.h"
#include "web/json/json.h"

namespace livemap::web {

void CsvFeed::Begin(const FeedHead& head, std::string& text) {
  base_ = head.base;
  text +=
      "id,class,label,state,presence,confidence,latitude,longitude,position_sigma_m,sightings,"
      "vehicles,first_seen,last_seen,updated,street,near,direction,image,sequence\r\n";
}

void CsvFeed::Add(const FeedHazard& hazard, std::string& text) {
  const zone::Hazard& fact = hazard.hazard;
  text += hazard.id + ',' + CsvText(fact.class_name) + ',' + CsvText(hazard.label) + ',' +
          zone::HazardStateName(fact.state) + ',';
  AppendFixed(text, static_cast<double>(fact.presence), 4);
  text += ',';
  AppendFixed(text, static_cast<double>(fact.confidence), 4);
  text += ',';
  AppendCoordinate(text, fact.position.latitude_deg);
  text += ',';
  AppendCoordinate(text, fact.position.longitude_deg);
  const Json sigma = PositionSigma(fact.covariance_m2);
  text += ',' + (sigma.is_null() ? "" : sigma.dump()) + ',' + std::to_string(fact.sightings) + ',' +
          std::to_string(fact.vehicles) + ',' + Rfc3339(fact.first_seen_ns) + ',' +
          Rfc3339(fact.last_seen_ns) + ',' + Rfc3339(fact.updated_ns) + ',' +
          CsvText(hazard.words.street) + ',' + CsvText(hazard.words.near) + ',' +
          CsvText(hazard.words.direction) + ',';
  if (!fact.image_sha256.empty()) text += CsvText(base_ + "/images/" + fact.image_sha256);
  text += ',' + std::to_string(fact.sequence) + "\r\n";
}

bool CsvFeed::End(std::string& /*text*/) { return false; }

}  // namespace livemap::web
