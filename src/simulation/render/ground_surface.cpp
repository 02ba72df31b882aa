#include <cmath>

#include "simulation/render/surface.h"

namespace livemap::simulation {
namespace {

/// What a pixel covers along and across the road, metres.
struct Footprint {
  float along;
  float across;
  float mean;
};

Footprint GroundFootprintOf(const SurfacePoint& point, float along_share) {
  const float extra = point.width_m * (point.stretch - 1);
  return {point.width_m + extra * along_share, point.width_m + extra * (1 - along_share),
          point.width_m * std::sqrt(point.stretch)};
}

class GroundSurfacePainter {
 public:
  GroundSurfacePainter(const GroundPlan& plan, const SurfacePoint& point, float along_share,
                       const Lighting& lighting)
      : plan_(plan),
        point_(point),
        lighting_(lighting),
        along_(point.uv.x()),
        left_(point.uv.y()),
        away_(std::abs(left_)),
        footprint_(GroundFootprintOf(point, along_share)) {
    foot_ = plan.KerbFoot(along_, &crossing_);
    surface_.openness = point.openness;
    surface_.normal = point.normal;
  }

  Surface Paint() {
    const float beyond = away_ - foot_;
    if (beyond <= 0) {
      Road();
    } else if (beyond < kKerbWidthM) {
      Kerb();
    } else if (beyond < kKerbWidthM + plan_.profile.pavement_width_m) {
      Pavement();
    } else {
      Grass();
    }
    return surface_;
  }

 private:
  void SetClass(ObjectClass object_class) { surface_.instance = MakeInstance(0, object_class); }
  float Grain(float size, std::uint32_t salt) const {
    const float left = DetailLeft(size, footprint_.mean);
    return left <= 0 ? 0 : left * Noise(along_ / size, left_ / size, plan_.seed + salt);
  }

  void Road() {
    SetClass(ObjectClass::kRoad);
    const float half_lane = 0.5F * plan_.profile.lane_width_m;
    const float in_lane = std::abs(away_ - half_lane);
    const float tracks = std::exp(-12.0F * (in_lane - 0.78F) * (in_lane - 0.78F));
    const float oil = std::exp(-9.0F * in_lane * in_lane);
    const float driven = away_ < plan_.profile.lane_width_m ? 1.0F : 0.2F;
    wide_ = FractalNoise(along_, left_ * 1.7F, 3.1F, 3, footprint_.mean, plan_.seed + 1);
    float grey = 0.118F * (1 + 0.22F * wide_);
    grey *= 1 + driven * (0.10F * tracks - 0.13F * oil);
    grey *= 1 - 0.25F * SmoothStep(foot_ - 0.55F, foot_ - 0.05F, away_);
    Aggregate(grey, 1);
    Cracks(grey);
    Vec3 colour = Vec3(1.02F, 1.0F, 0.965F) * grey;
    Repairs(colour);
    Manholes(colour);
    Markings(colour);
    Potholes(colour);
    surface_.colour = colour;
    surface_.sheen = 0.015F;
    Weather(tracks * driven);
  }

  void Aggregate(float& grey, float strength) const {
    // Stones of two sizes: light and dark chips in bitumen.
    const float coarse = DetailLeft(0.022F, footprint_.mean);
    if (coarse > 0) {
      const Cell cell = CellNoise(along_ / 0.016F, left_ / 0.016F, plan_.seed + 5);
      const float stone = 0.55F + 0.9F * UnitFloat(HashBits(cell.hash)) - 0.75F * cell.nearest;
      grey *= 1 + strength * coarse * 0.58F * (stone - 0.55F);
    }
    grey *= 1 + strength *
                    (0.12F * Grain(0.05F, 7) + 0.09F * Grain(0.16F, 8) + 0.16F * Grain(0.009F, 9));
  }

