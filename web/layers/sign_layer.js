// Signs on the map, single ones and rings, as zone_worker.js finds them for what is in view: never
// more than MAX_SIGNS, however many hazards there are. Each is a button, so that one gets along
// without a mouse.

import { element, nextTask, oneAtATime, throttled } from '../dom.js';
import { latitudeOf, longitudeOf, nearLongitude, unitX, unitY } from '../mercator.js';
import { renew } from '../renew.js';
import { whenStill } from './still_map.js';

const L = window.L;
const MAX_SIGNS = 150;
/** Of the view, around it: what comes into view while one drags is there already. */
const MARGIN = 0.2;
const PULSE_MS = 4500;
/** More at once say no more. */
const MAX_PULSES = 20;
/** While signs are drawn the page answers after so many milliseconds. */
const SLICE_MS = 8;
/** A hazard that is looked for is shown at least so near. */
const STREET_ZOOM = 17;
/** What even the nearest zoom does not part further than this is listed instead. */
const PARTED_PX = 60;
const MAX_LISTED = 30;
const ARROWS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] };

export const SignIcon = L.Icon.extend({
  createIcon() {
    const { name, build } = this.options;
    const node = element('button', { type: 'button', title: name, 'aria-label': name });
    build(node);
    this._setIconStyles(node, 'icon');
    node.classList.add('sign');
    return node;
  },

  createShadow() {
    return null;
  },
});

/** Leaflet gives each marker a layer of the graphics card and moves it while the map zooms. A zoom
 * brings other rings anyway: these lie in one layer and are not there meanwhile. */
const SignMarker = L.Marker.extend({
  onAdd(map) {
    this._zoomAnimated = false;
    L.Marker.prototype.onAdd.call(this, map);
  },

  _setPos(position) {
    const node = this._icon;
    node._leaflet_pos = position;
    node.style.left = `${position.x}px`;
    node.style.top = `${position.y}px`;
    this._zIndex = position.y + this.options.zIndexOffset;
    this._resetZIndex();
  },
});

/** Its content changes where it stands: Leaflet would take it out and put it in again, and whoever
 * presses or reads something there would lose it. */
const LastingPopup = L.Popup.extend({
  _updateContent() {
    if (this._content?.parentNode === this._contentNode) return;
    L.Popup.prototype._updateContent.call(this);
  },
});

/** Leaflet's bounds in units of the world's width. */
export function unitBox(bounds) {
  return { west: unitX(bounds.getWest()), east: unitX(bounds.getEast()),
    north: unitY(bounds.getNorth()), south: unitY(bounds.getSouth()) };
}

/** A trifle: what stands on the edge is inside, however its world was rounded. */
function widened({ west, east, north, south }) {
  const trifle = 1e-12;
  return { west: west - trifle, east: east + trifle, north: north - trifle, south: south + trifle };
}

export class SignLayer {
  /** `kind` is 'hazards' or 'changes'. `look` has sign(record) and ring(sign), options of SignIcon
   * ({name, className, iconSize, iconAnchor, build(node)}), popup(record), the popup's content,
   * load(id), a promise of all that is known of one, colour(record), offset, the popup's, row(record),
   * the content of a line in a list, and many(count), in words. `coveredHeight` is of the map's
   * foot, pixels. */
  constructor(map, data, kind, look, coveredHeight) {
    this.map = map;
    this.data = data;
    this.kind = kind;
    this.look = look;
    this.coveredHeight = coveredHeight;
    this.group = L.layerGroup().addTo(map);
    this.markers = new Map();
    this.popup = null;
    this.pulses = 0;
    this.zooming = false;
    /** Draws what is now in view. */
    this.refresh = oneAtATime(() => this.askAndDraw());
    this.refreshSoon = throttled(() => this.refresh(), 150);
    map.on('zoomstart', () => { this.zooming = true; });
    map.on('zoomend', () => { this.zooming = false; });
    map.on('move', () => { if (!this.zooming) this.refreshSoon(); });
    map.on('moveend', () => this.refresh());
    map.on('popupclose', (event) => this.onPopupClose(event.popup));
    map.getPane('markerPane').addEventListener('keydown', (event) => this.moveFocus(event));
  }

