#pragma once

#include <optional>
#include <string>

#include "geo/wgs84.h"
#include "streets/address_map.h"
#include "streets/street_map.h"

namespace livemap::streets {

/// A place near the streets, as it was reported: where, how surely, and which way was driven there.
struct Spot {
  geo::GeoPoint place;
  double sigma_m = 0;     ///< Standard deviation of the place along its worst direction, m.
  double course_rad = 0;  ///< Of who passed it, clockwise from north; NaN where it is not known.
};

/// The street on which a spot lies.
struct Carriageway {
  Travel travel;           ///< The segment; its direction counts where `is_directed`.
  bool is_directed;        ///< It is known in which direction the spot was passed.
  bool is_certain;         ///< No other carriageway, driven the other way, is nearly as likely.
  double bearing_rad = 0;  ///< Of `travel`, clockwise from north.
};

/// The likeliest street of a spot: by its distance, measured in what is known of the place and of
/// the map, and by the angle between the course and the directions in which the street may be
/// driven. So of two carriageways the one that is driven that way counts, though the other one lies
/// nearer. None where no street is within 25 m and twice the spot's sigma, at most 60 m.
std::optional<Carriageway> FindCarriageway(const StreetMap& map, const Spot& spot);

/// Whether two spots lie on carriageways that no vehicle drives in the same direction: both
/// certain, both of one-way streets, and driven at more than 120 degrees to each other.
bool LieOnOppositeCarriageways(const StreetMap& map, const Carriageway& a, const Carriageway& b);

/// A place in people's words: "Forbes Ave", near "S Craig St", "eastbound".
struct StreetWords {
  std::string street;     ///< Empty where it lies on no street, or on one without a name.
  std::string near;       ///< The nearest street that crosses it, or house: "no. 4200"; or empty.
  std::string direction;  ///< "northbound", "eastbound", "southbound", "westbound" or empty.
  std::string note;       ///< Why the street, else the direction, is not known; empty: they are.
};

/// Describes where a spot lies. A crossing within 50 m along the street counts first, then the
/// nearest house of the street within 40 m where `addresses` are given, then a crossing within 400
/// m. `direction` is the street's at the place, by the quarter of the compass in which it lies.
StreetWords DescribeSpot(const StreetMap& map, const Spot& spot,
                         const AddressMap* addresses = nullptr);

}  // namespace livemap::streets
