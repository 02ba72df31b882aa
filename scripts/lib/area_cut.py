"""Areas of rings in degrees, what an odd number of rings encloses, cut along lines of the map's cells."""

import bisect
import math

ZOOM = 15  # Of the Web Mercator grid, as geo::MapCell.
CELLS = 1 << ZOOM
LONGITUDE, LATITUDE = 0, 1
KEPT_DIGITS = 7  # A centimetre.


def column_line(index):
    """Longitude of the western edge of a column of cells, degrees."""
    return round(index * 360 / CELLS - 180, KEPT_DIGITS)


def row_line(index):
    """Latitude of the northern edge of a row of cells, degrees; rows are counted from the north."""
    return round(math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * index / CELLS)))), KEPT_DIGITS)


def column_of(longitude):
    return (longitude + 180) / 360 * CELLS


def row_of(latitude):
    return (1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2 * CELLS


def size_of(rings):
    """Square metres, on a sphere, exact enough to share work by."""
    earth_m = 6371000
    total = 0
    for ring in outward(rings):
        for (x, y), (next_x, next_y) in zip(ring, ring[1:] + ring[:1]):
            total += math.radians(next_x - x) * (math.sin(math.radians(y)) + math.sin(math.radians(next_y))) / 2
    return abs(total) * earth_m * earth_m


def contains(rings, point):
    """Whether an odd number of the rings encloses the point [longitude, latitude]."""
    x, y = point
    inside = False
    for ring in rings:
        for (x1, y1), (x2, y2) in zip(ring, ring[1:] + ring[:1]):
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
                inside = not inside
    return inside


def signed_size(ring):
    return sum(x * next_y - next_x * y for (x, y), (next_x, next_y) in zip(ring, ring[1:] + ring[:1])) / 2


def depth_of(ring, rings):
    """How many of the other rings enclose this one. Rings do not cross: a corner that lies on none of them says it."""
    middle = [(a + b) / 2 for a, b in zip(ring[0], ring[1])]
    return sum(1 for other in rings if other is not ring and contains([other], middle))


def outward(rings):
    """Outer rings counterclockwise and holes clockwise, as RFC 7946 has them."""
    return [ring if (signed_size(ring) > 0) == (depth_of(ring, rings) % 2 == 0) else ring[::-1] for ring in rings]


def polygons_of(rings):
    """The coordinates of a GeoJSON MultiPolygon: each outer ring with its holes."""
    rings = outward(rings)
    outer = [ring for ring in rings if depth_of(ring, rings) % 2 == 0]
    polygons = [[ring] for ring in outer]
    for hole in rings:
        if hole in outer:
            continue
        middle = [(a + b) / 2 for a, b in zip(hole[0], hole[1])]
        around = [i for i, ring in enumerate(outer) if contains([ring], middle)]
        # The smallest one that encloses it.
        polygons[min(around, key=lambda i: abs(signed_size(outer[i])))].append(hole)
    return [[ring + ring[:1] for ring in polygon] for polygon in polygons]


def chains_of(ring, axis, line, is_kept):
    """What of a ring lies on the kept side: whole, or as chains whose ends lie on the line."""
    kept = [is_kept(corner[axis]) for corner in ring]
    if all(kept):
        return [ring], []
    chains = []
    for i, corner in enumerate(ring):
        if kept[i] or not kept[(i + 1) % len(ring)]:
            continue
        chain = [crossing(corner, ring[(i + 1) % len(ring)], axis, line)]
        at = (i + 1) % len(ring)
        while kept[at]:
            chain.append(ring[at])
            before, at = ring[at], (at + 1) % len(ring)
        chain.append(crossing(before, ring[at], axis, line))
        chains.append(chain)
    return [], chains


def crossing(a, b, axis, line):
    share = (line - a[axis]) / (b[axis] - a[axis])
    other = round(a[1 - axis] + share * (b[1 - axis] - a[1 - axis]), KEPT_DIGITS)
    return [line, other] if axis == LONGITUDE else [other, line]


def half_of(rings, axis, line, is_upper):
    """The rings of what lies above (or below) the line of that longitude or latitude."""
    whole, chains = [], []
    for ring in rings:
        of_ring, parts = chains_of(ring, axis, line, (lambda x: x >= line) if is_upper else (lambda x: x < line))
        whole += of_ring
        chains += parts
    # Along the line, inside and outside take turns at the chains' ends: neighbours are joined in pairs.
    ends = sorted(((chain[end][1 - axis], i, end) for i, chain in enumerate(chains) for end in (0, -1)),
                  key=lambda entry: entry[0])
    partner = {}
    for (_, i, end), (_, j, other) in zip(ends[::2], ends[1::2]):
        partner[i, end], partner[j, other] = (j, other), (i, end)
    unused = set(range(len(chains)))
    while unused:
        ring, at = [], (min(unused), 0)
        while at[0] in unused:
            chain, begin = at
            unused.discard(chain)
            ring += chains[chain] if begin == 0 else chains[chain][::-1]
            at = partner[chain, -1 if begin == 0 else 0]
        whole.append(ring)
    return [ring for ring in map(without_repeats, whole) if len(ring) >= 3 and signed_size(ring) != 0]


def without_repeats(ring):
    return [corner for i, corner in enumerate(ring) if corner != ring[i - 1]]


def split(rings, parts, places):
    """Areas that together are the given one, `parts` of them, of about equal load: by places [longitude, latitude] in
    it, or by size where there are none. Each cut is one line of cells. None where no line divides an area."""
    if parts == 1:
        return [rings]
    first = parts // 2
    best = None
    for axis in (LONGITUDE, LATITUDE):
        for line in lines_across(rings, axis, places, first / parts):
            lower, upper = half_of(rings, axis, line, False), half_of(rings, axis, line, True)
            if not lower or not upper:
                continue
            if places:
                share = sum(1 for place in places if place[axis] < line) / len(places)
            else:
                share = size_of(lower) / (size_of(lower) + size_of(upper))
            # Of cuts that share alike the shorter one: fewer vehicles cross it.
            rank = (round(abs(share - first / parts), 2), width_along(rings, 1 - axis))
            if best is None or rank < best[0]:
                best = (rank, axis, line, lower, upper)
    if best is None:
        return None
    _, axis, line, lower, upper = best
    halves = (split(lower, first, [place for place in places if place[axis] < line]),
              split(upper, parts - first, [place for place in places if place[axis] >= line]))
    return None if None in halves else halves[0] + halves[1]


def width_along(rings, axis):
    values = [corner[axis] for ring in rings for corner in ring]
    latitude = sum(corner[LATITUDE] for ring in rings for corner in ring) / len(values)
    return (max(values) - min(values)) * (math.cos(math.radians(latitude)) if axis == LONGITUDE else 1)


def lines_across(rings, axis, places, share):
    """Lines of cells near the one that would leave `share` of the load below it."""
    values = [corner[axis] for ring in rings for corner in ring]
    lowest, highest = min(values), max(values)
    index_of, line_of = (column_of, column_line) if axis == LONGITUDE else (row_of, row_line)
    ends = sorted((index_of(lowest), index_of(highest)))
    lines = sorted(line_of(i) for i in range(math.floor(ends[0]), math.ceil(ends[1]) + 1) if lowest < line_of(i) < highest)
    if not lines:
        return []
    if places:
        sorted_places = sorted(place[axis] for place in places)
        wanted = sorted_places[min(int(share * len(sorted_places)), len(sorted_places) - 1)]
    else:
        wanted = middle_of(rings, axis, share)
    at = bisect.bisect(lines, wanted)
    return lines[max(at - 2, 0):at + 2]


def middle_of(rings, axis, share):
    """Where a line would leave that share of the size below it."""
    values = [corner[axis] for ring in rings for corner in ring]
    low, high, whole = min(values), max(values), size_of(rings)
    for _ in range(30):
        line = (low + high) / 2
        if size_of(half_of(rings, axis, line, False)) < share * whole:
            low = line
        else:
            high = line
    return (low + high) / 2
