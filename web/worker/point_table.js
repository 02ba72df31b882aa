// Many hazards, or map changes, with what is asked of them: what stands in a box, and which are the
// newest. A box is answered by one pass over plain arrays of numbers, which takes milliseconds for
// a hundred thousand and needs no index that every event would have to mend.

import { unitX, unitY } from '../mercator.js';

const FIRST_CAPACITY = 1024;

/** Whether every one of `words`, in small letters, stands in what one knows of the record. */
function holds(record, words) {
  const { label, className, street, near, bound } = record;
  const text = `${label} ${className} ${street ?? ''} ${near ?? ''} ${bound ?? ''}`.toLowerCase();
  return words.every((word) => text.includes(word));
}

function grown(array, capacity) {
  const larger = new array.constructor(capacity);
  larger.set(array);
  return larger;
}

/** Whether the place lies within the corners, by how many edges lie to its east. */
function isWithin(corners, x, y) {
  let inside = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i, i += 1) {
    const [xi, yi] = corners[i];
    const [xj, yj] = corners[j];
    if ((yi > y) !== (yj > y) && x < xi + ((xj - xi) * (y - yi)) / (yj - yi)) inside = !inside;
  }
  return inside;
}

export class PointTable {
  /** `groupOf(record)` and `stateOf(record)` answer small numbers by which records are hidden. */
  constructor(groupOf, stateOf) {
    this.groupOf = groupOf;
    this.stateOf = stateOf;
    this.hiddenGroups = new Uint8Array(256);
    this.hiddenStates = new Uint8Array(256);
    /** Only records of these ids are shown; null: of all. */
    this.onlyIds = null;
    /** Only what lies within these corners, [x, y] in units, is shown; null: everything. */
    this.area = null;
    /** Only records whose `time` lies between `after` and `before`, in ms since 1970, are shown;
     * null: of every age. */
    this.age = null;
    this.clear();
  }

  clear() {
    this.slots = new Map();
    this.records = [];
    this.free = [];
    this.x = new Float64Array(FIRST_CAPACITY);
    this.y = new Float64Array(FIRST_CAPACITY);
    this.group = new Uint8Array(FIRST_CAPACITY);
    this.state = new Uint8Array(FIRST_CAPACITY);
    /** Slots, the newest first. */
    this.order = new Uint32Array(FIRST_CAPACITY);
    this.groupCounts = new Uint32Array(256);
    this.stateCounts = new Uint32Array(256);
  }

  get size() {
    return this.slots.size;
  }

  all() {
    return this.records.filter((record) => record !== null);
  }

  get(id) {
    return this.records[this.slots.get(id)] ?? null;
  }

  /** All at once, each id once: far cheaper than one after the other. */
  replaceAll(records) {
    this.clear();
    for (const record of records) this.store(record);
    // They come in the order of their sequence, which is nearly that of time: sorted soon.
    const slots = Array.from({ length: this.records.length }, (_, i) => this.records.length - 1 - i);
    slots.sort((a, b) => this.compare(a, b));
    this.order.set(slots);
  }

  put(record) {
    this.remove(record.id);
    const slot = this.store(record);
    const at = this.place(slot, this.size - 1);
    this.order.copyWithin(at + 1, at, this.size - 1);
    this.order[at] = slot;
  }

  remove(id) {
    const slot = this.slots.get(id);
    if (slot === undefined) return;
    const at = this.place(slot, this.size);
    this.order.copyWithin(at, at + 1, this.size);
    this.slots.delete(id);
    this.records[slot] = null;
    this.free.push(slot);
    this.groupCounts[this.group[slot]] -= 1;
    this.stateCounts[this.state[slot]] -= 1;
  }

  store(record) {
    const slot = this.free.pop() ?? this.records.length;
    if (slot >= this.x.length) this.grow();
    this.slots.set(record.id, slot);
    this.records[slot] = record;
    const x = unitX(record.longitude);
    this.x[slot] = x - Math.floor(x);
    this.y[slot] = unitY(record.latitude);
    this.group[slot] = this.groupOf(record);
    this.state[slot] = this.stateOf(record);
    this.groupCounts[this.group[slot]] += 1;
    this.stateCounts[this.state[slot]] += 1;
    return slot;
  }

  grow() {
    const capacity = 2 * this.x.length;
    for (const name of ['x', 'y', 'group', 'state', 'order']) {
      this[name] = grown(this[name], capacity);
    }
  }

  compare(a, b) {
    const one = this.records[a];
    const two = this.records[b];
    return two.updated - one.updated || two.sequence - one.sequence || a - b;
  }

  /** Where the slot stands, or belongs, among the first `length` of the order. */
  place(slot, length) {
    let from = 0;
    let to = length;
    while (from < to) {
      const middle = (from + to) >>> 1;
      if (this.compare(this.order[middle], slot) < 0) from = middle + 1;
      else to = middle;
    }
    return from;
  }

  isShown(slot) {
    return this.hiddenGroups[this.group[slot]] === 0 && this.hiddenStates[this.state[slot]] === 0
      && (this.onlyIds === null || this.onlyIds.has(this.records[slot].id))
      && (this.area === null || this.isInArea(slot))
      && (this.age === null || this.isOfAge(this.records[slot]));
  }

  isOfAge(record) {
    const time = record[this.age.time];
    return time > this.age.after && time < this.age.before;
  }

  /** The corners may have been drawn in another world than that of 0 to 1. */
  isInArea(slot) {
    const { x, y, area } = this;
    const worlds = Math.round(area[0][0] - x[slot]);
    return isWithin(area, x[slot] + worlds, y[slot]);
  }

  /** The shown ones, the newest first, from number `offset` on at most `limit`; in the `box` of
   * units ({west, east, north, south}) where one is given, and with every word of `text`. `index` is
   * the place of the record `wanted`, -1 where it is not among them. */
  rows({ offset, limit, box = null, text = '', wanted = null }) {
    const rows = [];
    const words = text.toLowerCase().split(/\s+/).filter((word) => word !== '');
    const wantedSlot = this.slots.get(wanted) ?? -1;
    let index = -1;
    let count = 0;
    for (let i = 0; i < this.size; i += 1) {
      const slot = this.order[i];
      if (!this.isShown(slot) || (box && this.shiftInto(box, slot) === null)) continue;
      if (words.length > 0 && !holds(this.records[slot], words)) continue;
      if (slot === wantedSlot) index = count;
      if (count >= offset && rows.length < limit) rows.push(this.records[slot]);
      count += 1;
    }
    return { rows, offset, count, index, size: this.size };
  }

  /** How many worlds to the east the slot must be taken to lie in the box; null where it does not
   * lie in it at all. */
  shiftInto(box, slot) {
    const y = this.y[slot];
    if (y < box.north || y > box.south) return null;
    const worlds = Math.ceil(box.west - this.x[slot]);
    return this.x[slot] + worlds <= box.east ? worlds : null;
  }
}
