#include "web/feeds/formats/georss_feed.h"

#include "common/utc_text.h"
#include "web/feeds/feed_text.h"
#include "web/json/json.h"

namespace livemap::web {

void GeoRssFeed::Begin(const FeedHead& head, std::string& text) {
  base_ = head.base;
  text +=
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<feed xmlns=\"http://www.w3.org/2005/Atom\" "
      "xmlns:georss=\"http://www.georss.org/georss\">\n";
  AppendElement(text, "id", head.self);
  AppendElement(text, "title", head.publisher + ": hazards on the road");
  AppendElement(text, "updated", Rfc3339(head.now_ns));
  text += "<author>";
  AppendElement(text, "name", head.publisher);
  text += "</author><link rel=\"self\" type=\"application/atom+xml\" href=\"" + XmlText(head.self) +
          "\"/><generator>LiveMap</generator>\n";
}

void GeoRssFeed::Add(const FeedHazard& hazard, std::string& text) {
  const zone::Hazard& fact = hazard.hazard;
  text += "<entry>";
  AppendElement(text, "id", "urn:uuid:" + hazard.id);
  AppendElement(text, "title", hazard.Title());
  AppendElement(text, "published", Rfc3339(fact.first_seen_ns));
  AppendElement(text, "updated", Rfc3339(fact.updated_ns));
  text += "<category term=\"" + XmlText(fact.class_name) + "\" label=\"" + XmlText(hazard.label) +
          "\"/><link rel=\"alternate\" type=\"application/geo+json\" href=\"" +
          XmlText(base_ + "/api/v1/hazards/" + hazard.id) + "\"/>";
  if (!fact.image_sha256.empty()) {
    text += "<link rel=\"enclosure\" type=\"image/jpeg\" href=\"" +
            XmlText(base_ + "/images/" + fact.image_sha256) + "\"/>";
  }
  AppendElement(text, "summary",
                std::string(zone::HazardStateName(fact.state)) + ", seen " +
                    std::to_string(fact.sightings) + " times, last at " +
                    Rfc3339Seconds(fact.last_seen_ns));
  // Latitude first, as GeoRSS has it.
  text += "<georss:point>";
  AppendCoordinate(text, fact.position.latitude_deg);
  text += ' ';
  AppendCoordinate(text, fact.position.longitude_deg);
  text += "</georss:point></entry>\n";
}

bool GeoRssFeed::End(std::string& text) {
  text += "</feed>\n";
  return false;
}

}  // namespace livemap::web
