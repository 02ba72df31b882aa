#include "simulation/world/street_change.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "datasets/camera_file.h"
#include "simulation/datasets/change_truth.h"
#include "simulation/motion/pass_drive.h"
#include "test/simulation/render/same_pixels.h"

namespace livemap::simulation {
namespace {

constexpr double kPassLengthM = 500;
constexpr double kShare = 0.5;

SimulatedCamera PassCamera() {
  SimulatedCamera camera;
  camera.intrinsics = geo::CameraIntrinsics{160, 160, 99.5, 59.5, 200, 120};
  return camera;
}

datasets::CameraMounting Mounting() {
  datasets::CameraMounting mounting;
  mounting.height_m = 1.4;
  mounting.pitch_deg = 3;
  return mounting;
}

Street MakeStreet(StreetPass::Which which, bool leaves, double share = kShare) {
  return {WorldDescription(), 3, kPassLengthM, leaves, {which, share}};
}

CameraExposure ViewOfFrame(const Street& street, std::size_t frame) {
  return PassDrive(street, DrawSecondManner(3, 8, 0.5, 20), Mounting(), 0).Camera(frame);
}

TEST(ChangeClass, KnowsEveryObjectThatMayChangeAndNoOther) {
  std::set<protocol::ChangeClass> used;
  for (int i = 0; i < kObjectClasses; ++i) used.insert(ChangeClassOf(static_cast<ObjectClass>(i)));
  EXPECT_EQ(used.size(), static_cast<std::size_t>(protocol::kChangeClasses));
  for (const ObjectClass fixed : {ObjectClass::kSky, ObjectClass::kRoad, ObjectClass::kPothole,
                                  ObjectClass::kBuilding, ObjectClass::kTree, ObjectClass::kPole}) {
    EXPECT_EQ(ChangeClassOf(fixed), protocol::ChangeClass::kNoChange) << ClassName(fixed);
  }
  EXPECT_EQ(ChangeClassOf(ObjectClass::kCycle), protocol::ChangeClass::kPersonCycle);
  EXPECT_EQ(ChangeClassOf(ObjectClass::kStoppedAccident), protocol::ChangeClass::kVehicle);
  EXPECT_STREQ(protocol::ChangeClassName(protocol::ChangeClass::kVehicle), "vehicle");
}

TEST(StreetPass, ChangesItsShareAndALargerShareTheSameObjectsAndMore) {
  const StreetPass few{StreetPass::Which::kFirst, 0.25};
  const StreetPass more{StreetPass::Which::kSecond, 0.5};
  std::map<ObjectFate, int> fates;
  constexpr int kCount = 20000;
  for (std::uint32_t serial = 1; serial <= kCount; ++serial) {
    const std::uint32_t bin = MakeInstance(serial, ObjectClass::kBin);
    const ObjectFate fate = few.FateOf(7, bin);
    ++fates[fate];
    if (fate != ObjectFate::kStays) {
      ASSERT_EQ(fate, more.FateOf(7, bin));
    }
  }
  EXPECT_NEAR(fates[ObjectFate::kStays], 0.75 * kCount, 300);
  EXPECT_NEAR(fates[ObjectFate::kAppears], 0.10 * kCount, 200);
  EXPECT_NEAR(fates[ObjectFate::kVanishes], 0.10 * kCount, 200);
  EXPECT_NEAR(fates[ObjectFate::kReplaced], 0.05 * kCount, 150);
}

TEST(StreetPass, ShowsWhatAppearsInTheSecondAndWhatGoesInTheFirst) {
  const StreetPass first{StreetPass::Which::kFirst, 1};
  const StreetPass second{StreetPass::Which::kSecond, 1};
  EXPECT_FALSE(first.Shows(ObjectFate::kAppears));
  EXPECT_TRUE(second.Shows(ObjectFate::kAppears));
  for (const ObjectFate gone : {ObjectFate::kVanishes, ObjectFate::kReplaced}) {
    EXPECT_TRUE(first.Shows(gone));
    EXPECT_FALSE(second.Shows(gone));
  }
  EXPECT_TRUE(first.Shows(ObjectFate::kStays) && second.Shows(ObjectFate::kStays));
}

/// The corners and colours of each instance of a block, in order.
std::map<std::uint32_t, std::vector<float>> Shapes(const StreetBlock& block) {
  std::map<std::uint32_t, std::vector<float>> shapes;
  for (const Triangle& triangle : block.mesh.triangles) {
    std::vector<float>& shape = shapes[triangle.instance];
    for (const std::uint32_t corner : triangle.corners) {
      const Vec3& place = block.mesh.positions[corner];
      shape.insert(shape.end(), place.data(), place.data() + 3);
    }
    const Vec3& colour = block.mesh.materials[triangle.material].colour;
    shape.insert(shape.end(), colour.data(), colour.data() + 3);
  }
  return shapes;
}

/// Instances of the change list by pass: those that appeared and those that vanished.
std::pair<std::set<std::uint32_t>, std::set<std::uint32_t>> Listed(const StreetBlock& block) {
  std::set<std::uint32_t> appeared;
  std::set<std::uint32_t> vanished;
  for (const StreetChange& change : block.changes) {
    (change.appeared ? appeared : vanished).insert(change.instance);
  }
  return {appeared, vanished};
}

TEST(TwoPasses, DifferInEveryListedObjectAndInNothingElse) {
  const Street first = MakeStreet(StreetPass::Which::kFirst, true);
  const Street second = MakeStreet(StreetPass::Which::kSecond, true);
  std::size_t appeared_count = 0;
  std::size_t vanished_count = 0;
  std::set<protocol::ChangeClass> classes;
  for (int index = 0; index < 8; ++index) {
    const StreetBlock before = first.Build(index);
    const StreetBlock after = second.Build(index);
    const auto [appeared, vanished] = Listed(after);
    EXPECT_EQ(Listed(before), Listed(after));
    const auto old_shapes = Shapes(before);
    const auto new_shapes = Shapes(after);
    std::set<std::uint32_t> only_new;
    std::set<std::uint32_t> only_old;
    for (const auto& [instance, shape] : new_shapes) {
      const auto old = old_shapes.find(instance);
      if (old == old_shapes.end()) {
        only_new.insert(instance);
      } else {
        EXPECT_EQ(shape, old->second) << "instance " << instance;
      }
    }
    for (const auto& [instance, shape] : old_shapes) {
      if (new_shapes.count(instance) == 0) only_old.insert(instance);
    }
    EXPECT_EQ(only_new, appeared);
    EXPECT_EQ(only_old, vanished);
    appeared_count += appeared.size();
    vanished_count += vanished.size();
    for (const StreetChange& change : after.changes) {
      classes.insert(ChangeClassOf(ClassOfInstance(change.instance)));
    }
  }
  EXPECT_GT(appeared_count, 20U);
  EXPECT_GT(vanished_count, 20U);
  EXPECT_GE(classes.size(), 7U);
  EXPECT_EQ(classes.count(protocol::ChangeClass::kNoChange), 0U);
}

TEST(TwoPasses, KeepPlacesAndInstancesOfWhatStaysInAnySeason) {
  const Street summer = MakeStreet(StreetPass::Which::kFirst, true);
  const Street winter = MakeStreet(StreetPass::Which::kSecond, false);
  const Street whole(WorldDescription(), 3, kPassLengthM, true);
  std::size_t bare = 0;
  std::size_t houses = 0;
  for (int index = 0; index < 8; ++index) {
    const auto green = Shapes(summer.Build(index));
    const StreetBlock block = winter.Build(index);
    const auto white = Shapes(block);
    const auto all = Shapes(whole.Build(index));
    const auto [appeared, vanished] = Listed(block);
    for (const auto& [instance, shape] : all) {
      const bool stays = appeared.count(instance) + vanished.count(instance) == 0;
      if (!stays) continue;
      ASSERT_EQ(green.count(instance), 1U);
      ASSERT_EQ(white.count(instance), 1U);
      if (ClassOfInstance(instance) == ObjectClass::kTree) {
        if (white.at(instance) != shape) ++bare;
        continue;
      }
      EXPECT_EQ(green.at(instance), shape) << ClassName(ClassOfInstance(instance));
      EXPECT_EQ(white.at(instance), shape) << ClassName(ClassOfInstance(instance));
      if (ClassOfInstance(instance) == ObjectClass::kBuilding) ++houses;
    }
  }
  EXPECT_GT(bare, 10U) << "trees lose their leaves";
  EXPECT_GT(houses, 10U);
}

TEST(CompareInstances, PaintsTheAppearedObjectElseTheVanishedOneAndNothingUnlisted) {
  const std::uint32_t road = MakeInstance(0, ObjectClass::kRoad);
  const std::uint32_t tree = MakeInstance(1, ObjectClass::kTree);
  const std::uint32_t cone = MakeInstance(2, ObjectClass::kTrafficCone);
  const std::uint32_t car = MakeInstance(3, ObjectClass::kVehicle);
  const auto image = [](const std::vector<std::uint32_t>& pixels) {
    cv::Mat row(1, static_cast<int>(pixels.size()), CV_32SC1);
    for (int i = 0; i < row.cols; ++i) {
      row.at<int>(0, i) = static_cast<int>(pixels[static_cast<std::size_t>(i)]);
    }
    return row;
  };
  std::map<std::uint32_t, StreetChange> changed;
  changed[cone] = {cone, true, 0, 0};
  changed[car] = {car, false, 0, 0};
  const ChangeView view = CompareInstances(image({road, car, car, car, road, cone}),
                                           image({cone, cone, road, tree, tree, cone}), changed);
  const std::vector<protocol::ChangeClass> expected = {
      protocol::ChangeClass::kTrafficCone, protocol::ChangeClass::kTrafficCone,
      protocol::ChangeClass::kVehicle,     protocol::ChangeClass::kVehicle,
      protocol::ChangeClass::kNoChange,    protocol::ChangeClass::kNoChange};
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(static_cast<protocol::ChangeClass>(view.mask.at<std::uint8_t>(0, i)),
              expected[static_cast<std::size_t>(i)])
        << i;
  }
  const std::vector<int> directions(view.direction.begin<std::uint8_t>(),
                                    view.direction.end<std::uint8_t>());
  EXPECT_EQ(directions,
            (std::vector<int>{protocol::kAppearedPixel, protocol::kAppearedPixel,
                              protocol::kVanishedPixel, protocol::kVanishedPixel, 0, 0}));
  EXPECT_EQ(view.pixels, (std::map<std::uint32_t, int>{{cone, 2}, {car, 2}}));
}

TEST(ChangeTruth, MasksAreTheDifferenceOfTheRenderedInstances) {
  const Street before = MakeStreet(StreetPass::Which::kFirst, false);
  const Street after = MakeStreet(StreetPass::Which::kSecond, false);
  const Lighting light = MakeLighting(Condition::kSnow, 5);
  RenderConfig options;
  options.smooth_edges = false;
  StreetRenderer old_renderer(before, PassCamera(), light, options);
  StreetRenderer new_renderer(after, PassCamera(), light, options);
  ChangeTruth truth(WorldDescription(), 3, kPassLengthM, false, kShare, PassCamera(), 2);
  std::set<int> classes;
  for (const std::size_t frame : {0U, 3U, 6U}) {
    const CameraExposure view = ViewOfFrame(after, frame);
    const cv::Mat was = old_renderer.Render(view, 0).instances;
    const cv::Mat is = new_renderer.Render(view, 1).instances;
    const cv::Mat mask = truth.Look(view).mask;
    for (int row = 0; row < mask.rows; ++row) {
      for (int column = 0; column < mask.cols; ++column) {
        const auto old_id = static_cast<std::uint32_t>(was.at<int>(row, column));
        const auto new_id = static_cast<std::uint32_t>(is.at<int>(row, column));
        protocol::ChangeClass expected = protocol::ChangeClass::kNoChange;
        // The worlds are equal but for what the list names, so that a difference is a change.
        if (old_id != new_id) {
          const auto gone = truth.changes().find(old_id);
          const auto come = truth.changes().find(new_id);
          ASSERT_TRUE(gone != truth.changes().end() || come != truth.changes().end());
          expected =
              ChangeClassOf(ClassOfInstance(come != truth.changes().end() ? new_id : old_id));
        }
        ASSERT_EQ(static_cast<protocol::ChangeClass>(mask.at<std::uint8_t>(row, column)), expected)
            << row << " " << column;
        classes.insert(static_cast<int>(expected));
      }
    }
  }
  EXPECT_GE(classes.size(), 4U);
}

TEST(ChangeTruth, IsEmptyWithoutChangesThoughSnowHasFallen) {
  const Street summer = MakeStreet(StreetPass::Which::kFirst, true, 0);
  const Street winter = MakeStreet(StreetPass::Which::kSecond, false, 0);
  ChangeTruth truth(WorldDescription(), 3, kPassLengthM, false, 0, PassCamera(), 2);
  InstanceCaster green(summer, PassCamera(), 2);
  InstanceCaster white(winter, PassCamera(), 2);
  bool leaves_fell = false;
  for (const std::size_t frame : {0U, 4U, 8U}) {
    const CameraExposure view = ViewOfFrame(winter, frame);
    EXPECT_EQ(cv::countNonZero(truth.Look(view).mask), 0);
    leaves_fell |= !SamePixels(green.Cast(view), white.Cast(view));
  }
  EXPECT_TRUE(truth.changes().empty());
  EXPECT_TRUE(leaves_fell);
}

TEST(ChangeTruth, DoesNotDependOnThreadsOrOnWhatWasSeenBefore) {
  const Street after = MakeStreet(StreetPass::Which::kSecond, true);
  ChangeTruth one(WorldDescription(), 3, kPassLengthM, true, kShare, PassCamera(), 1);
  ChangeTruth three(WorldDescription(), 3, kPassLengthM, true, kShare, PassCamera(), 3);
  one.Look(ViewOfFrame(after, 9));
  const ChangeView a = one.Look(ViewOfFrame(after, 2));
  const ChangeView b = three.Look(ViewOfFrame(after, 2));
  EXPECT_TRUE(SamePixels(a.mask, b.mask));
  EXPECT_EQ(a.pixels, b.pixels);
  EXPECT_GT(cv::countNonZero(a.mask), 0);
}

TEST(ChangeTruth, ListsWhatItsMasksShow) {
  const Street after = MakeStreet(StreetPass::Which::kSecond, true);
  ChangeTruth truth(WorldDescription(), 3, kPassLengthM, true, kShare, PassCamera(), 2);
  std::size_t shown = 0;
  for (std::size_t frame = 0; frame < 10; ++frame) {
    for (const auto& [instance, pixels] : truth.Look(ViewOfFrame(after, frame)).pixels) {
      EXPECT_EQ(truth.changes().count(instance), 1U) << instance;
      ++shown;
    }
  }
  EXPECT_GT(shown, 20U);
}

TEST(PassDrive, SecondPassKeepsItsDistanceBesideTheFirst) {
  WorldDescription straight;
  straight.pieces = {{400, 0, 0}};
  std::set<bool> sides;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    const Street street(straight, seed, kPassLengthM, true);
    const PassManner manner = DrawSecondManner(seed, 8, 2, 10);
    PassManner beside = manner;
    beside.left_m = 0;
    const PassDrive drive(street, manner, Mounting(), 0);
    const PassDrive middle(street, beside, Mounting(), 0);
    const double left = drive.Camera(5).world_from_optical.translation().y() -
                        middle.Camera(5).world_from_optical.translation().y();
    EXPECT_GE(std::abs(left), 0.29);
    EXPECT_LE(std::abs(left), 0.81);
    EXPECT_NEAR(drive.AlongM(0), manner.start_m, 0.01);
    EXPECT_GE(manner.start_m, 0);
    sides.insert(left > 0);
  }
  EXPECT_EQ(sides.size(), 2U);
}

TEST(PassDrive, FindsTheNearestPicture) {
  const Street street(WorldDescription(), 3, kPassLengthM, true);
  const PassDrive drive(street, PassManner(), Mounting(), 0);
  for (double along = -1; along < 60; along += 0.37) {
    std::size_t best = 0;
    for (std::size_t frame = 0; frame < 120; ++frame) {
      if (std::abs(drive.AlongM(frame) - along) < std::abs(drive.AlongM(best) - along)) {
        best = frame;
      }
    }
    EXPECT_EQ(drive.Nearest(along), best) << along;
  }
}

}  // namespace
}  // namespace livemap::simulation
