// Writes the names of streets along them, where there is room, upright.

const FONT = '500 11.5px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';
const MAX_LABELS = 150;
/** Ways of one street that go on so straight are one line. */
const MAX_BEND_RAD = 0.6;
/** A name is written where the street bends less than this under it. */
const MAX_CURVE_RAD = 0.25;
const MARGIN_PX = 8;
/** Between two times the same name. */
const REPEAT_PX = 360;
const MAX_NAME_LENGTH = 60;

function headingOf([ax, ay], [bx, by]) {
  return Math.atan2(by - ay, bx - ax);
}

function bend(a, b) {
  const turn = Math.abs(a - b) % (2 * Math.PI);
  return Math.min(turn, 2 * Math.PI - turn);
}

function endKey([x, y]) {
  return `${Math.round(x * 4)} ${Math.round(y * 4)}`;
}

/** Joins the paths of one street where they go on: mappers cut streets into short ways. */
function joined(paths) {
  const byEnd = new Map();
  for (const path of paths) {
    for (const end of [path[0], path[path.length - 1]]) {
      const key = endKey(end);
      if (!byEnd.has(key)) byEnd.set(key, []);
      byEnd.get(key).push(path);
    }
  }
  const used = new Set();
  const next = (path) => {
    const tail = path[path.length - 1];
    const heading = headingOf(path[path.length - 2], tail);
    for (const other of byEnd.get(endKey(tail)) ?? []) {
      if (used.has(other)) continue;
      const onwards = endKey(other[0]) === endKey(tail) ? other : [...other].reverse();
      if (bend(headingOf(onwards[0], onwards[1]), heading) > MAX_BEND_RAD) continue;
      used.add(other);
      return onwards;
    }
    return null;
  };
  const result = [];
  for (const path of paths) {
    if (used.has(path)) continue;
    used.add(path);
    let whole = path;
    for (let turn = 0; turn < 2; turn += 1) {
      for (let more = next(whole); more; more = next(whole)) whole = [...whole, ...more.slice(1)];
      whole = [...whole].reverse();
    }
    result.push(whole);
  }
  return result;
}

/** Straight stretches of at least `length` pixels: their middles and headings, the longest first. */
function stretches(path, length) {
  const found = [];
  let begin = 0;
  for (let i = 1; i <= path.length - 1; i += 1) {
    const isLast = i === path.length - 1;
    const first = headingOf(path[begin], path[begin + 1]);
    const turns = !isLast && bend(headingOf(path[i], path[i + 1]), first) > MAX_CURVE_RAD;
    if (!turns && !isLast) continue;
    const [ax, ay] = path[begin];
    const [bx, by] = path[i];
    const size = Math.hypot(bx - ax, by - ay);
    if (size >= length) {
      // A long one has its name several times.
      const times = Math.max(1, Math.floor(size / REPEAT_PX));
      for (let k = 0; k < times; k += 1) {
        const share = (k + 0.5) / times;
        found.push({ x: ax + share * (bx - ax), y: ay + share * (by - ay), size: size / times,
          angle: headingOf(path[begin], path[i]) });
      }
    }
    begin = i;
  }
  return found.sort((a, b) => b.size - a.size);
}

function upright(angle) {
  if (angle > Math.PI / 2) return angle - Math.PI;
  return angle <= -Math.PI / 2 ? angle + Math.PI : angle;
}

/** Circles along the text, which are cheap to keep apart. */
function circlesOf({ x, y, angle }, width) {
  const count = Math.max(1, Math.ceil(width / 14));
  return Array.from({ length: count }, (_, i) => {
    const along = width * ((i + 0.5) / count - 0.5);
    return [x + along * Math.cos(angle), y + along * Math.sin(angle)];
  });
}

class Room {
  constructor() {
    this.cells = new Map();
  }

  static key(x, y) {
    return `${Math.floor(x / 16)} ${Math.floor(y / 16)}`;
  }

  isFree(circles) {
    return circles.every(([x, y]) => {
      for (let dx = -16; dx <= 16; dx += 16) {
        for (let dy = -16; dy <= 16; dy += 16) {
          const near = this.cells.get(Room.key(x + dx, y + dy)) ?? [];
          if (near.some(([ox, oy]) => Math.hypot(ox - x, oy - y) < 15)) return false;
        }
      }
      return true;
    });
  }

  take(circles) {
    for (const [x, y] of circles) {
      const key = Room.key(x, y);
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push([x, y]);
    }
  }
}

function pathsByName(lines) {
  const streets = new Map();
  for (const { name, path } of lines) {
    if (!streets.has(name)) streets.set(name, []);
    if (path.length > 1) streets.get(name).push(path);
  }
  return streets;
}

/** Writes names onto `lines` of {name, path}, the most important first; answers those that it wrote.
 * A name is drawn on a canvas: whatever it holds, it is text. */
export function placeLabels(context, lines, extent, colours) {
  context.font = FONT;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineWidth = 3;
  context.strokeStyle = colours.halo;
  context.fillStyle = colours.text;
  const room = new Room();
  const written = [];
  for (const [name, paths] of pathsByName(lines)) {
    const text = name.length > MAX_NAME_LENGTH ? `${name.slice(0, MAX_NAME_LENGTH)}\u2026` : name;
    const { width } = context.measureText(text);
    const mine = [];
    for (const place of joined(paths).flatMap((path) => stretches(path, width + MARGIN_PX))) {
      if (written.length >= MAX_LABELS) return written;
      const inView = place.x > 0 && place.y > 0 && place.x < extent.x && place.y < extent.y;
      const isNear = mine.some((other) => (
        Math.hypot(other.x - place.x, other.y - place.y) < REPEAT_PX / 2));
      if (!inView || isNear) continue;
      const circles = circlesOf(place, width);
      if (!room.isFree(circles)) continue;
      room.take(circles);
      mine.push(place);
      context.save();
      context.translate(place.x, place.y);
      context.rotate(upright(place.angle));
      context.strokeText(text, 0, 0);
      context.fillText(text, 0, 0);
      context.restore();
      written.push(name);
    }
  }
  return written;
}
