// What is to be drawn: single signs, and rings where places are dense. Places fall into a grid of
// cells that lies still while one pans; neighbours that stand close together become one.

import { latitudeOf, longitudeOf } from '../mercator.js';

const TILE_PX = 256;
/** Near enough to tell hazards apart on a street, wider where a town is in view. */
const STREET_ZOOM = 16;
const STREET_CELL_PX = 30;
const TOWN_CELL_PX = 60;
const WIDER = 1.4;
/** Of a cell: rings nearer to each other would cover one another. */
const NEAR = 0.75;

class Grid {
  constructor(table, box, zoom, cellPx, pinnedSlot) {
    this.scale = (TILE_PX * 2 ** zoom) / cellPx;
    this.left = Math.floor(box.west * this.scale);
    this.top = Math.floor(box.north * this.scale);
    this.columns = Math.floor(box.east * this.scale) - this.left + 1;
    this.rows = Math.floor(box.south * this.scale) - this.top + 1;
    this.cells = new Map();
    for (let slot = 0; slot < table.records.length; slot += 1) {
      if (table.records[slot] === null || slot === pinnedSlot || !table.isShown(slot)) continue;
      const worlds = table.shiftInto(box, slot);
      if (worlds !== null) this.add(table, slot, table.x[slot] + worlds, table.y[slot]);
    }
  }

  add(table, slot, x, y) {
    const column = Math.floor(x * this.scale) - this.left;
    const row = Math.floor(y * this.scale) - this.top;
    const at = row * this.columns + column;
    let cell = this.cells.get(at);
    if (cell === undefined) {
      cell = { at, column, row, slot, count: 0, sumX: 0, sumY: 0, shares: new Map(),
        west: x, east: x, north: y, south: y };
      this.cells.set(at, cell);
    }
    cell.count += 1;
    cell.sumX += x;
    cell.sumY += y;
    if (x < cell.west) cell.west = x;
    if (x > cell.east) cell.east = x;
    if (y < cell.north) cell.north = y;
    if (y > cell.south) cell.south = y;
    const group = table.group[slot];
    cell.shares.set(group, (cell.shares.get(group) ?? 0) + 1);
  }

  /** The cells, the fullest first; each has taken in those of its neighbours that stand near. */
  merged() {
    const ordered = [...this.cells.values()].sort((a, b) => b.count - a.count || a.at - b.at);
    for (const cell of ordered) {
      if (cell.taken) continue;
      for (let row = cell.row - 1; row <= cell.row + 1; row += 1) {
        for (let column = cell.column - 1; column <= cell.column + 1; column += 1) {
          if (column < 0 || column >= this.columns) continue;
          const other = this.cells.get(row * this.columns + column);
          if (other && other !== cell && !other.taken && this.areNear(cell, other)) join(cell, other);
        }
      }
    }
    return ordered.filter((cell) => !cell.taken);
  }

  areNear(a, b) {
    return Math.hypot(a.sumX / a.count - b.sumX / b.count,
      a.sumY / a.count - b.sumY / b.count) * this.scale < NEAR;
  }
}

function join(cell, other) {
  other.taken = true;
  cell.count += other.count;
  cell.sumX += other.sumX;
  cell.sumY += other.sumY;
  cell.west = Math.min(cell.west, other.west);
  cell.east = Math.max(cell.east, other.east);
  cell.north = Math.min(cell.north, other.north);
  cell.south = Math.max(cell.south, other.south);
  for (const [group, count] of other.shares) {
    cell.shares.set(group, (cell.shares.get(group) ?? 0) + count);
  }
}

function single(table, slot, worlds) {
  const record = table.records[slot];
  return { key: `one ${record.id}`, count: 1, record, latitude: record.latitude,
    longitude: longitudeOf(table.x[slot] + worlds) };
}

function ring(cell, grid, zoom) {
  return {
    key: `ring ${zoom} ${grid.scale} ${cell.column + grid.left} ${cell.row + grid.top}`,
    count: cell.count,
    latitude: latitudeOf(cell.sumY / cell.count),
    longitude: longitudeOf(cell.sumX / cell.count),
    shares: [...cell.shares].sort((a, b) => b[1] - a[1]),
    box: { west: cell.west, east: cell.east, north: cell.north, south: cell.south },
  };
}

/** At most `most` signs for the box of units at this zoom, those in the north first. The record
 * `pinned` is never gathered into a ring. `pinnedIs` says whether that one is 'shown', 'hidden' by
 * the filter or 'gone'. */
export function findSigns(table, { box, zoom, most, pinned = null }) {
  const pinnedSlot = table.slots.get(pinned) ?? -1;
  let cellPx = zoom >= STREET_ZOOM ? STREET_CELL_PX : TOWN_CELL_PX;
  let grid;
  let cells;
  do {
    grid = new Grid(table, box, zoom, cellPx, pinnedSlot);
    cells = grid.cells.size > 4 * most ? null : grid.merged();
    cellPx *= WIDER;
  } while (cells === null || cells.length >= most);
  const signs = cells.map((cell) => {
    if (cell.count > 1) return ring(cell, grid, zoom);
    return single(table, cell.slot, table.shiftInto(box, cell.slot));
  });
  let pinnedIs = 'gone';
  if (pinnedSlot >= 0) {
    pinnedIs = table.isShown(pinnedSlot) ? 'shown' : 'hidden';
    const worlds = table.shiftInto(box, pinnedSlot);
    if (pinnedIs === 'shown' && worlds !== null) {
      signs.push(single(table, pinnedSlot, worlds));
    }
  }
  signs.sort((a, b) => b.latitude - a.latitude || a.longitude - b.longitude);
  return { signs, pinnedIs };
}
