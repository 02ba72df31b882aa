#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "simulation/objects/noise.h"
#include "simulation/objects/object_class.h"

namespace livemap::simulation {

/// How a surface is painted at the hit point; `uv` means what the comment says.
enum class MaterialKind : std::uint8_t {
  kGround,       ///< uv: metres along the road and left of its middle line; the street decides.
  kBrick,        ///< uv: metres along and up the wall.
  kPlaster,      ///< As kBrick.
  kConcrete,     ///< As kBrick.
  kRoofTiles,    ///< As kBrick, up the slope.
  kWindow,       ///< uv: 0..1 over the pane.
  kShopWindow,   ///< As kWindow.
  kDoor,         ///< As kWindow.
  kBark,         ///< uv: metres around and up the trunk.
  kLeaf,         ///< uv unused.
  kHedge,        ///< uv: metres.
  kPlain,        ///< Even colour; uv unused.
  kMetal,        ///< Even colour with a sheen.
  kCarPaint,     ///< uv: metres along and up the car.
  kCarGlass,     ///< uv unused.
  kRubber,       ///< uv unused.
  kWood,         ///< uv: metres across and along the grain.
  kFur,          ///< uv: metres.
  kCone,         ///< uv.y: height over the whole, 0..1.
  kStripes,      ///< uv: metres; slanted stripes of both colours.
  kWorkSign,     ///< uv: 0..1 over the plate; triangle with a digging person.
  kDiamondSign,  ///< As kWorkSign: orange plate.
  kClosedSign,   ///< As kWorkSign: round, red ring.
  kTrafficSign,  ///< As kWorkSign: an ordinary sign.
  kLight,        ///< Shines by itself at dusk and in the rain, colour; else pale.
};

struct Material {
  MaterialKind kind = MaterialKind::kPlain;
  Vec3 colour = Vec3(0.5F, 0.5F, 0.5F);  ///< Linear reflectance.
  Vec3 accent = Vec3(1, 1, 1);           ///< Second colour of patterns.
  std::uint32_t seed = 0;                ///< Of its texture.
};

struct Triangle {
  std::uint32_t corners[3] = {0, 0, 0};
  std::uint16_t material = 0;
  std::uint32_t instance = 0;
};

/// Triangles with normals, texture coordinates and how much of the sky each vertex sees.
struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> uvs;
  std::vector<float> openness;  ///< 0..1, occlusion by the object's own parts.
  std::vector<Triangle> triangles;
  std::vector<Material> materials;
};

/// Puts simple bodies into a mesh. Lengths in metres, in the frame given last.
class MeshBuilder {
 public:
  explicit MeshBuilder(Mesh& mesh) : mesh_(mesh) {}

  void SetFrame(const Eigen::Affine3f& mesh_from_local) { frame_ = mesh_from_local; }
  const Eigen::Affine3f& frame() const { return frame_; }
  void SetInstance(std::uint32_t instance) { instance_ = instance; }
  void SetOpenness(float openness) { openness_ = openness; }
  /// Adds a material and uses it from now on.
  std::uint16_t SetMaterial(const Material& material);
  void UseMaterial(std::uint16_t index) { material_ = index; }

  std::uint32_t AddVertex(const Vec3& position, const Vec3& normal, const Vec2& uv);
  void AddTriangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
  /// Corners counter-clockwise as seen from outside; uv from `low` at the first to `high` at the
  /// third corner.
  void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, const Vec2& low,
               const Vec2& high);
  /// uv in metres.
  void AddBox(const Vec3& low, const Vec3& high);
  /// A body of revolution about z: `profile` holds (radius, height) from bottom to top; uv.x metres
  /// around, uv.y height.
  void AddLathe(const std::vector<Vec2>& profile, int sides);
  /// A cone's trunk between two points; uv in metres.
  void AddTube(const Vec3& from, const Vec3& to, float from_radius, float to_radius, int sides);
  void AddEllipsoid(const Vec3& centre, const Vec3& radii, int sides);
  /// A flat disc facing `normal`, uv 0..1 over its square.
  void AddDisc(const Vec3& centre, const Vec3& normal, float radius, int sides);

 private:
  Mesh& mesh_;
  Eigen::Affine3f frame_ = Eigen::Affine3f::Identity();
  std::uint32_t instance_ = 0;
  std::uint16_t material_ = 0;
  float openness_ = 1;
};

}  // namespace livemap::simulation