  void Cracks(float& grey) const {
    const float visible = DetailLeft(0.05F, footprint_.mean * 0.6F);
    if (visible <= 0) return;
    const float damage =
        SmoothStep(0.22F, 0.6F, Noise(along_ / 5.3F, left_ / 2.7F, plan_.seed + 12));
    if (damage > 0) {
      const float bend_x = 0.3F * Noise(along_ * 2.3F, left_ * 2.3F, plan_.seed + 13) +
                           0.07F * Noise(along_ * 11, left_ * 11, plan_.seed + 10);
      const float bend_y = 0.3F * Noise(along_ * 2.3F, left_ * 2.3F, plan_.seed + 14) +
                           0.07F * Noise(along_ * 11, left_ * 11, plan_.seed + 11);
      const Cell cell = CellNoise(along_ / 0.62F + bend_x, left_ / 0.48F + bend_y, plan_.seed + 15);
      const float gap = cell.second - cell.nearest;
      grey *= 1 - 0.72F * visible * damage * (1 - SmoothStep(0.004F, 0.028F, gap));
    }
    // The seam between two lanes of paving, sealed here and there with tar.
    const float seam = left_ - 0.18F + 0.035F * Noise(along_ * 0.9F, 0.5F, plan_.seed + 16);
    const float line = FilteredBand(-0.006F, 0.008F, seam, footprint_.across);
    grey *= 1 - 0.6F * line;
    const float tar = left_ + 0.62F * plan_.profile.lane_width_m +
                      0.25F * Noise(along_ * 0.35F, 3.5F, plan_.seed + 17);
    if (Noise(along_ / 9, 5.5F, plan_.seed + 18) > 0.1F) {
      grey *= 1 - 0.62F * FilteredBand(-0.025F, 0.025F, tar, footprint_.across);
    }
  }

  void Repairs(Vec3& colour) const {
    for (const Repair& repair : plan_.repairs) {
      if (along_ < repair.low.x() - 0.15F || along_ > repair.high.x() + 0.15F ||
          left_ < repair.low.y() - 0.15F || left_ > repair.high.y() + 0.15F) {
        continue;
      }
      const float wobble = 0.03F * Noise(along_ * 2.1F, left_ * 2.1F, repair.seed);
      const float dx = std::min(along_ - repair.low.x(), repair.high.x() - along_) + wobble;
      const float dy = std::min(left_ - repair.low.y(), repair.high.y() - left_) + wobble;
      const float inside = std::min(dx, dy);
      if (inside < -0.1F) continue;
      const float share = SmoothStep(-footprint_.mean, footprint_.mean + 0.005F, inside);
      const float tone = (repair.seed & 1U) != 0 ? 0.62F : 0.80F;
      const float border =
          FilteredBand(-0.035F, 0.03F, inside, 0.5F * (footprint_.along + footprint_.across));
      const float own = 1 + 0.1F * Noise(along_ * 1.7F, left_ * 1.7F, repair.seed + 1);
      colour *= Blend(1.0F, tone * own, share) * (1 - 0.35F * border);
    }
  }

  void Manholes(Vec3& colour) {
    for (const Manhole& hole : plan_.manholes) {
      const float x = along_ - hole.along_m;
      const float y = left_ - hole.left_m;
      if (std::abs(x) > 1 || std::abs(y) > 1) continue;
      const float r = std::sqrt(x * x + y * y);
      if (r > hole.radius_m + 0.16F) continue;
      const float soft = footprint_.mean + 0.004F;
      const float collar =
          1 - SmoothStep(hole.radius_m + 0.07F - soft, hole.radius_m + 0.07F + soft, r);
      colour = Blend(colour, Vec3(0.15F, 0.145F, 0.14F), 0.7F * collar);
      const float lid = 1 - SmoothStep(hole.radius_m - soft, hole.radius_m + soft, r);
      const float studs = DetailLeft(0.05F, footprint_.mean) *
                          std::max(0.0F, std::sin(x * 105) * std::sin(y * 105));
      const float groove =
          FilteredBand(-0.012F, 0.012F, r - 0.88F * hole.radius_m, footprint_.mean);
      const Vec3 iron = Vec3(0.075F, 0.066F, 0.058F) * (0.75F + 0.9F * studs - 0.5F * groove);
      colour = Blend(colour, iron, lid);
    }
  }

  float Paintwork() const {
    float lane = 0;
    const float at_junction = std::abs(crossing_);
    const float stop = kSideRoadHalfM + kCornerRadiusM;
    if (at_junction > stop - 0.5F) {
      const float dashes = FilteredStripes(3.0F, 7.5F, along_, footprint_.along);
      lane += dashes * FilteredBand(-0.065F, 0.065F, left_, footprint_.across);
    }
    if (plan_.profile.parking_width_m > 1 && at_junction > stop) {
      const float edge = away_ - plan_.profile.lane_width_m - 0.05F;
      lane += FilteredStripes(0.9F, 1.8F, along_, footprint_.along) *
              FilteredBand(-0.05F, 0.05F, edge, footprint_.across);
    }
    // A zebra before and after each junction, a stop line on the side roads.
    const float zebra = FilteredBand(stop + 0.4F, stop + 3.2F, at_junction, footprint_.along);
    if (zebra > 0) {
      lane = std::max(lane * (1 - zebra),
                      zebra * FilteredStripes(0.5F, 1.0F, left_ + 100.25F, footprint_.across) *
                          (away_ < foot_ - 0.35F ? 1.0F : 0.0F));
    }
    if (at_junction < kSideRoadHalfM) {
      const float out = away_ - plan_.profile.half_road_m() - 1.4F;
      lane += FilteredBand(0, 0.4F, out, footprint_.across) * (left_ * crossing_ < 0 ? 1.0F : 0.0F);
      lane += FilteredBand(-0.06F, 0.06F, crossing_, footprint_.along) *
              FilteredStripes(2, 5, away_, footprint_.across) * (out > 1 ? 1.0F : 0.0F);
    }
    return std::min(lane, 1.0F);
  }

