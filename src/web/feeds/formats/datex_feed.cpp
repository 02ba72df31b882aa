#include "web/feeds/formats/datex_feed.h"

#include "common/utc_text.h"
#include "web/feeds/feed_text.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

/// How sure the zone is, in the words of ProbabilityOfOccurrenceEnum.
const char* ProbabilityWord(const zone::Hazard& hazard) {
  if (hazard.presence >= 0.9F) return "certain";
  return hazard.presence >= 0.5F ? "probable" : "riskOf";
}

const char* RecordType(SrtiKind kind) {
  switch (kind) {
    case SrtiKind::kAnimal:
      return "sit:AnimalPresenceObstruction";
    case SrtiKind::kRoadworks:
      return "sit:MaintenanceWorks";
    case SrtiKind::kObstacle:
    case SrtiKind::kAccident:
    case SrtiKind::kNone:
      break;
  }
  return "sit:GeneralObstruction";
}

/// What the record's own type adds to a situation record.
void AppendDetails(const FeedCodes& codes, std::string& xml) {
  switch (codes.srti) {
    case SrtiKind::kAnimal:
      return AppendElement(xml, "sit:animalPresenceType", codes.datex_type);
    case SrtiKind::kRoadworks:
      AppendElement(xml, "sit:roadworksDurationClassification", "shortTerm");
      return AppendElement(xml, "sit:roadMaintenanceType", codes.datex_type);
    case SrtiKind::kObstacle:
    case SrtiKind::kAccident:
    case SrtiKind::kNone:
      break;
  }
  AppendElement(xml, "sit:obstructionType", codes.datex_type);
}

void AppendPointLocation(const geo::GeoPoint& position, std::string& xml) {
  xml +=
      "<sit:locationReference xsi:type=\"loc:PointLocation\"><loc:pointByCoordinates>"
      "<loc:pointCoordinates><loc:latitude>";
  AppendCoordinate(xml, position.latitude_deg);
  xml += "</loc:latitude><loc:longitude>";
  AppendCoordinate(xml, position.longitude_deg);
  xml += "</loc:longitude></loc:pointCoordinates></loc:pointByCoordinates></sit:locationReference>";
}

}  // namespace

void DatexFeed::Begin(const FeedHead& head, std::string& text) {
  text +=
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<d2:payload xmlns:d2=\"http://datex2.eu/schema/3/d2Payload\""
      " xmlns:com=\"http://datex2.eu/schema/3/common\""
      " xmlns:loc=\"http://datex2.eu/schema/3/locationReferencing\""
      " xmlns:sit=\"http://datex2.eu/schema/3/situation\""
      " xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\""
      " xsi:type=\"sit:SituationPublication\" lang=\"en\" modelBaseVersion=\"3\">\n";
  AppendElement(text, "com:publicationTime", Rfc3339(head.now_ns));
  text += "<com:publicationCreator>";
  AppendElement(text, "com:country", head.country);
  AppendElement(text, "com:nationalIdentifier", head.publisher);
  text += "</com:publicationCreator>\n";
}

void DatexFeed::Add(const FeedHazard& hazard, std::string& text) {
  if (hazard.codes.srti == SrtiKind::kNone) return;
  const zone::Hazard& fact = hazard.hazard;
  text += "<sit:situation id=\"" + hazard.id + "\">";
  AppendElement(text, "sit:situationVersionTime", Rfc3339(fact.updated_ns));
  text += "<sit:headerInformation>";
  AppendElement(text, "com:confidentiality", "noRestriction");
  AppendElement(text, "com:informationStatus", "real");
  text += std::string("</sit:headerInformation><sit:situationRecord xsi:type=\"") +
          RecordType(hazard.codes.srti) + "\" id=\"" + hazard.id + "-1\" version=\"" +
          std::to_string(fact.sequence) + "\">";
  AppendElement(text, "sit:situationRecordCreationTime", Rfc3339(fact.first_seen_ns));
  AppendElement(text, "sit:situationRecordObservationTime", Rfc3339(fact.last_seen_ns));
  AppendElement(text, "sit:situationRecordVersionTime", Rfc3339(fact.updated_ns));
  AppendElement(text, "sit:probabilityOfOccurrence", ProbabilityWord(fact));
  AppendElement(text, "sit:safetyRelatedMessage", "true");
  text += "<sit:validity>";
  AppendElement(text, "com:validityStatus", "active");
  text += "<com:validityTimeSpecification>";
  AppendElement(text, "com:overallStartTime", Rfc3339(fact.first_seen_ns));
  AppendElement(text, "com:overallEndTime", Rfc3339(hazard.ends_ns));
  text +=
      "</com:validityTimeSpecification></sit:validity><sit:generalPublicComment><sit:comment>"
      "<com:values><com:value lang=\"en\">" +
      XmlText(hazard.Title()) + "</com:value></com:values></sit:comment>";
  AppendElement(text, "sit:commentType", "description");
  text += "</sit:generalPublicComment>";
  AppendPointLocation(fact.position, text);
  AppendDetails(hazard.codes, text);
  text += "</sit:situationRecord></sit:situation>\n";
}

bool DatexFeed::End(std::string& text) {
  text += "</d2:payload>\n";
  return false;
}

}  // namespace livemap::web
