#include "simulation/world/world_file.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <set>
#include <sstream>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"

namespace livemap::simulation {
namespace {

constexpr std::size_t kMaxBytes = 1U << 20U;
constexpr std::size_t kMaxItems = 10000;
constexpr double kSteepest = 0.15;
constexpr double kLongestRoadM = 1e6;

/// One YAML document and its name, for sentences that say where a mistake is.
class WorldFileReader {
 public:
  explicit WorldFileReader(const std::string& name) : name_(name) {}

  [[noreturn]] void Refuse(const YAML::Node& node, const std::string& what) const {
    throw Error("the world file '" + name_ + "', line " + std::to_string(node.Mark().line + 1) +
                ": " + what);
  }

  void CheckKeys(const YAML::Node& map, const std::set<std::string>& known,
                 const std::string& where) const {
    if (!map.IsMap()) Refuse(map, where + " must be a map");
    std::set<std::string> seen;
    for (const auto& entry : map) {
      const std::string key = entry.first.as<std::string>("");
      std::string list;
      for (const std::string& accepted : known) list += (list.empty() ? "" : ", ") + accepted;
      if (known.count(key) == 0) {
        Refuse(entry.first, where + " has no key '" + key + "', accepted are: " + list);
      }
      if (!seen.insert(key).second) Refuse(entry.first, "'" + key + "' is given twice");
    }
  }

  double Number(const YAML::Node& node, const std::string& what, double min, double max) const {
    const std::string text = node.IsScalar() ? node.Scalar() : "no number";
    const std::optional<double> value = datasets::ParseFinite(text);
    if (!value || *value < min || *value > max) {
      std::ostringstream sentence;
      sentence << what << " is '" << text << "', accepted is a number from " << min << " to "
               << max;
      Refuse(node, sentence.str());
    }
    return *value;
  }

  void Read(const YAML::Node& map, const std::string& key, double min, double max,
            double& value) const {
    const YAML::Node node = map[key];
    if (node) value = Number(node, "'" + key + "'", min, max);
  }

  double Need(const YAML::Node& map, const std::string& key, double min, double max) const {
    const YAML::Node node = map[key];
    if (!node) Refuse(map, "'" + key + "' is missing");
    return Number(node, "'" + key + "'", min, max);
  }

  bool Flag(const YAML::Node& node, const std::string& what) const {
    const std::string text = node.IsScalar() ? node.Scalar() : "no word";
    if (text != "true" && text != "false") {
      Refuse(node, what + " is '" + text + "', accepted is true or false");
    }
    return text == "true";
  }

  void CheckList(const YAML::Node& list, const std::string& what) const {
    if (!list.IsSequence()) Refuse(list, what + " must be a list");
    if (list.size() > kMaxItems) {
      Refuse(list, what + " has more than " + std::to_string(kMaxItems) + " entries");
    }
  }

