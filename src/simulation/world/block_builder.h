#pragma once

#include <vector>

#include "simulation/world/street.h"

namespace livemap::simulation {

/// Fills one block of a street with ground, houses, plants, cars, furniture and hazards.
class BlockBuilder {
 public:
  BlockBuilder(const Street& street, int index, StreetBlock& block);
  void Build();

  enum class District { kShops, kHouses, kGardens, kPark };
  /// What stands along block `index`.
  static District DistrictOf(const Street& street, int index);

 private:
  /// Where something stands; `yaw` turns it against the road's direction.
  struct Spot {
    double along;
    double left;
    double yaw;
  };

  /// Stands the builder on the ground with x along the road, -y towards the road and its own
  /// instance.
  void StandBeside(double along, double left, ObjectClass object_class);
  /// As StandBeside with x along the road, turned by `yaw`.
  void StandOn(double along, double left, double yaw, ObjectClass object_class);
  void MoveTo(const Spot& spot);
  std::uint32_t NewInstance(ObjectClass object_class);
  /// As StandOn for an object that may come and go between passes, whose instance was drawn; notes
  /// the change. False when this pass does not show it.
  bool StandIfShown(std::uint32_t instance, ObjectFate fate, const Spot& spot);
  bool NearCrossing(double along, double margin) const;
  /// True when a body of `half` length at this side's parking lane or walkway meets no hazard.
  bool IsFree(double along, double left, double half) const;

  void AddHazards();
  void AddHouses(double side);
  void AddSideStreetHouses();
  void AddPlot(double begin, double width, double side, double setback, CounterRandom& random);
  void AddParkedCars(double side);
  void AddLampPosts();
  void AddStreetTrees(double side);
  void AddBackTrees(double side);
  void AddSmallThings(double side);
  void AddSmallThing(std::uint32_t instance, ObjectFate fate, double along, double side,
                     std::uint64_t item);
  void AddParkedCar(std::uint32_t instance, ObjectFate fate, double along, double left, double side,
                    std::uint64_t item);
  double Kerb() const;

  const Street& street_;
  const int index_;
  StreetBlock& block_;
  MeshBuilder builder_;
  std::vector<StreetHazard> hazards_;  ///< Of this and the neighbouring blocks.
  std::uint32_t next_serial_;
  District district_;
};

}  // namespace livemap::simulation