  setVisible(visible) {
    if (visible) this.group.addTo(this.map);
    else this.group.remove();
    if (!visible && this.popup) this.map.closePopup(this.popup);
    this.refresh();
  }

  async askAndDraw() {
    const zoom = this.map.getZoom();
    const asked = this.popup?.id ?? null;
    const { signs, pinnedIs } = await this.data.ask('signs', this.kind, {
      box: unitBox(this.map.getBounds().pad(MARGIN)), zoom, most: MAX_SIGNS,
      pinned: asked,
    });
    // It left the map, or somebody hid its kind or state.
    if (asked !== null && asked === this.popup?.id && pinnedIs !== 'shown') {
      this.map.closePopup(this.popup);
    }
    // A zoom ends with one more question.
    await this.draw(signs, () => !this.zooming && this.map.getZoom() === zoom);
  }

  /** In slices, and only as long as `fits()`: the signs are of one zoom. */
  async draw(signs, fits) {
    if (!fits()) return;
    const focused = [...this.markers].find(([, marker]) =>
      marker.getElement() === document.activeElement);
    const wanted = new Set(signs.map((sign) => sign.key));
    for (const [key, marker] of this.markers) {
      // What has the focus goes last: who comes next to it must be there.
      if (!wanted.has(key) && key !== focused?.[0]) this.drop(key, marker);
    }
    let start = performance.now();
    for (const sign of signs) {
      if (performance.now() - start > SLICE_MS) {
        await nextTask();
        if (!fits()) return;
        start = performance.now();
      }
      const known = this.markers.get(sign.key);
      if (known) this.update(known, sign);
      else this.markers.set(sign.key, this.createMarker(sign));
      this.updateStop(this.markers.get(sign.key));
    }
    if (focused && !wanted.has(focused[0])) this.drop(...focused);
    if (focused) this.keepFocus(...focused);
  }

  drop(key, marker) {
    this.group.removeLayer(marker);
    this.markers.delete(key);
  }

  createMarker(sign) {
    const marker = new SignMarker([sign.latitude, sign.longitude],
      { icon: this.icon(sign), keyboard: false, riseOnHover: true });
    marker.sign = sign;
    marker.on('click', (event) => this.activate(marker.sign, event.originalEvent?.detail === 0));
    return marker.addTo(this.group);
  }

  update(marker, sign) {
    if (signature(marker.sign) !== signature(sign)) {
      const held = marker.getElement() === document.activeElement;
      marker.setIcon(this.icon(sign));
      if (held) marker.getElement()?.focus({ preventScroll: true });
    }
    const { lat, lng } = marker.getLatLng();
    if (lat !== sign.latitude || lng !== sign.longitude) {
      marker.setLatLng([sign.latitude, sign.longitude]);
    }
    marker.sign = sign;
  }

  icon(sign) {
    return new SignIcon(sign.record ? this.look.sign(sign.record) : this.look.ring(sign));
  }

  /** Tab reaches what is in view, nothing else: the browser would scroll to it. */
  updateStop(marker) {
    const size = this.map.getSize();
    const at = this.map.latLngToContainerPoint(marker.getLatLng());
    const inView = at.x >= 0 && at.x <= size.x && at.y >= 0
      && at.y <= size.y - this.coveredHeight;
    const stop = inView ? '0' : '-1';
    const node = marker.getElement();
    if (node && node.getAttribute('tabindex') !== stop) node.setAttribute('tabindex', stop);
  }

  /** What had the focus has it still; where that one is gone, what now stands nearest. Whoever went
   * on meanwhile is left where they are. */
  keepFocus(key, old) {
    if (document.activeElement !== document.body) return;
    const place = this.map.latLngToContainerPoint(old.getLatLng());
    const next = this.markers.get(key) ?? this.nearest((at) => at.distanceTo(place));
    (next?.getElement() ?? this.map.getContainer()).focus({ preventScroll: true });
  }

