// The background where there are no map tiles: a grid of parallels and meridians with their
// coordinates at the edges, finer as one zooms in.

import { coordinate } from '../format.js';
import { wrappedLongitude } from '../mercator.js';

const L = window.L;
const LEAST_SPACING_PX = 110;
const MINOR_PARTS = 5;

/** The step in degrees, 1, 2 or 5 times a power of ten, that keeps lines `pixels` apart. */
function stepFor(degreesPerPixel) {
  const least = degreesPerPixel * LEAST_SPACING_PX;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= least) * power;
  return Math.min(step, 30);
}

function digitsFor(step) {
  return Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
}

export const Graticule = L.Layer.extend({
  onAdd(map) {
    this.canvas = L.DomUtil.create('canvas', 'graticule');
    map.getContainer().prepend(this.canvas);
    map.on('move resize viewreset zoomend', this.draw, this);
    map.on('zoomanim', this.fade, this);
    this.scheme = matchMedia('(prefers-color-scheme: dark)');
    this.scheme.addEventListener('change', () => {
      this.colours = null;
      this.draw();
    });
    this.draw();
  },

  /** Lines cannot follow an animated zoom: they give way to it. */
  fade() {
    this.canvas.classList.add('zooming');
  },

  draw() {
    const map = this._map;
    if (!map) return;
    this.canvas.classList.remove('zooming');
    const size = map.getSize();
    const scale = window.devicePixelRatio || 1;
    this.canvas.width = size.x * scale;
    this.canvas.height = size.y * scale;
    const context = this.canvas.getContext('2d');
    context.scale(scale, scale);
    this.colours ??= this.findColours();
    context.font = '11px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';

    const middle = size.divideBy(2);
    const a = map.containerPointToLatLng(middle);
    const b = map.containerPointToLatLng(middle.add([100, 100]));
    this.drawLines(context, size, stepFor(Math.abs(b.lng - a.lng) / 100), true);
    this.drawLines(context, size, stepFor(Math.abs(b.lat - a.lat) / 100), false);
  },

  /** Asked for once: each time the browser would bring the style of the whole page up to date. */
  findColours() {
    const style = getComputedStyle(this._map.getContainer());
    return {
      minor: style.getPropertyValue('--grid-minor').trim(),
      major: style.getPropertyValue('--grid-major').trim(),
      label: style.getPropertyValue('--grid-label').trim(),
      halo: style.getPropertyValue('--map-ground').trim(),
    };
  },

  /** Meridians (`upright`) or parallels. */
  drawLines(context, size, step, upright) {
    const map = this._map;
    const northWest = map.containerPointToLatLng([0, 0]);
    const southEast = map.containerPointToLatLng(size);
    const from = upright ? northWest.lng : Math.max(southEast.lat, -85);
    const to = upright ? southEast.lng : Math.min(northWest.lat, 85);
    const minor = step / MINOR_PARTS;
    const labels = [];
    for (let k = Math.ceil(from / minor); k * minor <= to; k += 1) {
      const degrees = k * minor;
      const point = map.latLngToContainerPoint(upright ? [0, degrees] : [degrees, 0]);
      const at = Math.round(upright ? point.x : point.y) + 0.5;
      const major = k % MINOR_PARTS === 0;
      context.beginPath();
      context.moveTo(upright ? at : 0, upright ? 0 : at);
      context.lineTo(upright ? at : size.x, upright ? size.y : at);
      context.strokeStyle = major ? this.colours.major : this.colours.minor;
      context.lineWidth = 1;
      context.stroke();
      if (major) labels.push([at, degrees]);
    }
    for (const [at, degrees] of labels) this.drawLabel(context, size, at, degrees, step, upright);
  },

  drawLabel(context, size, at, degrees, step, upright) {
    const text = upright
      ? coordinate(wrappedLongitude(degrees), 'E', 'W', digitsFor(step))
      : coordinate(degrees, 'N', 'S', digitsFor(step));
    const x = upright ? at + 5 : 8;
    const y = upright ? 15 : at - 5;
    if (upright ? x > size.x - 60 : y < 30 || y > size.y - 64) return;
    context.lineWidth = 3;
    context.lineJoin = 'round';
    context.strokeStyle = this.colours.halo;
    context.strokeText(text, x, y);
    context.fillStyle = this.colours.label;
    context.fillText(text, x, y);
  },
});
