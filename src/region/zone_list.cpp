#include "region/zone_list.h"

#include <regex>
#include <utility>

#include "common/error.h"
#include "orders/secret_file.h"

namespace livemap::region {
namespace {

constexpr std::size_t kMaxUrlBytes = 512;

/// Without a last '/'.
std::string CheckedUrl(const std::string& zone, std::string url) {
  static const std::regex kUrl(
      "https?://[A-Za-z0-9._-]+(:[0-9]{1,5})?(/[A-Za-z0-9._~/-]*)?|"
      "https?://\\[[0-9A-Fa-f:.]+\\](:[0-9]{1,5})?(/[A-Za-z0-9._~/-]*)?");
  if (url.size() > kMaxUrlBytes || !std::regex_match(url, kUrl)) {
    throw Error("the address of zone '" + zone + "' is '" + url.substr(0, kMaxUrlBytes) +
                "', accepted is http(s)://HOST or http(s)://HOST/PATH");
  }
  while (url.back() == '/') url.pop_back();
  return url;
}

std::string HostOf(const std::string& url) {
  const std::size_t begin = url.find("://") + 3;
  const std::size_t end =
      url[begin] == '[' ? url.find(']', begin) + 1 : url.find_first_of(":/", begin);
  return url.substr(begin, end == std::string::npos ? end : end - begin);
}

void AddToken(const std::string& file, RegionZone& zone) {
  if (zone.url.compare(0, 8, "https://") != 0 && !orders::IsThisMachine(HostOf(zone.url))) {
    throw Error("the address of zone '" + zone.id + "' is '" + zone.url +
                "', accepted with a token is https://, because anybody on the way reads it else");
  }
  zone.token = orders::ReadSecretFile(file);
}

}  // namespace

std::pair<std::string, std::string> SplitNamed(const std::string& flag, const std::string& text) {
  const std::size_t at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size()) {
    throw Error(flag + " is '" + text + "', accepted is NAME=VALUE (see --help)");
  }
  return {text.substr(0, at), text.substr(at + 1)};
}

RegionZone ZoneOf(const directory::ZoneEntry& entry) {
  RegionZone zone;
  zone.id = entry.id;
  zone.name = entry.name;
  zone.area = entry.area;
  zone.url = CheckedUrl(entry.id, entry.map_url);
  return zone;
}

std::vector<RegionZone> ZonesOf(const ZoneList& list, const directory::ZoneDirectory* directory) {
  std::vector<RegionZone> zones;
  std::map<std::string, std::string> urls = list.urls;
  if (directory != nullptr) {
    for (const directory::ZoneEntry& entry : directory->zones()) {
      directory::ZoneEntry addressed = entry;
      const auto by_hand = urls.find(entry.id);
      if (by_hand != urls.end()) {
        addressed.map_url = by_hand->second;
        urls.erase(by_hand);
      }
      if (addressed.map_url.empty()) {
        throw Error("zone '" + entry.id +
                    "' has no address: accepted is a 'map' in the directory, or --zone " +
                    entry.id + "=URL");
      }
      zones.push_back(ZoneOf(addressed));
    }
  }
  for (const auto& [id, url] : urls) {
    zones.emplace_back();
    zones.back().id = id;
    zones.back().url = CheckedUrl(id, url);
  }
  std::map<std::string, std::string> files = list.token_files;
  for (RegionZone& zone : zones) {
    const auto file = files.find(zone.id);
    if (file == files.end()) continue;
    AddToken(file->second, zone);
    files.erase(file);
  }
  if (!files.empty()) {
    throw Error("a token is given for zone '" + files.begin()->first +
                "', accepted are the zones of the region");
  }
  return zones;
}

}  // namespace livemap::region
