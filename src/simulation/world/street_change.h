#pragma once

#include <cstdint>

#include "protocol/change_class.h"
#include "simulation/objects/object_class.h"

namespace livemap::simulation {

/// kNoChange for what has no class of change: the ground and its potholes, houses, trees, poles.
protocol::ChangeClass ChangeClassOf(ObjectClass object_class);

/// What becomes of an object between the first and the second pass.
enum class ObjectFate { kStays, kAppears, kVanishes, kReplaced };

/// Which of two drives through a street sees it, and how much changes between them.
struct StreetPass {
  enum class Which { kOnly, kFirst, kSecond };
  Which which = Which::kOnly;  ///< kOnly: the street with all its objects.
  double changes = 0;  ///< Share of the objects that may change that do, 0..1; not of kOnly.

  /// A pure function of the street's seed and the object's serial number: it depends neither on
  /// other objects nor on the order in which blocks are built, and a larger share changes the same
  /// objects and more.
  ObjectFate FateOf(std::uint64_t seed, std::uint32_t instance) const;
  /// True when an object of this fate stands there in this pass. What is replaced vanishes; what
  /// replaces it appears.
  bool Shows(ObjectFate fate) const;
};

/// An object that only one of the passes shows.
struct StreetChange {
  std::uint32_t instance = 0;
  bool appeared = false;  ///< Else vanished.
  double along_m = 0;
  double left_m = 0;  ///< Of the road's middle line.
};

/// The instance of what stands where the object `instance` stood before it was replaced.
std::uint32_t SuccessorOf(std::uint32_t instance, ObjectClass object_class);

}  // namespace livemap::simulation
