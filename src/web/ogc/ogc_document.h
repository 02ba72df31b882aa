#pragma once

#include <string>
#include <vector>

#include "web/json/json.h"

namespace livemap::web {

/// One collection of features.
struct OgcCollection {
  std::string id;
  std::string title;
  std::string description;
};

/// Media type of the OpenAPI document.
constexpr const char* kOpenApiType = "application/vnd.oai.openapi+json;version=3.0";

/// `{"href", "rel", "type", "title"}` of a link.
Json OgcLink(const std::string& href, const std::string& rel, const std::string& type,
             const std::string& title);

/// The landing page (OGC API - Features - Part 1, 7.2) of the API at `base`.
Json OgcLandingPage(const std::string& base, const std::string& title);

/// The conformance classes (7.4).
Json OgcConformance();

/// All collections (7.13), and one of them (7.14).
Json OgcCollections(const std::string& base, const std::vector<OgcCollection>& collections);
Json OgcCollectionJson(const std::string& base, const OgcCollection& collection);

/// The description of the API as an OpenAPI 3.0 document (7.3).
Json OgcOpenApi(const std::string& base, const std::string& title,
                const std::vector<OgcCollection>& collections);

}  // namespace livemap::web
