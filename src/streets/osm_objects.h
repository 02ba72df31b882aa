#pragma once

// Part of the readers of street files; nobody else includes this.
#include <osmium/io/file.hpp>
#include <osmium/io/pbf_input.hpp>
#include <osmium/io/reader.hpp>
#include <osmium/io/xml_input.hpp>
#include <osmium/memory/buffer.hpp>
#include <osmium/osm/entity_bits.hpp>

namespace livemap::streets {

/// Hands all objects of one kind to `take(object)`, in the order of the file. Throws what the
/// library throws: a dozen types, of which std::exception is the only common one.
template <typename Object, typename Take>
void ForEachObject(const osmium::io::File& file, osmium::osm_entity_bits::type kind,
                   const Take& take) {
  osmium::io::Reader reader(file, kind, osmium::io::read_meta::no);
  while (osmium::memory::Buffer buffer = reader.read()) {
    for (const Object& object : buffer.select<Object>()) take(object);
  }
  reader.close();
}

}  // namespace livemap::streets
