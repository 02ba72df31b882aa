#include "streets/address_file.h"

#include <exception>
#include <osmium/osm/node.hpp>
#include <osmium/osm/node_ref.hpp>
#include <osmium/osm/way.hpp>

#include "common/error.h"
#include "streets/osm_objects.h"

namespace livemap::streets {
namespace {

AddressMap ReadAddressesOf(const osmium::io::File& file, const std::string& name) {
  try {
    AddressMapBuilder builder;
    ForEachObject<osmium::Way>(file, osmium::osm_entity_bits::way, [&](const osmium::Way& way) {
      const char* const number = way.tags().get_value_by_key("addr:housenumber");
      const char* const street = way.tags().get_value_by_key("addr:street");
      if (number == nullptr || street == nullptr) return;
      // Not front(): GCC takes the list for the library's one without nodes, and warns.
      for (const osmium::NodeRef& node : way.nodes()) {
        builder.AddAtNode(street, number, node.ref());
        break;
      }
    });
    ForEachObject<osmium::Node>(file, osmium::osm_entity_bits::node, [&](const osmium::Node& node) {
      if (!node.location().valid()) return;
      builder.SetPlace(node.id(), {node.location().lat(), node.location().lon()},
                       node.tags().get_value_by_key("addr:street", ""),
                       node.tags().get_value_by_key("addr:housenumber", ""));
    });
    return builder.Build();
  } catch (const std::exception& error) {
    throw Error("the house numbers of '" + name + "' cannot be read: " + error.what());
  }
}

}  // namespace

AddressMap ReadAddresses(const std::string& path) {
  // By the file's full path, not by a name that the library would open by another program.
  const bool is_xml = path.size() > 4 && path.compare(path.size() - 4, 4, ".osm") == 0;
  const std::string full = path.find('/') == 0 ? path : "./" + path;
  return ReadAddressesOf(osmium::io::File(full, is_xml ? "osm" : "pbf"), path);
}

AddressMap ParseAddresses(const std::string& xml, const std::string& name) {
  return ReadAddressesOf(osmium::io::File(xml.data(), xml.size(), "osm"), name);
}

}  // namespace livemap::streets
