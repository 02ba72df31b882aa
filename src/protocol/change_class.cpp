#include "protocol/change_class.h"

#include <cstddef>

namespace livemap::protocol {
namespace {

struct ChangeClassDescription {
  const char* name;
  std::array<std::uint8_t, 3> rgb;
};

constexpr std::array<ChangeClassDescription, kChangeClasses> kChangeClassDescriptions = {
    {{"no_change", {255, 255, 255}},
     {"barrier", {136, 0, 21}},
     {"bin", {237, 28, 36}},
     {"construction", {255, 127, 39}},
     {"other_objects", {34, 177, 76}},
     {"person_cycle", {0, 162, 232}},
     {"rubbish", {63, 72, 204}},
     {"sign", {163, 73, 164}},
     {"traffic_cone", {255, 174, 201}},
     {"vehicle", {181, 230, 29}}}};

}  // namespace

const char* ChangeClassName(ChangeClass change_class) {
  return kChangeClassDescriptions[static_cast<std::size_t>(change_class)].name;
}

std::array<std::uint8_t, 3> ChangeClassColour(ChangeClass change_class) {
  return kChangeClassDescriptions[static_cast<std::size_t>(change_class)].rgb;
}

}  // namespace livemap::protocol
