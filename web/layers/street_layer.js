// The zone's streets under the hazards, as lines with names, in the page's own style. They come from
// the zone in square tiles, and are kept while they are near what one sees.

import { getStreets } from '../zone_lists.js';
import { latitudeOf, longitudeOf, unitX, unitY } from '../mercator.js';
import { placeLabels } from './street_labels.js';
import { TrailCanvas } from './trail_canvas.js';

const L = window.L;
/** The zone's zoom counts tiles of 256 pixels; these are twice as wide. */
const TILE_PX = 512;
/** Lines are simplified for a zoom; beyond this one they are as they are. */
const MAX_ZOOM = 19;
const MAX_TILES = 96;
/** So many coarser zooms stand in for a tile that has not come. */
const STAND_INS = 4;
const RETRY_MS = 5000;
/** Read aloud to those who do not see the map. */
const NAMES_TOLD = 12;

/** Width at zoom 14 in pixels, and the first zoom with names, by class; the last is on top. */
const CLASSES = [
  ['service', { width: 1.3, names: 17 }],
  ['residential', { width: 2.4, names: 15 }],
  ['tertiary', { width: 3.2, names: 14 }],
  ['secondary', { width: 4, names: 13.5 }],
  ['primary', { width: 4.6, names: 13 }],
  ['trunk', { width: 5, names: 12 }],
  ['motorway', { width: 5.4, names: 12 }],
];
const RANKS = new Map(CLASSES.map(([name], rank) => [name, rank]));
const GROWTH = 1.45;

function widthOf(rank, link, zoom) {
  const width = CLASSES[rank][1].width * GROWTH ** (zoom - 14);
  return Math.max(0.7, link ? 0.6 * width : width);
}

/** A feature of the API as what is drawn: places in units of the world's width. */
function lineOf({ properties, geometry }) {
  const points = geometry.coordinates.map(([longitude, latitude]) => (
    [unitX(longitude), unitY(latitude)]));
  return {
    key: `${properties.way} ${geometry.coordinates[0]}`,
    name: properties.name === null ? '' : String(properties.name),
    rank: RANKS.get(properties.class) ?? 0,
    link: properties.link === true,
    points,
  };
}

/** Tiles of streets: those that are wanted are asked for, those not wanted for long are forgotten. */
class StreetTiles {
  constructor(onCome) {
    this.onCome = onCome;
    /** By "zoom/x/y", the one wanted last at the end: the lines, or null while they are coming. */
    this.tiles = new Map();
  }

  /** The lines of a tile, or of the smallest one around it that is there. */
  lines(zoom, x, y) {
    this.want(zoom, x, y);
    for (let up = 0; up <= Math.min(STAND_INS, zoom); up += 1) {
      const lines = this.tiles.get(`${zoom - up}/${x >> up}/${y >> up}`);
      if (lines) return lines;
    }
    return [];
  }

  want(zoom, x, y) {
    const key = `${zoom}/${x}/${y}`;
    const known = this.tiles.get(key);
    this.tiles.delete(key);
    this.tiles.set(key, known ?? null);
    if (known === undefined) this.load(key, zoom, x, y);
    for (const oldest of this.tiles.keys()) {
      if (this.tiles.size <= MAX_TILES) break;
      this.tiles.delete(oldest);
    }
  }

  async load(key, zoom, x, y) {
    const size = 1 / 2 ** zoom;
    const box = [longitudeOf(x * size), latitudeOf((y + 1) * size), longitudeOf((x + 1) * size),
      latitudeOf(y * size)].map((degrees) => degrees.toFixed(7));
    const known = await getStreets(box, zoom + 1).catch(() => null);
    if (!this.tiles.has(key)) return;
    if (known === null) {
      setTimeout(() => {
        this.tiles.delete(key);
        this.onCome();
      }, RETRY_MS);
      return;
    }
    this.tiles.set(key, known.features.map(lineOf));
    this.onCome();
  }
}

export class StreetLayer {
  constructor(map) {
    this.map = map;
    map.createPane('streets').style.zIndex = 250;
    this.canvas = new TrailCanvas('streets', (...canvas) => this.paint(...canvas));
    this.tiles = new StreetTiles(() => this.canvas.drawSoon());
    this.colours = null;
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.colours = null;
      this.canvas.drawSoon();
    });
    this.canvas.addTo(map);
  }

  findColours() {
    const style = getComputedStyle(this.map.getContainer());
    const colour = (name) => style.getPropertyValue(name).trim();
    return {
      edge: colour('--street-edge'),
      text: colour('--street-text'),
      halo: colour('--street-halo'),
      fill: CLASSES.map(([name]) => colour(`--street-${name}`) || colour('--street-residential')),
    };
  }

  /** The lines in view, each once: long streets are in several tiles. */
  linesInView() {
    const bounds = this.map.getBounds().pad(0.25);
    const zoom = Math.max(0, Math.min(Math.floor(this.map.getZoom()), MAX_ZOOM)
      - Math.log2(TILE_PX / 256));
    const count = 2 ** zoom;
    const lines = new Map();
    const lastX = Math.floor(unitX(bounds.getEast()) * count);
    const lastY = Math.min(count - 1, Math.floor(unitY(bounds.getSouth()) * count));
    for (let y = Math.max(0, Math.floor(unitY(bounds.getNorth()) * count)); y <= lastY; y += 1) {
      for (let x = Math.floor(unitX(bounds.getWest()) * count); x <= lastX; x += 1) {
        const world = Math.floor(x / count);
        for (const line of this.tiles.lines(zoom, x - world * count, y)) {
          lines.set(`${world} ${line.key}`, { ...line, world });
        }
      }
    }
    return [...lines.values()].sort((a, b) => a.rank - b.rank);
  }

  paint(context, project, extent) {
    this.colours ??= this.findColours();
    const zoom = this.map.getZoom();
    const lines = this.linesInView().map((line) => ({
      ...line, path: line.points.map(([x, y]) => project(x + line.world, y)),
    }));
    context.lineJoin = 'round';
    context.lineCap = 'round';
    const stroke = (line, width, colour) => {
      context.beginPath();
      for (const [x, y] of line.path) context.lineTo(x, y);
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.stroke();
    };
    for (const line of lines) {
      const width = widthOf(line.rank, line.link, zoom);
      if (width > 1.6) stroke(line, width + 2, this.colours.edge);
    }
    for (const line of lines) {
      const width = widthOf(line.rank, line.link, zoom);
      stroke(line, width, width > 1.6 ? this.colours.fill[line.rank] : this.colours.edge);
    }
    const named = lines.filter(({ name, rank }) => name !== '' && zoom >= CLASSES[rank][1].names);
    this.tell(placeLabels(context, named.reverse(), extent, this.colours));
  }

  tell(names) {
    const { canvas } = this.canvas;
    canvas.setAttribute('role', 'img');
    const told = [...new Set(names)].slice(0, NAMES_TOLD).join(', ');
    canvas.setAttribute('aria-label', told === '' ? 'Streets' : `Streets: ${told}`);
  }
}
