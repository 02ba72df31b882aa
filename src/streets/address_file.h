#pragma once

#include <string>

#include "streets/address_map.h"

namespace livemap::streets {

/// Reads the house numbers of an extract of OpenStreetMap: of nodes and of buildings (ways, by
/// their first node) that have both addr:housenumber and addr:street. The file is one that
/// ReadStreetFile has accepted; it is read twice and never kept. Throws Error that names the file.
AddressMap ReadAddresses(const std::string& path);
/// The same of bytes in XML (.osm); `name` stands for the file in errors.
AddressMap ParseAddresses(const std::string& xml, const std::string& name);

}  // namespace livemap::streets