  void Markings(Vec3& colour) const {
    float paint = Paintwork();
    if (paint <= 0) return;
    const float worn = FractalNoise(along_, left_, 0.35F, 4, footprint_.mean, plan_.seed + 20);
    const float chips = Grain(0.02F, 21);
    paint *= 0.90F - 0.85F * SmoothStep(0.12F, 0.6F, worn + 0.35F * chips + 0.25F * wide_);
    colour = Blend(colour, Vec3(0.60F, 0.595F, 0.56F) * (1 + 0.12F * worn), paint);
  }

  void Potholes(Vec3& colour) {
    for (const Pothole& hole : plan_.potholes) {
      const float x = along_ - hole.along_m;
      const float y = left_ - hole.left_m;
      if (x * x + y * y > 4 * hole.radius_m * hole.radius_m) continue;
      const float reach = hole.Reach(along_, left_);
      if (reach > 1.35F) continue;
      const float rim = SmoothStep(1.35F, 1.0F, reach) * (0.6F + 0.4F * Grain(0.05F, 30));
      colour *= 1 - 0.22F * rim;
      if (reach >= 1) continue;
      surface_.instance = hole.instance;
      const float dent = hole.Dent(along_, left_);
      const float wall = SmoothStep(0.6F, 0.86F, reach) * (1 - SmoothStep(0.95F, 1.0F, reach));
      float rubble = 0.075F * (1 + 0.3F * Grain(0.03F, 31) + 0.35F * Grain(0.075F, 32));
      Aggregate(rubble, 1.4F);
      colour = Vec3(1.08F, 0.97F, 0.84F) * rubble * (1 - 0.45F * wall);
      if (dent <= hole.WaterLevel()) {
        colour = Vec3(0.075F, 0.062F, 0.048F);
        surface_.mirror = 0.9F;
        surface_.normal = Vec3::UnitZ();
      } else if (hole.water_m > 0) {
        colour *= 0.6F;
        surface_.sheen = 0.03F;
      }
    }
  }

  void Kerb() {
    SetClass(ObjectClass::kKerb);
    const float joint = FilteredStripes(0.012F, 1.0F, along_, footprint_.along);
    const float tone =
        1 + 0.2F * FractalNoise(along_, left_, 0.5F, 4, footprint_.mean, plan_.seed + 60);
    surface_.colour = Vec3(0.30F, 0.295F, 0.28F) * tone * (1 - 0.6F * joint);
    if (std::abs(point_.normal.z()) < 0.5F) surface_.colour *= 0.8F;
    Weather(0);
  }

  void Pavement() {
    SetClass(ObjectClass::kPavement);
    constexpr float kSlabM = 0.5F;
    const float row = std::floor((left_ + 100) / kSlabM);
    const float shifted = along_ + (std::fmod(row, 2.0F) > 0.5F ? 0.5F * kSlabM : 0);
    const float joint = std::max(FilteredStripes(0.012F, kSlabM, shifted, footprint_.along),
                                 FilteredStripes(0.012F, kSlabM, left_ + 100, footprint_.across));
    const std::uint32_t slab =
        HashLattice(FloorToInt(shifted / kSlabM), static_cast<std::int32_t>(row), plan_.seed + 61);
    const float own = DetailLeft(kSlabM, footprint_.mean) * (UnitFloat(slab) - 0.5F);
    float tone = 0.27F * (1 + 0.22F * own);
    tone *= 1 + 0.2F * FractalNoise(along_, left_, 1.4F, 4, footprint_.mean, plan_.seed + 62) +
            0.10F * Grain(0.012F, 63);
    surface_.colour = Vec3(1.02F, 0.99F, 0.93F) * tone * (1 - 0.55F * joint);
    Weather(0);
  }

