#include "streets/address_file.h"

#include <exception>
#include <osmium/io/file.hpp>
#include <osmium/io/pbf_input.hpp>
#include <osmium/io/reader.hpp>
#include <osmium/io/xml_input.hpp>
#include <osmium/memory/buffer.hpp>
#include <osmium/osm/entity_bits.hpp>
#include <osmium/osm/node.hpp>
#include <osmium/osm/node_ref.hpp>
#include <osmium/osm/way.hpp>

#include "common/error.h"

namespace livemap::streets {
namespace {

template <typename Object, typename Take>
void ForEachAddressed(const osmium::io::File& file, osmium::osm_entity_bits::type kind,
                      const Take& take) {
  osmium::io::Reader reader(file, kind, osmium::io::read_meta::no);
  while (osmium::memory::Buffer buffer = reader.read()) {
    for (const Object& object : buffer.select<Object>()) take(object);
  }
  reader.close();
}

AddressMap ReadAddressesOf(const osmium::io::File& file, const std::string& name) {
  try {
    AddressMapBuilder builder;
    ForEachAddressed<osmium::Way>(file, osmium::osm_entity_bits::way, [&](const osmium::Way& way) {
      const char* const number = way.tags().get_value_by_key("addr:housenumber");
      const char* const street = way.tags().get_value_by_key("addr:street");
      if (number == nullptr || street == nullptr) return;
      // Not front(): GCC takes the list for the library's one without nodes, and warns.
      for (const osmium::NodeRef& node : way.nodes()) {
        builder.AddAtNode(street, number, node.ref());
        break;
      }
    });
    ForEachAddressed<osmium::Node>(
        file, osmium::osm_entity_bits::node, [&](const osmium::Node& node) {
          if (!node.location().valid()) return;
          builder.SetPlace(node.id(), {node.location().lat(), node.location().lon()},
                           node.tags().get_value_by_key("addr:street", ""),
                           node.tags().get_value_by_key("addr:housenumber", ""));
        });
    return builder.Build();
  } catch (const std::exception& error) {
    // The library throws a dozen types, of which std::exception is the only common one.
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
