#include "web/feeds/formats/gpx_feed.h"

#include "common/utc_text.h"
#include "web/feeds/feed_text.h"

namespace livemap::web {

void GpxFeed::Begin(const FeedHead& head, std::string& text) {
  text +=
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<gpx version=\"1.1\" creator=\"LiveMap\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n"
      "<metadata>";
  AppendElement(text, "name", head.publisher);
  text += "<link href=\"" + XmlText(head.self) + "\"/>";
  AppendElement(text, "time", Rfc3339Seconds(head.now_ns));
  text += "</metadata>\n";
}

void GpxFeed::Add(const FeedHazard& hazard, std::string& text) {
  text += "<wpt lat=\"";
  AppendCoordinate(text, hazard.hazard.position.latitude_deg);
  text += "\" lon=\"";
  AppendCoordinate(text, hazard.hazard.position.longitude_deg);
  text += "\">";
  AppendElement(text, "time", Rfc3339Seconds(hazard.hazard.last_seen_ns));
  AppendElement(text, "name", hazard.label);
  const std::string place = hazard.Place();
  if (!place.empty()) AppendElement(text, "desc", place);
  AppendElement(text, "type", hazard.hazard.class_name);
  text += "</wpt>\n";
}

bool GpxFeed::End(std::string& text) {
  text += "</gpx>\n";
  return false;
}

}  // namespace livemap::web