  void Grass() {
    SetClass(ObjectClass::kGrass);
    const float wide = FractalNoise(along_, left_, 2.6F, 4, footprint_.mean, plan_.seed + 70);
    const float blades = Grain(0.02F, 74) + 0.8F * Grain(0.055F, 75);
    const Vec3 fresh(0.085F, 0.165F, 0.035F);
    const Vec3 dry(0.185F, 0.185F, 0.07F);
    surface_.colour = Blend(fresh, dry, Saturate(0.35F + 0.6F * wide)) * (1 + 0.38F * blades);
    surface_.through = 0.1F;
    Weather(0);
  }

  /// Wet and white. `tracks` is how much wheels have cleaned the place.
  void Weather(float tracks) {
    if (surface_.mirror > 0.5F) return;
    // In dry weather only road has anything to show here.
    const bool dry = lighting_.wetness <= 0 && lighting_.snow <= 0;
    if (dry &&
        (away_ > foot_ || Noise(along_ / 2.2F, left_ * 1.4F / 2.2F, plan_.seed + 80) < 0.35F)) {
      return;
    }
    const bool paved = away_ - foot_ < kKerbWidthM + plan_.profile.pavement_width_m;
    const float low = FractalNoise(along_, left_ * 1.4F, 2.2F, 3, footprint_.mean, plan_.seed + 80);
    if (lighting_.wetness > 0.5F && paved && point_.normal.z() > 0.7F) {
      const float gutter = SmoothStep(foot_ - 0.6F, foot_ - 0.1F, away_) * (away_ < foot_ ? 1 : 0);
      const float pool = SmoothStep(0.20F, 0.30F, low + 0.32F * gutter);
      surface_.colour *= Blend(0.50F, 0.38F, pool);
      surface_.mirror = Blend(0.40F, 0.95F, pool) * (away_ < foot_ ? 1.0F : 0.6F);
      const float ripple = (1 - 0.7F * pool) * 0.05F * DetailLeft(0.05F, footprint_.mean);
      surface_.normal = (surface_.normal + ripple * Vec3(Noise(along_ * 40, left_ * 40, 1),
                                                         Noise(along_ * 40, left_ * 40, 2), 0))
                            .normalized();
    } else if (lighting_.wetness <= 0 && away_ < foot_ && low > 0.52F) {
      // A little water is left in dips long after the rain.
      const float damp = SmoothStep(0.52F, 0.60F, low);
      surface_.colour *= 1 - 0.45F * damp;
      surface_.mirror = 0.6F * SmoothStep(0.58F, 0.62F, low);
    }
    if (lighting_.snow > 0) Snow(tracks, low);
  }

  void Snow(float tracks, float low) {
    const float fine = FractalNoise(along_, left_, 0.4F, 4, footprint_.mean, plan_.seed + 81);
    const bool hole = IsHazard(ClassOfInstance(surface_.instance));
    float cover = 0.95F + 0.3F * low;
    if (away_ < foot_) {
      const float lane = away_ < plan_.profile.lane_width_m ? 1.0F : 0.25F;
      cover = 0.80F + 0.55F * low - 0.30F * lane - 0.75F * tracks;
      if (hole) cover -= 0.45F;
    } else if (away_ < foot_ + kKerbWidthM + plan_.profile.pavement_width_m) {
      cover = 0.92F + 0.45F * low;
    }
    const float share = SmoothStep(0.22F, 0.62F, cover + 0.35F * fine);
    const Vec3 slush(0.42F, 0.41F, 0.40F);
    const Vec3 white(0.86F, 0.88F, 0.91F);
    surface_.colour =
        Blend(surface_.colour * 0.62F, Blend(slush, white, SmoothStep(0.35F, 0.9F, cover)),
              share * (0.94F + 0.06F * Grain(0.03F, 83)));
    surface_.mirror *= 1 - share;
    if (away_ < foot_) surface_.sheen = 0.05F * (1 - share);
  }

  const GroundPlan& plan_;
  const SurfacePoint& point_;
  const Lighting& lighting_;
  const float along_;
  const float left_;
  const float away_;
  const Footprint footprint_;
  float foot_ = 0;
  float crossing_ = 0;
  float wide_ = 0;
  Surface surface_;
};

}  // namespace

Surface PaintGround(const GroundPlan& plan, const SurfacePoint& point, float along_share,
                    const Lighting& lighting) {
  return GroundSurfacePainter(plan, point, along_share, lighting).Paint();
}

}  // namespace livemap::simulation
