#pragma once

#include <cstddef>
#include <string>

#include "streets/street_map.h"

namespace livemap::streets {

/// Reads the drivable streets of an OpenStreetMap extract: a file in PBF (.osm.pbf) or in XML
/// (.osm). Footways, tracks, closed streets (access=no, motor_vehicle=no) and squares are left out.
/// Relations of the type "restriction" that concern a turn of cars at a node count (no_...,
/// only_...). Those by way of another street, at some hours or for other vehicles do not. The file
/// is read three times and never kept: memory is that of StreetMapBuilder, and some 200 MB for the
/// blocks under way (2.5 GB for a file made to harm). Throws Error that names the file, what is
/// wrong and what is accepted: for a name or content of another kind, a damaged file, one of more
/// than 8 GB (XML: 2 GB), counts beyond `limits`, and no drivable street at all.
StreetMap ReadStreetFile(const std::string& path, const StreetLimits& limits = {});

/// The same of bytes; `format` is "pbf" or "osm", `name` stands for the file in errors.
StreetMap ParseStreets(const std::string& bytes, const std::string& format, const std::string& name,
                       const StreetLimits& limits = {});

}  // namespace livemap::streets