  /** The sign that can be focused with the least `cost(point)`; null where all cost Infinity. */
  nearest(cost) {
    let best = null;
    let least = Infinity;
    for (const marker of this.markers.values()) {
      if (marker.getElement()?.getAttribute('tabindex') !== '0') continue;
      const here = cost(this.map.latLngToContainerPoint(marker.getLatLng()));
      if (here < least) [best, least] = [marker, here];
    }
    return best;
  }

  /** An arrow goes to the next sign in its direction. */
  moveFocus(event) {
    const arrow = ARROWS[event.key];
    const marker = [...this.markers.values()].find((one) => one.getElement() === event.target);
    if (!arrow || !marker) return;
    event.preventDefault();
    event.stopPropagation();
    const from = this.map.latLngToContainerPoint(marker.getLatLng());
    const next = this.nearest((at) => {
      const along = (at.x - from.x) * arrow[0] + (at.y - from.y) * arrow[1];
      const aside = Math.abs((at.x - from.x) * arrow[1] + (at.y - from.y) * arrow[0]);
      return along > 1 ? along + 2 * aside : Infinity;
    });
    next?.getElement().focus({ preventScroll: true });
  }

  activate(sign, byKeyboard) {
    if (sign.record) {
      this.openAt(sign.record, byKeyboard, () => this.focusSign(sign.key));
      return;
    }
    const { box } = sign;
    const scale = 256 * 2 ** this.map.getMaxZoom();
    if (Math.max(box.east - box.west, box.south - box.north) * scale < PARTED_PX) {
      this.listRing(sign, byKeyboard);
    } else {
      whenStill(this.map, () => this.zoomTo(sign));
    }
  }

  /** Nearer to what the ring stands for. */
  zoomTo({ box, latitude, longitude }) {
    const bounds = L.latLngBounds([latitudeOf(box.south), longitudeOf(box.west)],
      [latitudeOf(box.north), longitudeOf(box.east)]);
    const whole = this.map.getBoundsZoom(bounds, false, L.point(80, 100));
    const next = Math.min(this.map.getZoom() + 1, this.map.getMaxZoom());
    if (whole >= next) this.map.setView(bounds.getCenter(), Math.min(whole, this.map.getMaxZoom()));
    else this.map.setView([latitude, longitude], next);
  }

  /** Several at one place: their list. */
  async listRing(sign, byKeyboard) {
    const { rows, count } = await this.data.ask('rows', this.kind,
      { offset: 0, limit: MAX_LISTED, box: widened(sign.box) });
    const list = element('ul', { class: 'here' }, ...rows.map((record) => {
      const button = element('button', { type: 'button', class: 'row' }, ...this.look.row(record));
      button.addEventListener('click', (event) => this.openAt(record, event.detail === 0,
        () => this.focusSign(sign.key)));
      return element('li', {}, button);
    }));
    const title = this.look.many(count);
    const content = element('article',
      { class: 'popup', role: 'dialog', tabindex: '-1', 'aria-label': title },
      element('h3', { class: 'popup-title' }, `${title} here`), list,
      ...(count > rows.length ? [element('p', { class: 'note' }, `The newest ${rows.length}.`)] : []));
    this.showPopup(null, [sign.latitude, sign.longitude], content, [0, -16],
      byKeyboard, () => this.focusSign(sign.key));
  }

  /** From a list: brings the record into view and opens its popup, which gets the focus. `back`
   * gives the focus back when the popup closes. */
  open(record, back) {
    whenStill(this.map, () => {
      const place = this.placeOf(record);
      if (!this.markers.has(`one ${record.id}`) || !this.map.getBounds().contains(place)) {
        this.map.setView(place, Math.max(this.map.getZoom(), STREET_ZOOM), { animate: false });
      }
      this.openAt(record, true, back);
    });
  }

  placeOf(record) {
    return L.latLng(record.latitude,
      nearLongitude(record.longitude, this.map.getCenter().lng));
  }

