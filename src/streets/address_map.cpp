#include "streets/address_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"
#include "common/text.h"

namespace livemap::streets {
namespace {

constexpr double kAddressUnits = 1e7;      // Per degree.
constexpr double kAddressCellDeg = 0.002;  // Some 200 m.
constexpr double kMaxAddressRadiusM = 200;
constexpr double kMaxAddressLatitudeDeg = 85;
constexpr double kAddressMPerDegree = 111'195;
constexpr std::size_t kMaxAddressText = 256;

std::int64_t AddressCellOf(double degrees) {
  return static_cast<std::int64_t>(std::floor((degrees + 180) / kAddressCellDeg));
}

std::uint64_t AddressKeyOf(std::int64_t row, std::int64_t column) {
  return static_cast<std::uint64_t>(row) << 32U | static_cast<std::uint64_t>(column);
}

bool IsAddressPlace(const geo::GeoPoint& place) {
  return geo::IsValid(place) && std::abs(place.latitude_deg) <= kMaxAddressLatitudeDeg;
}

}  // namespace

std::size_t AddressMap::bytes() const {
  std::size_t texts = texts_.capacity() * sizeof(std::string);
  for (const std::string& text : texts_) texts += text.capacity();
  return texts + addresses_.capacity() * sizeof(Address);
}

std::string AddressMap::NumberNear(const geo::GeoPoint& place, const std::string& street,
                                   double radius_m) const {
  const auto known = street_numbers_.find(street);
  const bool is_asked = IsAddressPlace(place) && radius_m >= 0 && radius_m <= kMaxAddressRadiusM;
  if (known == street_numbers_.end() || !is_asked) return "";
  const double east_m = kAddressMPerDegree * std::cos(place.latitude_deg * geo::kRadiansPerDegree);
  const double up_deg = radius_m / kAddressMPerDegree;
  const double aside_deg = 1.1 * radius_m / east_m;
  const Address* nearest = nullptr;
  double least_m = radius_m;
  for (std::int64_t row = AddressCellOf(place.latitude_deg - up_deg);
       row <= AddressCellOf(place.latitude_deg + up_deg); ++row) {
    const auto first_key = AddressKeyOf(
        row, std::max<std::int64_t>(0, AddressCellOf(place.longitude_deg - aside_deg)));
    const auto last_key = AddressKeyOf(row, AddressCellOf(place.longitude_deg + aside_deg));
    auto address =
        std::lower_bound(addresses_.begin(), addresses_.end(), first_key,
                         [](const Address& one, std::uint64_t key) { return one.cell < key; });
    for (; address != addresses_.end() && address->cell <= last_key; ++address) {
      if (address->street != known->second) continue;
      const double off_m =
          std::hypot(east_m * (address->longitude / kAddressUnits - place.longitude_deg),
                     kAddressMPerDegree * (address->latitude / kAddressUnits - place.latitude_deg));
      if (off_m > least_m || (nearest != nullptr && off_m == least_m)) continue;
      nearest = &*address;
      least_m = off_m;
    }
  }
  return nearest == nullptr ? "" : texts_[nearest->number];
}

std::uint32_t AddressMapBuilder::NumberOf(const std::string& text) {
  const auto [entry, is_new] = text_numbers_.emplace(
      CutUtf8(text, kMaxAddressText), static_cast<std::uint32_t>(map_.texts_.size()));
  if (is_new) map_.texts_.push_back(entry->first);
  return entry->second;
}

void AddressMapBuilder::AddAtNode(const std::string& street, const std::string& number,
                                  std::int64_t node) {
  if (waiting_.size() >= max_addresses_) {
    throw Error("there are more than " + std::to_string(max_addresses_) +
                " house numbers, accepted are at most so many");
  }
  waiting_.push_back({node, NumberOf(street), NumberOf(number)});
}

void AddressMapBuilder::SetPlace(std::int64_t node, const geo::GeoPoint& place,
                                 const std::string& street, const std::string& number) {
  const auto by_node = [](const Waiting& a, const Waiting& b) { return a.node < b.node; };
  if (!sorted_) std::sort(waiting_.begin(), waiting_.end(), by_node);
  sorted_ = true;
  if (!IsAddressPlace(place)) return;
  const auto [begin, end] =
      std::equal_range(waiting_.begin(), waiting_.end(), Waiting{node, 0, 0}, by_node);
  for (auto house = begin; house != end; ++house) Put(place, house->street, house->number);
  if (!street.empty() && !number.empty()) Put(place, NumberOf(street), NumberOf(number));
}

void AddressMapBuilder::Put(const geo::GeoPoint& place, std::uint32_t street,
                            std::uint32_t number) {
  if (map_.addresses_.size() >= max_addresses_) {
    throw Error("there are more than " + std::to_string(max_addresses_) +
                " house numbers, accepted are at most so many");
  }
  map_.addresses_.push_back(
      {AddressKeyOf(AddressCellOf(place.latitude_deg), AddressCellOf(place.longitude_deg)),
       static_cast<std::int32_t>(std::lround(place.latitude_deg * kAddressUnits)),
       static_cast<std::int32_t>(std::lround(place.longitude_deg * kAddressUnits)), street,
       number});
}

AddressMap AddressMapBuilder::Build() {
  std::stable_sort(map_.addresses_.begin(), map_.addresses_.end(),
                   [](const auto& a, const auto& b) { return a.cell < b.cell; });
  map_.addresses_.shrink_to_fit();
  for (const AddressMap::Address& address : map_.addresses_) {
    map_.street_numbers_.emplace(map_.texts_[address.street], address.street);
  }
  AddressMap built = std::move(map_);
  *this = AddressMapBuilder(max_addresses_);
  return built;
}

}  // namespace livemap::streets
