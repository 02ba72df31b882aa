#include "simulation/world/block_builder.h"

#include <cmath>
#include <optional>

#include "simulation/objects/building.h"
#include "simulation/objects/car.h"
#include "simulation/objects/furniture.h"
#include "simulation/objects/hazard_shapes.h"
#include "simulation/objects/plant.h"
#include "simulation/world/ground_mesh.h"

namespace livemap::simulation {
namespace {

enum BlockStream : std::uint64_t {
  kHouses = 21,
  kCars = 23,
  kTrees = 25,
  kThings = 27,
  kDistricts = 29,
  kSideStreet = 30,
  kBackTrees = 31,
};

std::uint64_t BlockItem(int index, double side) {
  return static_cast<std::uint64_t>(index + 1000) * 2 + (side > 0 ? 1 : 0);
}

/// What stands on the pavement for a number in [0, 1); none for the rest of it.
std::optional<ObjectClass> SmallThingOfBlock(double number) {
  if (number < 0.16) return ObjectClass::kBin;
  if (number < 0.24) return ObjectClass::kRubbish;
  if (number < 0.46) return ObjectClass::kPerson;
  if (number < 0.62) return ObjectClass::kSign;
  if (number < 0.73) return ObjectClass::kOtherObject;
  if (number < 0.84) return ObjectClass::kCycle;
  return std::nullopt;
}

/// What may stand where a thing stood; none: a replaced sign just vanishes, for another one could
/// look the same.
std::optional<ObjectClass> BlockSuccessor(ObjectClass thing) {
  switch (thing) {
    case ObjectClass::kBin:
      return ObjectClass::kRubbish;
    case ObjectClass::kRubbish:
      return ObjectClass::kCycle;
    case ObjectClass::kPerson:
      return ObjectClass::kBin;
    case ObjectClass::kOtherObject:
      return ObjectClass::kPerson;
    case ObjectClass::kCycle:
      return ObjectClass::kOtherObject;
    default:
      return std::nullopt;
  }
}

}  // namespace

BlockBuilder::BlockBuilder(const Street& street, int index, StreetBlock& block)
    : street_(street),
      index_(index),
      block_(block),
      builder_(block.mesh),
      // Serials below belong to the block's hazards.
      next_serial_(static_cast<std::uint32_t>(index + 8) * 1024U + 256U),
      district_(DistrictOf(street, index)) {
  for (int near = index - 1; near <= index + 1; ++near) {
    for (const StreetHazard& hazard : street.Hazards(near)) hazards_.push_back(hazard);
  }
}

BlockBuilder::District BlockBuilder::DistrictOf(const Street& street, int index) {
  CounterRandom random(street.seed(), kDistricts, static_cast<std::uint64_t>((index + 1000) / 3));
  const double kind = random.Uniform(0.0, 1.0);
  if (kind < 0.3) return District::kShops;
  if (kind < 0.6) return District::kHouses;
  return kind < 0.88 ? District::kGardens : District::kPark;
}

double BlockBuilder::Kerb() const {
  return static_cast<double>(street_.profile().half_road_m() + kKerbWidthM);
}

void BlockBuilder::Build() {
  builder_.SetMaterial({MaterialKind::kGround, Vec3::Ones(), Vec3::Ones(), block_.ground.seed});
  builder_.SetInstance(MakeInstance(0, ObjectClass::kRoad));
  AddGround(street_.line(), block_.ground, index_ * kBlockM, (index_ + 1) * kBlockM, block_.origin,
            builder_);
  AddHazards();
  AddLampPosts();
  for (const double side : {-1.0, 1.0}) {
    if (street_.description().buildings) AddHouses(side);
    if (street_.description().parked_cars) AddParkedCars(side);
    if (street_.description().trees) {
      AddStreetTrees(side);
      AddBackTrees(side);
    }
    AddSmallThings(side);
  }
  if (street_.description().buildings) AddSideStreetHouses();
}

std::uint32_t BlockBuilder::NewInstance(ObjectClass object_class) {
  return MakeInstance(next_serial_++, object_class);
}

void BlockBuilder::StandBeside(double along, double left, ObjectClass object_class) {
  StandOn(along, left, left > 0 ? 0 : M_PI, object_class);
}

void BlockBuilder::StandOn(double along, double left, double yaw, ObjectClass object_class) {
  MoveTo({along, left, yaw});
  builder_.SetInstance(NewInstance(object_class));
}

void BlockBuilder::MoveTo(const Spot& spot) {
  const double up = static_cast<double>(
      GroundHeight(block_.ground, static_cast<float>(spot.along), static_cast<float>(spot.left)));
  Eigen::Isometry3d frame = street_.line().Upright(spot.along, spot.left, up);
  frame.rotate(Eigen::AngleAxisd(spot.yaw, Eigen::Vector3d::UnitZ()));
  frame.translation() -= block_.origin;
  builder_.SetFrame(Eigen::Affine3f(frame.cast<float>().matrix()));
}

bool BlockBuilder::StandIfShown(std::uint32_t instance, ObjectFate fate, const Spot& spot) {
  if (fate != ObjectFate::kStays) {
    block_.changes.push_back({instance, fate == ObjectFate::kAppears, spot.along, spot.left});
  }
  MoveTo(spot);
  builder_.SetInstance(instance);
  return street_.pass().Shows(fate);
}

bool BlockBuilder::NearCrossing(double along, double margin) const {
  for (const float at : block_.ground.crossings_m) {
    if (std::abs(along - static_cast<double>(at)) < static_cast<double>(kSideRoadHalfM) + margin) {
      return true;
    }
  }
  return false;
}

bool BlockBuilder::IsFree(double along, double left, double half) const {
  for (const StreetHazard& hazard : hazards_) {
    if (hazard.object_class == ObjectClass::kPothole) continue;
    // A sign ahead of a site must be seen, so parked cars keep away from it.
    const double before = hazard.object_class == ObjectClass::kRoadWorkSign ? 8 : 0.6;
    const bool along_clear = along + half < hazard.along_m - hazard.radius_m - before ||
                             along - half > hazard.along_m + hazard.radius_m + 0.6;
    if (!along_clear && std::abs(left - hazard.left_m) < hazard.radius_m + 1.4) return false;
  }
  return true;
}

void BlockBuilder::AddHazards() {
  for (const StreetHazard& hazard : street_.Hazards(index_)) {
    if (hazard.object_class == ObjectClass::kPothole) continue;
    CounterRandom random(hazard.seed, 2);
    const double yaw = random.Uniform(-0.12, 0.12);
    const ObjectFate fate = street_.pass().FateOf(street_.seed(), hazard.instance);
    if (!StandIfShown(hazard.instance, fate, {hazard.along_m, hazard.left_m, yaw})) continue;
    switch (hazard.object_class) {
      case ObjectClass::kTrafficCone:
        AddTrafficCone(random, builder_);
        break;
      case ObjectClass::kRoadWorkSign:
        AddWorkSign(random, builder_);
        break;
      case ObjectClass::kBarrier:
        AddBarrier(random, builder_);
        break;
      case ObjectClass::kDebris:
        AddDebris(random, builder_);
        break;
      case ObjectClass::kDeer:
        AddDeer(random, builder_);
        break;
      case ObjectClass::kConstructionMachine:
        AddExcavator(random, builder_);
        break;
      default:
        AddAccident(random, builder_);
    }
  }
}

void BlockBuilder::AddPlot(double begin, double width, double side, double setback,
                           CounterRandom& random) {
  const double pavement = Kerb() + street_.description().pavement_width_m;
  const double front = pavement + setback;
  // The left side's x runs along the road, the right side's against it.
  StandBeside(side > 0 ? begin : begin + width, side * front, ObjectClass::kBuilding);
  AddBuilding(static_cast<float>(width), random.Uniform(8.5F, 11.0F), random, builder_);
  if (setback < 1.5) return;
  const auto length = static_cast<float>(width);
  const float gate = random.Uniform(0.3F, 0.55F) * length;
  const bool hedge = random.Chance(0.5);
  const double edge = side * (pavement + (hedge ? 0.35 : 0.12));
  for (const bool second : {false, true}) {
    const double from = second ? begin + static_cast<double>(gate) + 1.1 : begin;
    const auto piece = second ? length - gate - 1.1F : gate;
    if (piece < 0.6F) continue;
    const double x = side > 0 ? from : from + static_cast<double>(piece);
    StandBeside(x, edge, hedge ? ObjectClass::kTree : ObjectClass::kFence);
    if (hedge) {
      // Its own, for the number of leaves must not shift what the season leaves alone.
      CounterRandom own(street_.seed(), kHouses + 100, random.Bits());
      AddHedge(piece, own.Uniform(0.9F, 1.3F), street_.leaves_, own, builder_);
    } else {
      AddFence(piece, random, builder_);
    }
  }
}

void BlockBuilder::AddHouses(double side) {
  if (district_ == District::kPark) return;
  CounterRandom random(street_.seed(), kHouses, BlockItem(index_, side));
  const double end = (index_ + 1) * kBlockM;
  double along = index_ * kBlockM;
  while (along < end - 6) {
    double width = random.Uniform(7.0, district_ == District::kShops ? 14.0 : 11.5);
    if (end - along - width < 6) width = end - along;
    double setback = 0;
    if (district_ == District::kHouses) setback = random.Uniform(0.0, 0.6);
    if (district_ == District::kGardens) setback = random.Uniform(2.5, 4.5);
    const double gap = district_ == District::kGardens ? 2.0 : random.Chance(0.12) ? 3.0 : 0.0;
    const bool blocked = NearCrossing(along, 3.4) || NearCrossing(along + width, 3.4) ||
                         NearCrossing(along + 0.5 * width, 0.5 * width);
    if (!blocked) AddPlot(along, width - gap, side, setback, random);
    // Beside a side street houses end early rather than not at all.
    along += blocked ? 1.5 : width;
  }
}

void BlockBuilder::AddSideStreetHouses() {
  for (const float at : block_.ground.crossings_m) {
    const auto crossing = static_cast<double>(at);
    if (crossing < index_ * kBlockM || crossing >= (index_ + 1) * kBlockM) continue;
    for (const double side : {-1.0, 1.0}) {
      for (const double ahead : {-1.0, 1.0}) {
        CounterRandom random(street_.seed(), kSideStreet,
                             BlockItem(index_, side) * 2 + (ahead > 0 ? 1 : 0));
        double out = Kerb() + 15.5;
        for (int house = 0; house < 3; ++house) {
          const double width = random.Uniform(8.0, 11.0);
          const double along = crossing + ahead * (static_cast<double>(kSideRoadHalfM) + 2.4);
          // x runs along the side street so that -y looks to it.
          const double yaw = ahead > 0 ? -M_PI / 2 : M_PI / 2;
          const bool from_far_end = (side > 0) == (ahead > 0);
          const double left = side * (from_far_end ? out + width : out);
          StandOn(along, left, ahead > 0 ? yaw + 0.0 : yaw, ObjectClass::kBuilding);
          AddBuilding(static_cast<float>(width), 9, random, builder_);
          out += width;
        }
      }
    }
  }
}

void BlockBuilder::AddParkedCars(double side) {
  if (street_.description().parking_width_m < 1.7) return;
  CounterRandom random(street_.seed(), kCars, BlockItem(index_, side));
  const double left =
      side * (street_.description().lane_width_m + 0.52 * street_.description().parking_width_m);
  const double density = district_ == District::kPark ? 0.3 : 0.62;
  for (double along = index_ * kBlockM + 3; along < (index_ + 1) * kBlockM - 2.5;
       along += random.Uniform(5.7, 7.0)) {
    const bool wanted = random.Chance(density);
    const std::uint64_t item = random.Bits();
    if (!wanted || NearCrossing(along, 9) || !IsFree(along, left, 2.6)) continue;
    const std::uint32_t instance = NewInstance(ObjectClass::kVehicle);
    const ObjectFate fate = street_.pass().FateOf(street_.seed(), instance);
    AddParkedCar(instance, fate, along, left, side, item);
    if (fate != ObjectFate::kReplaced) continue;
    AddParkedCar(SuccessorOf(instance, ObjectClass::kVehicle), ObjectFate::kAppears, along, left,
                 side, item + 1);
  }
}

void BlockBuilder::AddParkedCar(std::uint32_t instance, ObjectFate fate, double along, double left,
                                double side, std::uint64_t item) {
  CounterRandom random(street_.seed(), kCars + 100, item);
  const double yaw = (side > 0 ? M_PI : 0) + random.Uniform(-0.03, 0.03);
  const double askew = random.Uniform(-0.12, 0.12);
  if (StandIfShown(instance, fate, {along, left + askew, yaw})) AddCar(random, 0, builder_);
}

void BlockBuilder::AddLampPosts() {
  const double out = Kerb() + 0.35;
  for (int i = 0; i < 2; ++i) {
    const double along = (index_ + 0.25 + 0.5 * i) * kBlockM;
    const double left = (i == 0 ? 1 : -1) * out;
    if (NearCrossing(along, 2)) continue;
    StandBeside(along, left, ObjectClass::kPole);
    const float height = AddLampPost(builder_);
    block_.lamps.push_back(builder_.frame() *
                           Vec3(0, static_cast<float>(kLampReachM), height - 0.1F));
  }
}

void BlockBuilder::AddStreetTrees(double side) {
  CounterRandom random(street_.seed(), kTrees, BlockItem(index_, side));
  const double out = Kerb() + 0.75;
  const double pitch = district_ == District::kShops ? 20 : 13;
  for (double along = index_ * kBlockM + 4; along < (index_ + 1) * kBlockM; along += pitch) {
    const double place = along + random.Uniform(0.0, 4.0);
    const bool wanted = random.Chance(district_ == District::kShops ? 0.45 : 0.65);
    CounterRandom own(street_.seed(), kTrees + 100, random.Bits());
    if (!wanted || NearCrossing(place, 5)) continue;
    StandBeside(place, side * out, ObjectClass::kTree);
    AddTree(own.Uniform(5.5F, 8.5F), street_.leaves_, own, builder_);
  }
}

void BlockBuilder::AddBackTrees(double side) {
  CounterRandom random(street_.seed(), kBackTrees, BlockItem(index_, side));
  const double nearest = district_ == District::kPark ? 10.5 : 24;
  const int count = district_ == District::kPark ? 5 : 2;
  for (int i = 0; i < count; ++i) {
    const double along = (index_ + (i + random.Uniform(0.1, 0.9)) / count) * kBlockM;
    const double left = side * random.Uniform(nearest, nearest + 14);
    CounterRandom own(street_.seed(), kBackTrees + 100, random.Bits());
    if (NearCrossing(along, 14)) continue;
    StandBeside(along, left, ObjectClass::kTree);
    AddTree(own.Uniform(8.0F, 13.0F), street_.leaves_, own, builder_);
  }
}

void BlockBuilder::AddSmallThings(double side) {
  CounterRandom random(street_.seed(), kThings, BlockItem(index_, side));
  for (int i = 0; i < 4; ++i) {
    const double along = (index_ + (i + random.Uniform(0.15, 0.85)) / 4) * kBlockM;
    const std::optional<ObjectClass> kind = SmallThingOfBlock(random.Uniform(0.0, 1.0));
    const std::uint64_t item = random.Bits();
    if (!kind || NearCrossing(along, 5)) continue;
    const std::uint32_t instance = NewInstance(*kind);
    const ObjectFate fate = street_.pass().FateOf(street_.seed(), instance);
    AddSmallThing(instance, fate, along, side, item);
    const std::optional<ObjectClass> successor = BlockSuccessor(*kind);
    if (fate != ObjectFate::kReplaced || !successor) continue;
    AddSmallThing(SuccessorOf(instance, *successor), ObjectFate::kAppears, along, side, item + 1);
  }
}

void BlockBuilder::AddSmallThing(std::uint32_t instance, ObjectFate fate, double along, double side,
                                 std::uint64_t item) {
  CounterRandom random(street_.seed(), kThings + 100, item);
  const ObjectClass kind = ClassOfInstance(instance);
  // Most look to the road from the back of the pavement.
  Spot spot{along, side * (Kerb() + street_.description().pavement_width_m - 0.5),
            side > 0 ? 0 : M_PI};
  if (kind == ObjectClass::kPerson) {
    spot.yaw = random.Chance(0.5) ? 0 : M_PI;
    spot.left -= side * random.Uniform(0.0, 0.6);
  } else if (kind == ObjectClass::kSign) {
    spot.yaw = side > 0 ? M_PI : 0;
    spot.left = side * (Kerb() + 0.4);
  }
  if (!StandIfShown(instance, fate, spot)) return;
  switch (kind) {
    case ObjectClass::kBin:
      AddBin(random, builder_);
      break;
    case ObjectClass::kRubbish:
      AddRubbishBags(random, builder_);
      break;
    case ObjectClass::kPerson:
      AddPerson(random, builder_);
      break;
    case ObjectClass::kSign:
      AddTrafficSign(random, builder_);
      break;
    case ObjectClass::kCycle:
      AddBicycle(random, builder_);
      break;
    default:
      AddOtherObject(random, builder_);
  }
}

}  // namespace livemap::simulation
