// Places as numbers: the projection of the map, and longitudes where east meets west.

const MAX_LATITUDE = 85.0511287798;

/** Around the world once is 1; -180 degrees is 0. */
export function unitX(longitude) {
  return longitude / 360 + 0.5;
}

/** 0 in the north, 1 in the south. */
export function unitY(latitude) {
  const bounded = Math.min(Math.max(latitude, -MAX_LATITUDE), MAX_LATITUDE);
  const sine = Math.sin((bounded * Math.PI) / 180);
  return 0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI);
}

export function longitudeOf(x) {
  return (x - 0.5) * 360;
}

export function latitudeOf(y) {
  return (360 / Math.PI) * Math.atan(Math.exp((0.5 - y) * 2 * Math.PI)) - 90;
}

/** The same meridian, at most half the world from `reference`: 179.9 near -179.8 is -180.1. */
export function nearLongitude(longitude, reference) {
  return longitude + 360 * Math.round((reference - longitude) / 360);
}

/** Between -180 and 180, for people. */
export function wrappedLongitude(longitude) {
  return longitude - 360 * Math.floor((longitude + 180) / 360);
}

/** The shortest stretch of meridians that holds all of `xs` (of unitX): [from, to], and `to` is
 * beyond 1 where it crosses 180 degrees. Null where there are none. */
export function shortestStretch(xs) {
  if (xs.length === 0) return null;
  const sorted = Float64Array.from(xs, (x) => x - Math.floor(x)).sort();
  const last = sorted.length - 1;
  let widest = sorted[0] + 1 - sorted[last];
  let from = 0;
  for (let i = 0; i < last; i += 1) {
    if (sorted[i + 1] - sorted[i] > widest) {
      widest = sorted[i + 1] - sorted[i];
      from = i + 1;
    }
  }
  return from === 0 ? [sorted[0], sorted[last]] : [sorted[from], sorted[from - 1] + 1];
}