  /** Opens the popup of the record where the map is now. */
  openAt(record, focus, back) {
    this.showPopup(record.id, this.placeOf(record), this.look.popup(record), this.look.offset,
      focus, back);
    const { popup } = this;
    this.data.watch(this.kind, record.id);
    this.look.load(record.id).then((whole) => {
      if (this.popup === popup && whole.sequence >= popup.sequence) this.fill(whole, true);
    }).catch(() => {
      if (this.popup === popup) popup.getElement()?.querySelector('.popup')?.classList.add('stale');
    });
    popup.record = record;
    popup.sequence = record.sequence;
    this.refresh();
  }

  showPopup(id, place, content, offset, focus, back) {
    const popup = new LastingPopup({
      minWidth: 296, maxWidth: 296, className: 'hazard-popup', offset,
      autoPanPaddingTopLeft: [16, 16], autoPanPaddingBottomRight: [16, 16 + this.coveredHeight],
    }).setLatLng(place).setContent(content);
    popup.id = id;
    popup.back = back;
    this.map.openPopup(popup);
    this.popup = popup;
    if (focus) content.focus({ preventScroll: true });
  }

  /** Takes what the zone tells of the record whose popup may be open; null: it is off the map. */
  onWatched(id, record) {
    if (this.popup?.id !== id) return;
    if (record === null) this.map.closePopup(this.popup);
    // What was asked for may be newer than what is told.
    else if (record.sequence >= this.popup.sequence) this.fill(record, false);
  }

  /** Brings the popup up to date; what had the focus in it keeps it. The map moves where it must be
   * seen as a whole: it does not run after it for news. */
  fill(record, isSeenWhole) {
    const { popup } = this;
    const content = popup.getContent();
    const active = document.activeElement;
    const held = content.contains(active);
    const name = held ? active.dataset.focus : undefined;
    popup.record = record;
    popup.sequence = record.sequence;
    renew(content, this.look.popup(record));
    popup.options.autoPan = false;
    popup.setLatLng(this.placeOf(record));
    popup.options.autoPan = isSeenWhole;
    popup.update();
    if (held && !content.contains(document.activeElement)) this.focusPopup(record.id, name);
  }

  /** Draws the popup anew, as far as its record is known; `isSeenWhole` as for fill. */
  redraw(id, isSeenWhole = true) {
    if (id !== null && this.popup?.id === id) this.fill(this.popup.record, isSeenWhole);
  }

  /** The control of this name in the open popup, else the popup itself. */
  focusPopup(id, name) {
    if (this.popup?.id !== id) return;
    const node = this.popup.getElement()?.querySelector('.popup');
    (node?.querySelector(`[data-focus="${name}"]`) ?? node)?.focus({ preventScroll: true });
  }

  onPopupClose(popup) {
    if (popup !== this.popup) return;
    const active = document.activeElement;
    const held = popup.getElement()?.contains(active) || active === document.body;
    this.popup = null;
    this.data.watch(null, null);
    if (held) popup.back?.();
    this.refresh();
  }

  focusSign(key) {
    const node = this.markers.get(key)?.getElement() ?? this.map.getContainer();
    node.focus({ preventScroll: true });
  }

  /** A ring that spreads for a moment where something is new, also above a cluster. */
  highlight(record) {
    const place = this.placeOf(record);
    if (this.pulses >= MAX_PULSES || !this.map.getBounds().contains(place)) return;
    this.pulses += 1;
    const icon = L.divIcon({ className: 'pulse', iconSize: [64, 64] });
    const pulse = L.marker(place,
      { icon, interactive: false, keyboard: false, zIndexOffset: -1000 }).addTo(this.map);
    pulse.getElement().style.setProperty('--colour', this.look.colour(record));
    setTimeout(() => {
      pulse.remove();
      this.pulses -= 1;
    }, PULSE_MS);
  }
}

/** What is drawn of a sign, apart from its place. */
function signature({ record, count, shares }) {
  if (record) return `${record.className} ${record.label} ${record.state} ${record.direction}`;
  return `${count} ${shares.join(' ')}`;
}
