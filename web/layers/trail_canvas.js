// Where vehicles drove: blue dots, and under them the road where there are no map tiles. All of it is
// drawn on two canvases, with what is nearer than one can tell apart left out.

import { unitX, unitY } from '../mercator.js';

const L = window.L;
const TILE_PX = 256;
/** Of the view, around it: what comes into view while one drags is there already. */
const MARGIN = 0.25;
const DOT_RADIUS_PX = 3;
const LEAST_STEP_PX = 2;

export const TrailCanvas = L.Layer.extend({
  /** `paint(context, project)` draws; `project(ux, uy)` answers [x, y] in pixels. */
  initialize(pane, paint) {
    L.setOptions(this, { pane });
    this.paint = paint;
    this.frame = null;
  },

  onAdd(map) {
    this.canvas = L.DomUtil.create('canvas', 'leaflet-zoom-animated', this.getPane());
    map.on('moveend resize viewreset', this.draw, this);
    map.on('zoomanim', this.animate, this);
    this.draw();
  },

  drawSoon() {
    this.frame ??= requestAnimationFrame(() => this.draw());
  },

  draw() {
    cancelAnimationFrame(this.frame);
    this.frame = null;
    const map = this._map;
    const size = map.getSize();
    const corner = size.multiplyBy(-MARGIN).round();
    const extent = size.multiplyBy(1 + 2 * MARGIN).round();
    const ratio = Math.ceil(window.devicePixelRatio || 1);
    this.zoom = map.getZoom();
    this.corner = map.containerPointToLatLng(corner);
    if (this.canvas.width !== extent.x * ratio || this.canvas.height !== extent.y * ratio) {
      this.canvas.width = extent.x * ratio;
      this.canvas.height = extent.y * ratio;
      this.canvas.style.width = `${extent.x}px`;
      this.canvas.style.height = `${extent.y}px`;
    }
    L.DomUtil.setPosition(this.canvas, map.containerPointToLayerPoint(corner));
    const context = this.canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, extent.x, extent.y);
    const scale = TILE_PX * 2 ** this.zoom;
    const left = unitX(this.corner.lng) * scale;
    const top = unitY(this.corner.lat) * scale;
    this.paint(context, (x, y) => [x * scale - left, y * scale - top], extent);
  },

  animate(event) {
    const scale = this._map.getZoomScale(event.zoom, this.zoom);
    const offset = this._map._latLngToNewLayerPoint(this.corner, event.zoom, event.center);
    L.DomUtil.setTransform(this.canvas, offset, scale);
  },
});

/** Places one behind the other, in units of the world's width; each at most half the world from the
 * one before, so that a way across 180 degrees is no way around the world. */
export class Trail {
  constructor() {
    this.points = [];
  }

  /** `starts`: no way leads here from the place before. */
  add(longitude, latitude, starts) {
    let x = unitX(longitude);
    const last = this.points[this.points.length - 1];
    if (last) x += Math.round(last.x - x);
    this.points.push({ x, y: unitY(latitude), longitude, latitude, starts });
  }

  /** How many worlds to the east it is drawn, to be where the view is. */
  worlds(centre) {
    const last = this.points[this.points.length - 1];
    return last ? Math.round(centre - last.x) : 0;
  }
}

/** Calls `visit(x, y, starts)` for the points in the canvas, and for those that lines from it lead to. */
function visitSeen(points, worlds, project, extent, visit) {
  const margin = 20;
  let last = null;
  for (let i = 0; i < points.length; i += 1) {
    const [x, y] = project(points[i].x + worlds, points[i].y);
    const step = last ? Math.max(Math.abs(x - last.x), Math.abs(y - last.y)) : Infinity;
    const isEnd = i === points.length - 1 || points[i + 1].starts;
    if (step < LEAST_STEP_PX && !isEnd && !points[i].starts) continue;
    const isSeen = x > -margin && y > -margin && x < extent.x + margin && y < extent.y + margin;
    if (isSeen || last?.isSeen || points[i].starts) {
      if (isSeen && last && !last.isSeen && !points[i].starts) visit(last.x, last.y, true, false);
      visit(x, y, points[i].starts, isSeen);
    }
    last = { x, y, isSeen };
  }
}

export function paintDots(context, points, worlds, project, extent) {
  context.beginPath();
  visitSeen(points, worlds, project, extent, (x, y, starts, isSeen) => {
    if (!isSeen) return;
    context.moveTo(x + DOT_RADIUS_PX, y);
    context.arc(x, y, DOT_RADIUS_PX, 0, 2 * Math.PI);
  });
  // The rims first: where dots overlap, no rim lies on a dot.
  context.strokeStyle = '#ffffff';
  context.lineWidth = 2;
  context.stroke();
  context.fillStyle = '#1f6feb';
  context.fill();
}

export function paintRoad(context, points, worlds, project, extent, styles) {
  context.beginPath();
  visitSeen(points, worlds, project, extent, (x, y, starts) => {
    if (starts) context.moveTo(x, y);
    else context.lineTo(x, y);
  });
  context.lineCap = 'round';
  context.lineJoin = 'round';
  for (const [width, colour] of styles) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.stroke();
  }
}
