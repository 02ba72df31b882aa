#pragma once

#include <map>
#include <string>
#include <vector>

#include "directory/zone_directory.h"
#include "region/zone_follower.h"

namespace livemap::region {

/// The zones of a region as they are given: by a directory, by hand, or both. Ids are keys.
struct ZoneList {
  std::map<std::string, std::string> urls;         ///< Of live maps, given by hand.
  std::map<std::string, std::string> token_files;  ///< Each holds the bearer token for a zone.
};

/// A zone of a directory, which names its map. Throws Error for an address that is none.
RegionZone ZoneOf(const directory::ZoneEntry& entry);

/// All zones of the directory (null: there is none) and of the list. An address by hand counts
/// before the directory's. Throws Error that names what is not accepted: an address that is none,
/// a zone of the directory without an address, a token for a zone that there is not, a token file
/// (orders::ReadSecretFile), and a token that would travel to another machine without TLS.
std::vector<RegionZone> ZonesOf(const ZoneList& list, const directory::ZoneDirectory* directory);

/// "NAME=VALUE" in two, both of them not empty. Throws Error that names `flag`.
std::pair<std::string, std::string> SplitNamed(const std::string& flag, const std::string& text);

}  // namespace livemap::region
