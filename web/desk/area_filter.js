// An area drawn on the map, corner by corner: only hazards within it are shown, listed and exported.

import { byId, setText } from '../dom.js';
import { unitX, unitY } from '../mercator.js';

const L = window.L;
const MAX_CORNERS = 60;
const CLOSE_PX = 14;

export class AreaFilter {
  /** `onArea(corners)` shows only what lies within the corners ([x, y] in units), all with null;
   * `onBegin()` is called when the map is needed. */
  constructor(map, onArea, onBegin) {
    this.map = map;
    this.onArea = onArea;
    this.onBegin = onBegin;
    this.corners = [];
    this.isDrawing = false;
    this.shape = null;
    this.button = byId('area-draw');
    this.clearButton = byId('area-clear');
    this.button.addEventListener('click', () => (this.isDrawing ? this.finish() : this.begin()));
    this.clearButton.addEventListener('click', () => this.clear());
    this.onClick = ({ latlng }) => this.add(latlng);
    document.addEventListener('keydown', (event) => {
      if (!this.isDrawing) return;
      if (event.key === 'Escape') this.clear();
      if (event.key === 'Enter' && document.activeElement?.closest('.map')) this.finish();
    });
  }

  begin() {
    this.clear();
    this.isDrawing = true;
    this.map.closePopup();
    this.map.doubleClickZoom.disable();
    this.map.getContainer().classList.add('drawing');
    this.map.on('click', this.onClick);
    this.show();
    this.onBegin();
  }

  /** A tap on the first corner ends it. */
  add(latlng) {
    const isFirst = this.corners.length > 2 && this.map.latLngToContainerPoint(latlng)
      .distanceTo(this.map.latLngToContainerPoint(this.corners[0])) < CLOSE_PX;
    if (isFirst) this.finish();
    if (isFirst || this.corners.length >= MAX_CORNERS) return;
    this.corners.push(latlng);
    this.show();
  }

  end() {
    this.isDrawing = false;
    this.map.off('click', this.onClick);
    this.map.doubleClickZoom.enable();
    this.map.getContainer().classList.remove('drawing');
  }

  finish() {
    if (this.corners.length < 3) {
      this.clear();
      return;
    }
    this.end();
    this.show();
    this.onArea(this.corners.map(({ lat, lng }) => [unitX(lng), unitY(lat)]));
  }

  clear() {
    const had = this.corners.length > 0;
    this.end();
    this.corners = [];
    this.show();
    if (had) this.onArea(null);
  }

  show() {
    this.shape?.remove();
    this.shape = null;
    if (this.corners.length > 0) {
      this.shape = L.polygon(this.corners, { className: 'area-shape', interactive: false }).addTo(this.map);
    }
    setText(this.button, this.isDrawing ? `Done (${this.corners.length} corners)` : 'Draw an area');
    this.button.setAttribute('aria-pressed', String(this.isDrawing));
    this.clearButton.hidden = !this.isDrawing && this.corners.length === 0;
  }
}