 private:
  const std::string& name_;
};

RoadPiece ReadWorldPiece(const WorldFileReader& reader, const YAML::Node& node) {
  reader.CheckKeys(node, {"length_m", "turn_deg", "climb_m"}, "a piece of the road");
  RoadPiece piece;
  piece.length_m = reader.Need(node, "length_m", 5, 100000);
  reader.Read(node, "turn_deg", -180, 180, piece.turn_deg);
  reader.Read(node, "climb_m", -1000, 1000, piece.climb_m);
  // The sharpest point of a smooth turn or climb is half again as sharp as its mean.
  const double curvature = 1.5 * std::abs(piece.turn_deg) * M_PI / 180 / piece.length_m;
  if (curvature * kTightestRadiusM > 1) {
    reader.Refuse(node, "'turn_deg' " + std::to_string(piece.turn_deg) + " over " +
                            std::to_string(piece.length_m) +
                            " m turns tighter than a radius of 48 m");
  }
  if (1.5 * std::abs(piece.climb_m) / piece.length_m > kSteepest) {
    reader.Refuse(node, "'climb_m' " + std::to_string(piece.climb_m) + " over " +
                            std::to_string(piece.length_m) + " m is steeper than 15 %");
  }
  return piece;
}

void ReadWorldRoad(const WorldFileReader& reader, const YAML::Node& road, RoadSource source,
                   WorldDescription& world) {
  reader.CheckKeys(road,
                   {"bearing_deg", "pieces", "crossings_m", "lane_width_m", "parking_width_m",
                    "pavement_width_m"},
                   "'road'");
  for (const char* key : {"bearing_deg", "pieces"}) {
    if (source == RoadSource::kRoute && road[key]) {
      reader.Refuse(road[key], "'" + std::string(key) + "' and --route exclude each other");
    }
  }
  reader.Read(road, "bearing_deg", 0, 360, world.bearing_deg);
  reader.Read(road, "lane_width_m", 2.5, 4.5, world.lane_width_m);
  reader.Read(road, "parking_width_m", 0, 3, world.parking_width_m);
  reader.Read(road, "pavement_width_m", 1, 6, world.pavement_width_m);
  if (const YAML::Node pieces = road["pieces"]) {
    reader.CheckList(pieces, "'pieces'");
    double length_m = 0;
    for (const YAML::Node& piece : pieces) {
      world.pieces.push_back(ReadWorldPiece(reader, piece));
      length_m += world.pieces.back().length_m;
      if (length_m > kLongestRoadM) reader.Refuse(piece, "the road is longer than 1000 km here");
    }
  }
  if (const YAML::Node crossings = road["crossings_m"]) {
    reader.CheckList(crossings, "'crossings_m'");
    world.crossings_m.emplace();
    for (const YAML::Node& crossing : crossings) {
      const double at_m = reader.Number(crossing, "a crossing", 0, 1e6);
      if (!world.crossings_m->empty() && at_m < world.crossings_m->back() + 40) {
        reader.Refuse(crossing, "crossings must come in order, at least 40 m apart");
      }
      world.crossings_m->push_back(at_m);
    }
  }
}

PlacedHazard ReadWorldHazard(const WorldFileReader& reader, const YAML::Node& node) {
  reader.CheckKeys(node, {"class", "at_m", "left_m", "radius_m", "water"}, "a hazard");
  const YAML::Node name = node["class"];
  if (!name) reader.Refuse(node, "'class' is missing");
  const std::string text = name.IsScalar() ? name.Scalar() : "no word";
  const std::optional<ObjectClass> object_class = ClassByName(text);
  if (!object_class || !IsHazard(*object_class)) {
    std::string list;
    for (const ObjectClass known : HazardClasses()) {
      list += (list.empty() ? "" : ", ") + std::string(ClassName(known));
    }
    reader.Refuse(name, "'class' is '" + text + "', accepted are: " + list);
  }
  PlacedHazard hazard;
  hazard.object_class = *object_class;
  hazard.at_m = reader.Need(node, "at_m", 0, 1e6);
  hazard.left_m = reader.Need(node, "left_m", -12, 12);
  const bool pothole = *object_class == ObjectClass::kPothole;
  for (const char* key : {"radius_m", "water"}) {
    if (node[key] && !pothole) {
      reader.Refuse(node[key], "'" + std::string(key) + "' belongs to potholes only");
    }
  }
  reader.Read(node, "radius_m", 0.1, 0.8, hazard.radius_m);
  if (node["water"]) hazard.water = reader.Flag(node["water"], "'water'");
  return hazard;
}

WorldDescription ParseWorld(const WorldFileReader& reader, const YAML::Node& root,
                            RoadSource source) {
  reader.CheckKeys(root, {"road", "scene", "hazards"}, "the file");
  WorldDescription world;
  if (const YAML::Node road = root["road"]) ReadWorldRoad(reader, road, source, world);
  if (const YAML::Node scene = root["scene"]) {
    reader.CheckKeys(scene, {"buildings", "trees", "parked_cars"}, "'scene'");
    if (scene["buildings"]) world.buildings = reader.Flag(scene["buildings"], "'buildings'");
    if (scene["trees"]) world.trees = reader.Flag(scene["trees"], "'trees'");
    if (scene["parked_cars"]) {
      world.parked_cars = reader.Flag(scene["parked_cars"], "'parked_cars'");
    }
  }
  if (const YAML::Node hazards = root["hazards"]) {
    reader.CheckList(hazards, "'hazards'");
    world.hazards.emplace();
    for (const YAML::Node& hazard : hazards) {
      world.hazards->push_back(ReadWorldHazard(reader, hazard));
    }
  }
  return world;
}

}  // namespace

WorldDescription ParseWorldFile(const std::string& yaml, const std::string& name,
                                RoadSource source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& exception) {
    throw Error("the world file '" + name + "', line " + std::to_string(exception.mark.line + 1) +
                ": no YAML: " + exception.msg);
  }
  if (!root.IsMap()) throw Error("the world file '" + name + "', line 1: must be a map");
  return ParseWorld(WorldFileReader(name), root, source);
}

WorldDescription ReadWorldFile(const std::string& path, RoadSource source) {
  return ParseWorldFile(ReadTextFile(path, kMaxBytes), path, source);
}

}  // namespace livemap::simulation
