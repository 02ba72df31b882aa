#include "web/ogc/ogc_document.h"

#include <utility>

#include "web/ogc/ogc_query.h"

namespace livemap::web {
namespace {

constexpr const char* kJsonType = "application/json";
constexpr const char* kGeoJsonType = "application/geo+json";
constexpr const char* kCrs84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84";

Json SchemaReference(const std::string& name) { return {{"$ref", "#/components/schemas/" + name}}; }

Json ParameterReference(const std::string& name) {
  return {{"$ref", "#/components/parameters/" + name}};
}

Json JsonContent(const std::string& description, const char* type, Json schema) {
  Json response;
  response["description"] = description;
  response["content"][type]["schema"] = std::move(schema);
  return response;
}

/// A GET that answers with that schema.
Json GetOperation(const std::string& id, const std::string& summary, const char* type,
                  const std::string& schema, Json parameters) {
  Json operation;
  operation["summary"] = summary;
  operation["operationId"] = id;
  if (!parameters.empty()) operation["parameters"] = std::move(parameters);
  operation["responses"]["200"] = JsonContent(summary, type, SchemaReference(schema));
  operation["responses"]["400"] = {{"$ref", "#/components/responses/refused"}};
  operation["responses"]["404"] = {{"$ref", "#/components/responses/refused"}};
  return {{"get", std::move(operation)}};
}

Json QueryParameter(const std::string& name, const std::string& description, Json schema) {
  Json parameter;
  parameter["name"] = name;
  parameter["in"] = "query";
  parameter["description"] = description;
  parameter["required"] = false;
  parameter["schema"] = std::move(schema);
  parameter["style"] = "form";
  parameter["explode"] = false;
  return parameter;
}

Json PathParameter(const std::string& name, const std::string& description, Json schema) {
  Json parameter;
  parameter["name"] = name;
  parameter["in"] = "path";
  parameter["description"] = description;
  parameter["required"] = true;
  parameter["schema"] = std::move(schema);
  return parameter;
}

Json OpenApiParameters(const std::vector<OgcCollection>& collections) {
  Json ids = Json::array();
  for (const OgcCollection& collection : collections) ids.push_back(collection.id);
  // Empty is no enum.
  Json id_schema = {{"type", "string"}};
  if (!ids.empty()) id_schema["enum"] = std::move(ids);
  const Json corners =
      Json::array({{{"minItems", 4}, {"maxItems", 4}}, {{"minItems", 6}, {"maxItems", 6}}});
  Json parameters;
  parameters["collectionId"] =
      PathParameter("collectionId", "id of a collection", std::move(id_schema));
  parameters["featureId"] = PathParameter("featureId", "id of a feature", {{"type", "string"}});
  parameters["bbox"] = QueryParameter(
      "bbox",
      "Only features inside minLon,minLat,maxLon,maxLat in degrees (CRS84), or six numbers of "
      "which the heights do not count; minLon > maxLon crosses the antimeridian.",
      {{"type", "array"}, {"oneOf", corners}, {"items", {{"type", "number"}}}});
  parameters["datetime"] = QueryParameter(
      "datetime",
      "Only features that were seen at that time (RFC 3339) or in that interval: TIME, TIME/TIME, "
      "TIME/.., ../TIME. From the first to the last sighting counts.",
      {{"type", "string"}});
  parameters["limit"] = QueryParameter("limit", "At most so many features.",
                                       {{"type", "integer"},
                                        {"minimum", 1},
                                        {"maximum", kMaxOgcItems},
                                        {"default", OgcQuery().limit}});
  parameters["cursor"] = QueryParameter("cursor", "As links to next pages have it.",
                                        {{"type", "integer"}, {"minimum", 0}});
  return parameters;
}

Json ObjectSchema(Json required, Json properties) {
  Json schema;
  schema["type"] = "object";
  schema["required"] = std::move(required);
  schema["properties"] = std::move(properties);
  return schema;
}

Json ArrayOf(Json items) { return {{"type", "array"}, {"items", std::move(items)}}; }

Json OpenApiSchemas() {
  const Json text{{"type", "string"}};
  const Json links = ArrayOf(SchemaReference("link"));
  Json schemas;
  schemas["link"] = ObjectSchema({"href", "rel"},
                                 {{"href", text}, {"rel", text}, {"type", text}, {"title", text}});
  schemas["landingPage"] =
      ObjectSchema({"links"}, {{"title", text}, {"description", text}, {"links", links}});
  schemas["confClasses"] = ObjectSchema({"conformsTo"}, {{"conformsTo", ArrayOf(text)}});
  schemas["collection"] = ObjectSchema({"id", "links"}, {{"id", text},
                                                         {"title", text},
                                                         {"description", text},
                                                         {"links", links},
                                                         {"itemType", text},
                                                         {"crs", ArrayOf(text)}});
  schemas["collections"] =
      ObjectSchema({"links", "collections"},
                   {{"links", links}, {"collections", ArrayOf(SchemaReference("collection"))}});
  const Json type_enum{{"type", "string"}, {"enum", Json::array({"Feature"})}};
  schemas["feature"] = ObjectSchema({"type", "geometry", "properties"},
                                    {{"type", type_enum},
                                     {"geometry", {{"type", "object"}}},
                                     {"properties", {{"type", "object"}, {"nullable", true}}},
                                     {"links", links}});
  const Json collection_enum{{"type", "string"}, {"enum", Json::array({"FeatureCollection"})}};
  schemas["featureCollection"] = ObjectSchema(
      {"type", "features"}, {{"type", collection_enum},
                             {"features", ArrayOf(SchemaReference("feature"))},
                             {"links", links},
                             {"timeStamp", {{"type", "string"}, {"format", "date-time"}}},
                             {"numberReturned", {{"type", "integer"}, {"minimum", 0}}}});
  schemas["exception"] = ObjectSchema({"code"}, {{"code", text}, {"description", text}});
  schemas["openapi"] = {{"type", "object"}};
  return schemas;
}

Json OpenApiPaths() {
  const Json collection = Json::array({ParameterReference("collectionId")});
  const Json feature =
      Json::array({ParameterReference("collectionId"), ParameterReference("featureId")});
  const Json items = Json::array({ParameterReference("collectionId"), ParameterReference("bbox"),
                                  ParameterReference("datetime"), ParameterReference("limit"),
                                  ParameterReference("cursor")});
  Json paths;
  paths["/"] = GetOperation("getLandingPage", "The landing page", kJsonType, "landingPage", {});
  paths["/conformance"] =
      GetOperation("getConformance", "What the API conforms to", kJsonType, "confClasses", {});
  paths["/api"] = GetOperation("getApi", "This document", kOpenApiType, "openapi", {});
  paths["/collections"] =
      GetOperation("getCollections", "The collections", kJsonType, "collections", {});
  paths["/collections/{collectionId}"] =
      GetOperation("describeCollection", "One collection", kJsonType, "collection", collection);
  paths["/collections/{collectionId}/items"] = GetOperation(
      "getFeatures", "Features of a collection", kGeoJsonType, "featureCollection", items);
  paths["/collections/{collectionId}/items/{featureId}"] =
      GetOperation("getFeature", "One feature", kGeoJsonType, "feature", feature);
  return paths;
}

}  // namespace

Json OgcLink(const std::string& href, const std::string& rel, const std::string& type,
             const std::string& title) {
  return {{"href", href}, {"rel", rel}, {"type", type}, {"title", title}};
}

Json OgcLandingPage(const std::string& base, const std::string& title) {
  Json page;
  page["title"] = title;
  page["description"] = "Hazards on the road, changes of the street, and streets with hazards.";
  page["links"] =
      Json::array({OgcLink(base + "/", "self", kJsonType, "This page"),
                   OgcLink(base + "/api", "service-desc", kOpenApiType, "The API's description"),
                   OgcLink(base + "/conformance", "conformance", kJsonType, "Conformance classes"),
                   OgcLink(base + "/collections", "data", kJsonType, "Collections")});
  return page;
}

Json OgcConformance() {
  Json classes = Json::array();
  for (const char* name : {"core", "oas30", "geojson"}) {
    classes.push_back(std::string("http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/") +
                      name);
  }
  Json conformance;
  conformance["conformsTo"] = std::move(classes);
  return conformance;
}

Json OgcCollectionJson(const std::string& base, const OgcCollection& collection) {
  const std::string address = base + "/collections/" + collection.id;
  Json json;
  json["id"] = collection.id;
  json["title"] = collection.title;
  json["description"] = collection.description;
  json["itemType"] = "feature";
  json["crs"] = Json::array({kCrs84});
  json["links"] = Json::array({OgcLink(address, "self", kJsonType, collection.title),
                               OgcLink(address + "/items", "items", kGeoJsonType, "Features")});
  return json;
}

Json OgcCollections(const std::string& base, const std::vector<OgcCollection>& collections) {
  Json json;
  json["links"] = Json::array({OgcLink(base + "/collections", "self", kJsonType, "Collections")});
  Json& list = json["collections"] = Json::array();
  for (const OgcCollection& collection : collections) {
    list.push_back(OgcCollectionJson(base, collection));
  }
  return json;
}

Json OgcOpenApi(const std::string& base, const std::string& title,
                const std::vector<OgcCollection>& collections) {
  Json document;
  document["openapi"] = "3.0.3";
  document["info"] = {{"title", title + ": OGC API - Features"}, {"version", "1.0.0"}};
  document["servers"] = Json::array({{{"url", base}}});
  document["paths"] = OpenApiPaths();
  Json& components = document["components"];
  components["parameters"] = OpenApiParameters(collections);
  components["schemas"] = OpenApiSchemas();
  components["responses"]["refused"] =
      JsonContent("Why there is no such answer", kJsonType, SchemaReference("exception"));
  return document;
}

}  // namespace livemap::web
