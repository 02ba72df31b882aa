#include "zone/pictures/picture_allowance.h"

#include "common/error.h"

namespace livemap::zone {
namespace {

constexpr double kAnHourS = 3600;

KeyedTokenBuckets<2>::Buckets PictureBuckets(const PictureAllowance::Config& config) {
  if (!(config.pixels_per_hour >= 1) || !(config.bytes_per_hour >= 1) || config.max_vehicles < 1) {
    throw Error(
        "pixels and bytes per vehicle and hour, and the number of vehicles, must be at least 1");
  }
  return {TokenBucket({config.pixels_per_hour, kAnHourS}),
          TokenBucket({config.bytes_per_hour, kAnHourS})};
}

}  // namespace

const char* PictureRefusalName(PictureRefusal refusal) {
  switch (refusal) {
    case PictureRefusal::kTooCostly:
      return "too_costly";
    case PictureRefusal::kTooMany:
      return "too_many";
  }
  return "unknown";
}

PictureAllowance::PictureAllowance(const Config& config)
    : buckets_(PictureBuckets(config), config.max_vehicles,
               KeyedTokenBuckets<2>::Eviction::kOnlyFull) {}

std::optional<PictureCost> PictureAllowance::Ask(const std::string& vehicle_id,
                                                 const std::vector<std::uint8_t>& image,
                                                 const PictureCost& reserved, std::int64_t now_ns) {
  const PictureCost cost{DecodingWork(image), static_cast<std::int64_t>(image.size())};
  if (cost.px > limits_.max_work_px) return Refuse(PictureRefusal::kTooCostly);
  const auto* buckets = buckets_.Use(vehicle_id, now_ns);
  const bool has_room = buckets != nullptr &&
                        (*buckets)[0].tokens() >= static_cast<double>(reserved.px + cost.px) &&
                        (*buckets)[1].tokens() >= static_cast<double>(reserved.bytes + cost.bytes);
  if (!has_room) return Refuse(PictureRefusal::kTooMany);
  return cost;
}

void PictureAllowance::Spend(const std::string& vehicle_id, const PictureCost& cost,
                             std::int64_t now_ns) {
  auto* buckets = buckets_.Use(vehicle_id, now_ns);
  if (buckets == nullptr) return;
  (*buckets)[0].Spend(static_cast<double>(cost.px));
  (*buckets)[1].Spend(static_cast<double>(cost.bytes));
}

std::nullopt_t PictureAllowance::Refuse(PictureRefusal refusal) {
  ++refused_[static_cast<std::size_t>(refusal)];
  return std::nullopt;
}

std::array<std::uint64_t, kPictureRefusals> PictureAllowance::refused() const {
  std::array<std::uint64_t, kPictureRefusals> counts{};
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = refused_[i];
  return counts;
}

}  // namespace livemap::zone
